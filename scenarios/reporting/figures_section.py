"""Figures of a folder within a page."""

import base64
from collections.abc import Sequence
from pathlib import Path

from markupsafe import Markup

from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.reporting.section import Section


def figures_section(figures: Sequence[Figure], folder: Path) -> Section | None:
    """Return figures with their captions, None if there are none; `folder` has them as PNG."""
    if not figures:
        return None
    html = Markup("\n").join(_html(f, folder / f"{f.name}.png") for f in figures)
    return Section(anchor="figures", title="Figures", html=html)


def _html(figure: Figure, file: Path) -> Markup:
    data = base64.b64encode(file.read_bytes()).decode()
    return Markup(
        "<figure><img class='paper' alt='{}' src='data:image/png;base64,{}'><figcaption>{}</figcaption></figure>"
    ).format(figure.name.replace("_", " "), data, figure.caption)
