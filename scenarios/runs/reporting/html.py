"""HTML that pages are made of: Plotly figures, which the page's script draws in its colours and width, and tables."""

import base64
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, cast

import plotly.graph_objects as go
import plotly.io.json
from markupsafe import Markup, escape

packed_json = cast(Callable[[Any], str], plotly.io.json.to_json_plotly)
"""Returns content as JSON, whose arrays Plotly packs."""


def plot_html(figure: go.Figure, height: int = 320, label: str = "") -> Markup:
    """Return the HTML of a figure, which has neither colours of its own for text and grid nor a width.

    A colour may be one of the page's, such as "var(--bad)"; figures whose `layout.meta` is {"time": True} show the
    same range of their horizontal axis. No `scattergl`: it compiles code in the browser, which the page forbids.

    Args:
        figure: a Plotly figure.
        height: in pixels; the legend comes below.
        label: for screen readers.
    """
    content = cast(dict[str, Any], figure.to_dict())
    content["layout"].pop("template", None)  # has colours of its own, on white
    data = json_html(content)
    return Markup(f'<div class="plot" role="img" aria-label="{escape(label)}" style="height: {height}px">{data}</div>')


def picture_source(content: bytes, mime: str) -> str:
    """Return a picture as the address by which a page that opens offline shows it; `mime` is such as image/png."""
    return f"data:{mime};base64,{base64.b64encode(content).decode()}"


_ESCAPED_SLASH = re.compile(r"(\\\\)|\\u002f")
"""A backslash that is meant as one, or an escaped slash."""


def json_html(content: Any, name: str = "") -> Markup:
    """Return data for a page's scripts, escaped so as not to end the element; Plotly packs arrays.

    Plotly escapes the slashes of packed arrays, too, at six bytes each: without "<" none of them ends an element.

    `name` is the element's class, if it has one.
    """
    data = _ESCAPED_SLASH.sub(lambda found: found[1] or "/", packed_json(content)).replace("<", "\\u003c")
    of = f' class="{escape(name)}"' if name else ""
    return Markup(f'<script type="application/json"{of}>{data}</script>')


@dataclass(frozen=True)
class Cell:
    """A cell: its text, and the number that it is sorted by, if not by its text."""

    text: str | Markup
    key: float | None = None


def rows_table(
    header: Sequence[str],
    rows: Sequence[Sequence[str | Markup | Cell]],
    numbers: Sequence[int] = (),
    caption: str = "",
    sortable: bool = False,
    cards: bool = False,
) -> Markup:
    """Return a table as HTML: as wide as the page's text at most, and scrolls within itself where it needs more.

    Args:
        header: names of the columns.
        rows: as many cells each.
        numbers: columns of numbers, which are aligned right.
        caption: the title above the table.
        sortable: whether a click on a column's name sorts by it; the page then needs `campaign.js`.
        cards: whether each row is a block of lines on narrow screens, each cell with its column's name before it.
    """
    kind = Markup(' class="number"')
    kinds = [kind if k in numbers else Markup() for k in range(len(header))]
    name = Markup("<button type='button'>{}</button>") if sortable else Markup("{}")
    heads = Markup().join(
        Markup("<th{} scope='col'>{}</th>").format(c, name.format(h)) for c, h in zip(kinds, header, strict=True)
    )
    labels = [Markup(" data-label='{}'").format(h) if cards else Markup() for h in header]
    attributes = [kind + label for kind, label in zip(kinds, labels, strict=True)]
    body = Markup("\n").join(Markup("<tr>{}</tr>").format(_cells(row, attributes)) for row in rows)
    return Markup(
        "<div class='scroll'><table{}>{}<thead><tr>{}</tr></thead><tbody>\n{}\n</tbody></table></div>"
    ).format(
        Markup(" class='sortable'") if sortable else Markup(" class='cards'") if cards else Markup(),
        Markup("<caption>{}</caption>").format(caption) if caption else Markup(),
        heads,
        body,
    )


def _cells(row: Sequence[str | Markup | Cell], attributes: Sequence[Markup]) -> Markup:
    cells: list[Markup] = []
    for cell, attribute in zip(row, attributes, strict=True):
        text, key = (cell.text, cell.key) if isinstance(cell, Cell) else (cell, None)
        sort = Markup() if key is None else Markup(" data-key='{}'").format(f"{key:.9g}")
        cells.append(Markup("<td{}{}>{}</td>").format(attribute, sort, text))
    return Markup().join(cells)
