"""Fig. 5 of [Gandarias2020] in numbers, cell by cell: the paper prints none, so ours stand alone."""

import numpy as np

from handover.controllers.vsl.paths import Path as TipPath
from handover.cosim.blocks.ports import Floats
from handover.scenarios.published.published_experiment import ComparisonTable
from handover.scenarios.published.vsl.vsl_1.runs import PATHS, Cell, Vsl1Runs, format_load

PANELS = {TipPath.LINEAR: "5(a), linear", TipPath.CURVE: "5(b), curve", TipPath.SQUARE: "5(c), square"}
"""Rows of fig. 5."""

_SPACE = "\u00a0"
"""At which no line of a table is broken."""
_NOT_PRINTED = "The paper draws these as paths and prints no numbers."


def tables_of(runs: Vsl1Runs) -> list[ComparisonTable]:
    """Return mean errors by path, and how they differ near the base and far from it."""
    return [*(_errors(runs, path) for path in PATHS), _reach(runs)]


def _errors(runs: Vsl1Runs, path: TipPath) -> ComparisonTable:
    rows: list[list[str]] = []
    for load in runs.loads:
        servo = np.concatenate([runs.metric("servo_error", Cell(path, load, links)) for links in runs.links])
        cells = [format_spread(runs.metric("mean_error", Cell(path, load, links))) for links in runs.links]
        rows.append([format_load(load), format_spread(servo), *cells])
    note = (
        "Mean distance of the tip from the desired points along the path, by the tracker, and of the place where "
        "encoders and rigid links put it (servos: over the runs of all links together); ± the standard deviation "
        f"between runs, of the servos also from links to links. {_NOT_PRINTED}"
    )
    if runs.not_done:
        note += f" {runs.not_done} runs did not complete the path and do not count."
    return ComparisonTable(
        title=f"Fig. {PANELS[path]}: mean error (mm)",
        header=["load", "servos", *(links.label for links in runs.links)],
        rows=rows,
        note=note,
    )


def _reach(runs: Vsl1Runs) -> ComparisonTable:
    rows: list[list[str]] = []
    for path in (TipPath.SQUARE, TipPath.CURVE):
        for load in runs.loads:
            cells = [Cell(path, load, links) for links in runs.links]
            both = [[runs.metric(f"error_{where}", cell) for where in ("near", "far")] for cell in cells]
            texts = [" to ".join(f"{1000 * v.mean():.1f}" for v in pair) if pair[0].size else "" for pair in both]
            rows.append([f"{path.name.lower()}, {format_load(load)}", *texts])
    return ComparisonTable(
        title="Near the base and far from it: mean error (mm)",
        header=["path, load", *(links.label for links in runs.links)],
        rows=rows,
        note="Of the third of the points that are nearest to the base, and of the third that are farthest from it. The "
        f"line stays at one distance. {_NOT_PRINTED}",
    )


def format_mean(errors: Floats) -> str:
    """Return the mean of errors, m, in mm; "" of none."""
    return f"{1000 * errors.mean():.1f}" if len(errors) else ""


def format_spread(errors: Floats) -> str:
    """Return mean and standard deviation of errors, m, in mm, such as `1.5 ± 0.03`; of one value the value alone."""
    mean = format_mean(errors)
    return mean if len(errors) < 2 else f"{mean}{_SPACE}±{_SPACE}{1000 * errors.std(ddof=1):.2f}"
