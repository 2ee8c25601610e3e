"""Errors of the VSL arm's learned kinematics by the number of points that they were learned from."""

import os
import tempfile
from collections.abc import Generator, Sequence
from dataclasses import dataclass
from pathlib import Path

from handover.scenarios.robots.vsl.residuals import Errors
from handover.scenarios.robots.vsl.training import Progress, VslTraining
from handover.scenarios.robots.vsl.training_data import Measured

SIZES = (250, 500, 1000, 2000, 4000, 8000, 17568)
"""Numbers of points; the last is that of [Gandarias2020] sec. IV-A."""


@dataclass(frozen=True)
class CurvePoint:
    """Errors of a model of so many points, on test points that all models of a curve share."""

    points: int
    errors: Errors


def learning_curve(
    training: VslTraining, measured: Measured, progress: Progress, sizes: Sequence[int] = SIZES
) -> list[CurvePoint]:
    """Return the errors of models of some of the measured points, drawn at random, and last of all of them.

    Args:
        training: what is learned.
        measured: all points.
        progress: called with models and their number, and of a published network as `VslTraining.learn` does.
        sizes: how many points; those that there are not are left out.

    Raises:
        NoPyTorch: as `VslTraining.learn`.
    """
    n = len(measured.points)
    points: list[CurvePoint] = []
    taken = [*(size for size in sizes if size < n), n]
    for k, size in enumerate(taken):
        points.append(CurvePoint(size, training.learn(measured, progress, size / n)[1]))
        progress(k + 1, len(taken))
    return points


def curve_table(points: Sequence[CurvePoint]) -> Generator[str, None, None]:
    """Return the lines of a table of mean test errors, mm."""
    yield f"{'points':>8}{'forward, mm':>14}{'inverse, mm':>14}"
    for p in points:
        yield f"{p.points:8}{p.errors.forward_hybrid * 1000:14.2f}{p.errors.inverse_hybrid * 1000:14.2f}"


def draw_curve(points: Sequence[CurvePoint], path: Path) -> None:
    """Draw the errors over the number of points into a PNG file, and an SVG file beside it, each whole or not at all.

    Raises:
        OSError: they cannot be written.
    """
    with tempfile.TemporaryDirectory(dir=path.absolute().parent, prefix=f".{path.stem[:200]}-") as folder:
        _draw(points, Path(folder) / "curve")
        for suffix in (".svg", ".png"):
            os.replace(Path(folder) / f"curve{suffix}", path.with_name(path.stem + suffix))


def _draw(points: Sequence[CurvePoint], path: Path) -> None:
    from handover.scenarios.experiment.plotting import figure, legend_below  # matplotlib is slow to import

    with figure(path, 1, size=(6.0, 3.6)) as [axes]:
        sizes = [p.points for p in points]
        for label, name in (("forward, eq. (10)", "forward_hybrid"), ("inverse, eq. (11)", "inverse_hybrid")):
            axes.plot(sizes, [getattr(p.errors, name) * 1000 for p in points], marker="o", ms=4, lw=1.4, label=label)
        axes.set_xscale("log")
        axes.set_xticks(sizes, [str(size) for size in sizes])
        axes.minorticks_off()
        axes.set_ylim(bottom=0.0)
        axes.set(xlabel="points measured, of which 70 % to train on", ylabel="mean error of the test points (mm)")
        legend_below(axes)
