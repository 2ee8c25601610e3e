"""Puts a Plotly figure into a page: the page's script draws it in the page's colours and width."""

from typing import Any

import plotly.graph_objects as go
from markupsafe import Markup, escape


def plot_html(figure: Any, height: int = 320, label: str = "") -> Markup:
    """Return the HTML of a figure, which has neither colours of its own for text and grid nor a width.

    Args:
        figure: a Plotly figure.
        height: in pixels.
        label: what one hears who cannot see it.
    """
    assert isinstance(figure, go.Figure)
    data = str(figure.to_json()).replace("</", "<\\/")
    return Markup(
        f'<div class="plot" role="img" aria-label="{escape(label)}" style="height: {height}px">'
        f'<script type="application/json">{data}</script></div>'
    )
