"""Writes a page: one HTML file with scripts, style and data inside, that opens offline and asks for nothing."""

import base64
import functools
import hashlib
from collections.abc import Sequence
from dataclasses import replace
from importlib import resources
from pathlib import Path

import jinja2
from markupsafe import Markup
from plotly.offline import get_plotlyjs

from handover.scenarios.reporting.section import Section
from handover.scenarios.reporting.tied_text import tied
from handover.scenarios.run_folder import write_whole

_SCRIPT = "page.js"


def write_page(path: Path, title: str, lead: Markup, sections: Sequence[Section]) -> None:
    """Write a page, whole or not at all.

    A browser lets it run its own scripts, which it knows by their hashes, and lets nothing in it ask a network.

    Args:
        path: the HTML file.
        title: the heading.
        lead: what stands under the heading.
        sections: what stands below, in this order; those with plots or scripts bring Plotly with them.

    Raises:
        RecordNotWritten: it cannot be written.
    """
    names = [_SCRIPT, *dict.fromkeys(name for s in sections for name in s.scripts)]
    drawn = any(s.scripts or 'class="plot"' in s.html for s in sections)
    scripts = [*([_plotly()] if drawn else []), *map(asset, names)]
    write_whole(
        path,
        template("page.html").render(
            title=title,
            lead=Markup(tied(lead)),
            sections=[replace(s, html=Markup(tied(s.html))) for s in sections],
            style=Markup(asset("page.css")),
            scripts=[Markup(s) for s in scripts],
            policy=_policy(scripts),
        ),
    )


def template(name: str) -> jinja2.Template:
    """Return a template of `scenarios/reporting/page/`; what it is given is escaped unless it is Markup."""
    environment = jinja2.Environment(
        autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    return environment.from_string(asset(name))


def asset(name: str) -> str:
    """Return the text of a file of `scenarios/reporting/page/`."""
    return resources.files("handover.scenarios.reporting").joinpath("page").joinpath(name).read_text(encoding="utf-8")


@functools.lru_cache
def _plotly() -> str:
    return get_plotlyjs()


def _policy(scripts: Sequence[str]) -> str:
    """Return the page's Content-Security-Policy: its scripts by their hashes, styles, pictures that it holds itself.

    Plotly sets styles of its elements, and passes pictures that are saved on as data and blobs.
    """
    hashes = " ".join(f"'sha256-{base64.b64encode(hashlib.sha256(s.encode()).digest()).decode()}'" for s in scripts)
    return f"default-src 'none'; script-src {hashes}; style-src 'unsafe-inline'; img-src data: blob:"
