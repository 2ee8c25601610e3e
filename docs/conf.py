"""The site, built by Sphinx: `make docs`. Pages of units, scenarios and commands are made from their declarations."""

import sys
from importlib.metadata import version as version_of
from pathlib import Path

from sphinx.application import Sphinx

DOCS = Path(__file__).parent
sys.path[:0] = [str(DOCS), str(DOCS.parent / "tests")]

import declared_pages  # noqa: E402

project = "handover-cosim"
author = "The handover-cosim authors"
copyright = "the handover-cosim authors, MIT licence"  # noqa: A001
version = release = version_of("handover-cosim")

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx_click", "sphinx_copybutton"]
myst_enable_extensions = ["colon_fence", "dollarmath"]
myst_heading_anchors = 3
source_suffix = {".md": "markdown"}
exclude_patterns = ["c_host", "build", "templates", "python.ipynb"]
suppress_warnings = ["misc.highlighting_failure"]

autodoc_typehints = "description"
autodoc_member_order = "bysource"
add_module_names = False
default_role = "literal"
smartquotes = False

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
