"""Figures drawn once and at a low resolution, instead of saved as PNG and SVG, and kept for what they show."""

from collections.abc import Sequence
from pathlib import Path

import pytest
from matplotlib.figure import Figure

from handover.scenarios.experiment import plotting


class Sketches(dict[str, Figure]):
    """Figures by their names."""

    def check(self, *names: str) -> None:
        """Assert that these figures were drawn, in this order, and that there is something in all of their axes."""
        assert list(self) == list(names)
        for name, drawn in self.items():
            assert all(axes.has_data() for axes in drawn.axes if axes.axison), name


@pytest.fixture
def sketches(monkeypatch: pytest.MonkeyPatch) -> Sketches:
    """Return the figures that the test draws."""
    kept = Sketches()

    def sketch(canvas: Figure, path: Path, _formats: Sequence[str]) -> None:
        canvas.savefig(path.with_suffix(".png"), dpi=30)
        kept[path.name] = canvas

    monkeypatch.setattr(plotting, "_save", sketch)
    return kept
