"""Writes a page of sections: one HTML file with scripts, style and data inside, which opens offline.

Its Content-Security-Policy lets it run its own scripts only and forbids network requests. In its text, line breaks do
not separate numbers from their units, and what stands between backticks is code (`typeset`).
"""

import base64
import functools
import hashlib
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from importlib import resources
from pathlib import Path

import jinja2
from markupsafe import Markup
from plotly.offline import get_plotlyjs

from handover.scenarios.runs.results.run_folder import make_folder_of, write_whole


@dataclass(frozen=True, kw_only=True)
class Section:
    """A part of a page under a heading.

    Attributes:
        anchor: its name in links, such as "replay".
        title: the heading.
        html: the content.
        scripts: files in `scenarios/runs/reporting/page/` that it needs, without `page.js`, which is always there.
    """

    anchor: str
    title: str
    html: Markup
    scripts: tuple[str, ...] = ()


_PARTS = re.compile(r"(<(script|style|pre|code)\b.*?</\2>|<[^>]+>)", re.DOTALL)
_CODE = re.compile(r"`([^`\n]+)`")
_UNIT = re.compile(r"(?<=\d) (?=(?:%|°|[kmµ]?m|[mµ]?s|m?N|k?g|m?rad|h|A|bar|k?Pa|[MG]B|N·m|N m|m/s|rad/s)(?![\w/]))")
_RANGE = re.compile(r"(?<=\d) to (?=-?\d)")
_EQUAL = re.compile(r"\b(\w) ([=<]) (?=-?\d)")
_SPACE = "\u00a0"


def typeset(html: str) -> str:
    """Return HTML in whose text no line breaks within "5 mm", "3 to 5 %" and "p = 0.03", and `this` is code.

    Scripts, and what is code already, stay as they are.
    """
    parts = _PARTS.split(html)  # texts, then elements or tags with the elements' names
    parts[::3] = [_CODE.sub(r"<code>\1</code>", _non_breaking(text)) for text in parts[::3]]
    del parts[2::3]
    return "".join(parts)


def _non_breaking(text: str) -> str:
    text = _RANGE.sub(f"{_SPACE}to{_SPACE}", _UNIT.sub(_SPACE, text))
    return _EQUAL.sub(rf"\1{_SPACE}\2{_SPACE}", text)


_SCRIPT = "page.js"


def write_page(path: Path, title: str, header: Markup, sections: Sequence[Section]) -> None:
    """Write a page, whole or not at all; a folder that is not there is made.

    The browser runs the page's own scripts only, known by their hashes, and lets nothing in it use the network.

    Args:
        path: the HTML file.
        title: the heading.
        header: what stands under the heading.
        sections: see `page_html`.

    Raises:
        RecordNotWritten: it cannot be written.
    """
    make_folder_of(path)
    write_whole(path, page_html(title, header, sections))


def page_html(
    title: str, header: Markup, sections: Sequence[Section], *, connects: bool = False, works: bool = False
) -> str:
    """Return a page.

    Args:
        title: the heading.
        header: what stands under the heading.
        sections: in order of appearance; Plotly is included if one of them has plots or scripts.
        connects: whether its scripts may connect to where the page comes from.
        works: whether its scripts may begin threads (workers) of scripts from there.
    """
    names = [_SCRIPT, *dict.fromkeys(name for s in sections for name in s.scripts)]
    has_plots = any(s.scripts or 'class="plot"' in s.html for s in sections)
    scripts = [*([_plotly()] if has_plots else []), *map(asset, names)]
    return template("page.html").render(
        title=title,
        header=Markup(typeset(header)),
        sections=[replace(s, html=Markup(typeset(s.html))) for s in sections],
        style=Markup(asset("page.css")),
        scripts=[Markup(s) for s in scripts],
        policy=_policy(scripts, connects=connects, works=works),
    )


def plain_page_html(
    title: str, html: str, styles: Sequence[str], scripts: Sequence[str], *, works: bool = False
) -> str:
    """Return a page without headings and sections that connects to where it comes from, see `page_html`.

    Args:
        title: of the browser's window.
        html: the body.
        styles: style sheets.
        scripts: names of files in `scenarios/runs/reporting/page/`, in the order in which they run.
        works: whether its scripts may begin threads (workers) of scripts from there.
    """
    texts = [asset(name) for name in scripts]
    return template("plain_page.html").render(
        title=title,
        html=Markup(html),
        styles=[Markup(s) for s in styles],
        scripts=[Markup(s) for s in texts],
        policy=_policy(texts, connects=True, works=works),
    )


def template(name: str) -> jinja2.Template:
    """Return a template of `scenarios/runs/reporting/page/`; values are escaped unless they are Markup."""
    environment = jinja2.Environment(
        autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    return environment.from_string(asset(name))


def asset(name: str) -> str:
    """Return the text of a file of `scenarios/runs/reporting/page/`."""
    return resources.files("handover.scenarios.runs.reporting").joinpath("page", name).read_text(encoding="utf-8")


@functools.lru_cache
def _plotly() -> str:
    return get_plotlyjs()


def _policy(scripts: Sequence[str], *, connects: bool, works: bool = False) -> str:
    """Return the page's Content-Security-Policy: its scripts by their hashes, inline styles, embedded pictures.

    Plotly sets inline styles, and hands over pictures to be saved as data and blobs.
    """
    hashes = " ".join(f"'sha256-{base64.b64encode(hashlib.sha256(s.encode()).digest()).decode()}'" for s in scripts)
    own = "; connect-src 'self'" * connects + "; worker-src 'self'" * works
    return f"default-src 'none'; script-src {hashes}; style-src 'unsafe-inline'; img-src data: blob:{own}"
