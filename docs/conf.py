"""The site, built by Sphinx: `make docs`. `sources.py` makes pages from declarations, and what tutorials run in."""

import os
import re
import shutil
import sys
from functools import partialmethod
from importlib.metadata import version as version_of
from pathlib import Path
from urllib.parse import unquote

from docutils import nodes
from jupyter_cache import get_cache
from nbclient import NotebookClient
from sphinx.application import Sphinx
from sphinx.errors import ExtensionError
from sphinx.util.parallel import make_chunks

sys.path.insert(0, str(Path(__file__).parent))
from equations import show_block, show_inline
from sentences import MOST_WORDS, long_sentences

project = "handover-cosim"
author = "The handover-cosim authors"
copyright = "the handover-cosim authors, MIT licence"  # noqa: A001
version = release = version_of("handover-cosim")

extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx_click", "sphinx_copybutton"]
myst_enable_extensions = ["colon_fence", "dollarmath"]
myst_heading_anchors = 3
exclude_patterns = ["c_host", "build", "templates"]
suppress_warnings = ["misc.highlighting_failure"]

autodoc_typehints = "description"
autodoc_member_order = "bysource"
add_module_names = False
default_role = "literal"
smartquotes = False
highlight_language = "none"

# Tutorials: executed in an empty folder each, again where the product has changed.
_TUTORIALS = Path(__file__).parent / "build" / "tutorials"
os.environ["JUPYTER_PATH"] = str(_TUTORIALS / "jupyter")
nb_execution_mode = "cache"
nb_execution_cache_path = str(_TUTORIALS / "outputs")
nb_kernel_rgx_aliases = {".*": "tutorial"}
nb_execution_in_temp = True
nb_execution_excludepatterns = [] if shutil.which("octave-cli") else ["tutorials/octave.md"]
nb_execution_raise_on_error = True
nb_execution_timeout = 600
nb_merge_streams = True
# IPython sends what a command prints in pieces of 100 characters; MyST-NB alone would make lines of them.
NotebookClient.__init__ = partialmethod(NotebookClient.__init__, coalesce_streams=True)

html_math_renderer = "mathml"
html_theme = "furo"
templates_path = ["templates"]  # of which Sphinx reads search.html alone
html_title = f"handover-cosim {release}"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_theme_options = {"sidebar_hide_name": False, "navigation_with_keys": True}
html_copy_source = False
html_show_search_summary = False  # excerpts are fetched, which a page that is opened as a file cannot do
html_extra_path = ["build/files"]
copybutton_exclude = ".linenos, .gp, .go"


def set_code(app: Sphinx, what: str, name: str, obj: object, options: object, lines: list[str]) -> None:  # noqa: ARG001
    """Show what is indented after a line that ends with a colon, as docstrings have their examples, as code."""
    for i, line in enumerate(lines[:-2]):
        if line.endswith(":") and not lines[i + 1] and lines[i + 2].startswith("    "):
            lines[i] = f"{line}:"


def set_columns(app: Sphinx, context: object, lines: list[str]) -> None:  # noqa: ARG001
    """Show the columns of a command's help as code: as lines of text, which they are else, they are no columns."""
    text: list[str] = []
    for line in lines:
        shown = line.removeprefix("| ")
        is_of_column = shown != line and shown.startswith(" ")
        if is_of_column and not (text and text[-1].startswith("    ")):
            text += ["", "::", ""]
        text += [f"    {shown}"] if is_of_column else ["", shown, ""] if shown != line else [line]
    lines[:] = text


def set_defaults(app: Sphinx, context: object, lines: list[str]) -> None:  # noqa: ARG001
    """Show an option's default as it is typed, not as Python writes it."""
    lines[:] = [re.sub(r"``(?:PosixPath\()?'([^']*)'\)?``", r"``\1``", line) for line in lines]


_TOGETHER = re.compile(r"(?<=\d) (?=(?:%|(?:mm|cm|m|ms|us|s|kg|g|N|Nm|bar|rad|deg|Hz|px|MB)\b))| (?=·)|(?<=·) ")
"""Spaces between a number and its unit, and about the dot of `hosts.md`."""
_EXPONENT = re.compile(r"(?<=\de-)(?=\d)")
_OPTION = re.compile(r"((?<![\w-])--[a-z][a-z-]*)")


