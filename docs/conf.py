"""The site, built by Sphinx: `make docs`. Pages of units, scenarios and commands are made from their declarations."""

import shutil
import sys
from functools import partialmethod
from importlib.metadata import version as version_of
from pathlib import Path

from nbclient import NotebookClient
from sphinx.application import Sphinx

DOCS = Path(__file__).parent
sys.path[:0] = [str(DOCS), str(DOCS.parent / "tests")]

import declared_pages  # noqa: E402
import tutorial_kernel  # noqa: E402

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

# Tutorials: executed in an empty folder each, again where the product has changed.
_TUTORIALS = DOCS / "build" / "tutorials"
nb_execution_mode = "cache"
nb_execution_cache_path = str(_TUTORIALS / tutorial_kernel.kernel(_TUTORIALS) / "outputs")
nb_kernel_rgx_aliases = {".*": "tutorial"}
nb_execution_in_temp = True
nb_execution_excludepatterns = [] if shutil.which("octave-cli") else ["tutorials/octave.md"]
nb_execution_raise_on_error = True
nb_execution_timeout = 600
nb_merge_streams = True
# IPython sends what a command prints in pieces of 100 characters; MyST-NB alone would make lines of them.
NotebookClient.__init__ = partialmethod(NotebookClient.__init__, coalesce_streams=True)

html_theme = "furo"
html_title = f"handover-cosim {release}"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_theme_options = {"sidebar_hide_name": False, "navigation_with_keys": True}
html_copy_source = False
html_extra_path = ["build/files"]
copybutton_exclude = ".linenos, .gp, .go"


def set_code(app: Sphinx, what: str, name: str, obj: object, options: object, lines: list[str]) -> None:  # noqa: ARG001
    """Show what is indented after a line that ends with a colon, as docstrings have their examples, as code."""
    for i, line in enumerate(lines[:-2]):
        if line.endswith(":") and not lines[i + 1] and lines[i + 2].startswith("    "):
            lines[i] = f"{line}:"


def setup(app: Sphinx) -> None:
    """Write what is made, before Sphinx looks for sources and files."""
    declared_pages.write(DOCS, DOCS / "build" / "files")
    app.connect("autodoc-process-docstring", set_code)
