"""Puts a Plotly figure into a page: the page's script draws it in the page's colours and width."""

from collections.abc import Callable
from typing import Any, cast

import plotly.graph_objects as go
import plotly.io.json
from markupsafe import Markup, escape

COLOURS = 9
"""Colours of curves in page.css, `var(--c0)` and on."""

_packed = cast(Callable[[Any], str], plotly.io.json.to_json_plotly)


def plot_html(figure: go.Figure, height: int = 320, label: str = "") -> Markup:
    """Return the HTML of a figure, which has neither colours of its own for text and grid nor a width.

    A colour may be one of the page's, such as "var(--bad)"; figures whose `layout.meta` is {"time": True} show the
    same range of their horizontal axis. No `scattergl`: it compiles code in the browser, which the page forbids.

    Args:
        figure: a Plotly figure.
        height: in pixels; the legend comes below.
        label: what one hears who cannot see it.
    """
    told = cast(dict[str, Any], figure.to_dict())
    told["layout"].pop("template", None)  # of paper-white figures
    return Markup(
        f'<div class="plot" role="img" aria-label="{escape(label)}" style="height: {height}px">{json_html(told)}</div>'
    )


def json_html(content: Any, name: str = "") -> Markup:
    """Return data for a page's scripts: nothing in it ends the element. Arrays are packed as Plotly does.

    `name` is the element's class, if it has one.
    """
    data = _packed(content).replace("<", "\\u003c")
    of = f' class="{escape(name)}"' if name else ""
    return Markup(f'<script type="application/json"{of}>{data}</script>')