def keep_together(app: Sphinx, doctree: nodes.document, page: str) -> None:  # noqa: ARG001
    """Keep numbers on one line with their units, but in code, which readers copy; show options in help as code."""
    for text in list(doctree.findall(nodes.Text)):
        if isinstance(text.parent, nodes.literal | nodes.literal_block | nodes.raw | nodes.math | nodes.math_block):
            continue
        kept = _EXPONENT.sub("\N{WORD JOINER}", _TOGETHER.sub("\N{NO-BREAK SPACE}", text))
        if page == "reference/commands" and isinstance(text.parent, nodes.paragraph) and _OPTION.search(kept):
            parts = [nodes.literal("", p) if p.startswith("--") else nodes.Text(p) for p in _OPTION.split(kept) if p]
            text.parent.replace(text, parts)
        elif kept != text:
            text.parent.replace(text, nodes.Text(kept))


def put_progress_first(app: Sphinx, doctree: nodes.document, page: str) -> None:  # noqa: ARG001
    """Show what a cell's commands say while they run above what they print: MyST-NB drops their order."""
    for output in doctree.findall(lambda node: isinstance(node, nodes.container) and "cell_output" in node["classes"]):
        output[:] = sorted(output, key=lambda node: "stderr" not in node.get("classes", ()))


def make_cache(app: Sphinx) -> None:
    """Make the cache of executed tutorials, which two processes that read pages would make at once, and fail."""
    get_cache(app.config.nb_execution_cache_path).db  # noqa: B018


def mix_pages(app: Sphinx, env: object, pages: list[str]) -> None:  # noqa: ARG001
    """Put tutorials, of which some run for minutes, into different parts of the pages that are to be read."""
    parts = len(make_chunks(pages, app.parallel))  # into which Sphinx divides them for its processes
    first = sorted(pages, key=lambda page: not page.startswith("tutorials/"))
    pages[:] = [page for k in range(parts) for page in first[k::parts]]


def check_links(app: Sphinx, failure: Exception | None) -> None:
    """Look whether each file that a built page links, loads or shows is there: Sphinx asks this of Markdown's alone.

    Raises:
        ExtensionError: some are not; all are named.
    """
    folder = Path(app.outdir)
    pages = {page: page.read_text("utf-8") for page in folder.rglob("*.html")}
    linked = [(p, link) for p, html in pages.items() for link in re.findall(r'(?:href|src)="([^":#?]+)["#?]', html)]
    broken = [f"{p.relative_to(folder)}: {link}" for p, link in linked if not (p.parent / unquote(link)).exists()]
    if failure is None and broken:
        raise ExtensionError(f"files that are linked and are not there: {'; '.join(broken)}")


def check_sentences(app: Sphinx, failure: Exception | None) -> None:
    """Look for sentences of built pages that are too long.

    Raises:
        ExtensionError: there are some; all are named with their pages.
    """
    folder = Path(app.outdir)
    pages = {page.relative_to(folder): page.read_text("utf-8") for page in folder.rglob("*.html")}
    long = [f"{page}: {sentence}" for page, html in pages.items() for sentence in long_sentences(html)]
    if failure is None and long:
        raise ExtensionError(f"sentences of more than {MOST_WORDS} words:\n" + "\n".join(long))


def setup(app: Sphinx) -> None:
    """Show examples in docstrings as code, and equations without a script from the network."""
    app.add_html_math_renderer("mathml", (show_inline, None), (show_block, None))
    app.connect("build-finished", check_links)
    app.connect("build-finished", check_sentences)
    app.connect("builder-inited", make_cache)
    app.connect("env-before-read-docs", mix_pages)
    app.connect("doctree-resolved", keep_together)
    app.connect("doctree-resolved", put_progress_first)
    app.connect("sphinx-click-process-description", set_columns)
    app.connect("sphinx-click-process-options", set_defaults)
    app.connect("autodoc-process-docstring", set_code)
