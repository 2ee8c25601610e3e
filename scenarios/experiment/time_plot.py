"""Declares time plots: curves with a unit, levels, phases. Pages draw them by Plotly, papers' figures by matplotlib."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Literal

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.cosim.record.reader import Record
from handover.cosim.system.graph import COLOURS
from handover.scenarios.experiment.returned_types import Checked, Expected, is_number, is_series, sequence_of

_MARGIN = 0.06
"""Margin between what is drawn and the end of an axis, as a share of the axis."""

Stroke = Literal["solid", "dashed", "dotted"]


SERIES = Expected(
    "an array of numbers of shape (rows,), one a row of the record",
    'record["arm.p_WG"][:, 0]',
    lambda values: is_series(values, (None,)),
)


@dataclass(frozen=True, kw_only=True)
class Curve(Checked):
    """Values over the record's time, shape (rows,); NaN where there is nothing to be drawn.

    Attributes:
        label: what the legend says.
        values: in the plot's unit.
        held: whether each value holds until the next (a command, a sampled measurement), else they are joined by lines.
        stroke: dashed for a curve that may coincide with one below it; dotted, which is thinner, for references.
        group: curves of one group have one colour; by default each has its own.
    """

    label: str
    values: Floats
    held: bool = False
    stroke: Stroke = "solid"
    group: str = ""

    expected = {"values": SERIES}


@dataclass(frozen=True, kw_only=True)
class Level(Checked):
    """A horizontal line, such as a threshold."""

    label: str
    value: float


@dataclass(frozen=True, kw_only=True)
class Phase(Checked):
    """A span of time, s, and the name over it, "" for none."""

    begin: float
    end: float
    name: str


_CURVES = sequence_of(Curve, '[Curve(label="x", values=record["arm.p_WG"][:, 0])]')
_LEVELS = sequence_of(Level, '[Level(label="threshold", value=0.005)]')
_LIMITS = Expected(
    "a lower and an upper limit, each a number or None",
    "(0.0, None)",
    lambda v: isinstance(v, Sequence) and len(v) == 2 and all(x is None or is_number(x) for x in v),
)
_PHASES = sequence_of(Phase, 'phases_of(record, "servo.phase")')


@dataclass(frozen=True, kw_only=True)
class TimePlot(Checked):
    """Curves over time that share an axis.

    Attributes:
        title: in a few words.
        quantity: what the vertical axis shows, such as "distance".
        unit: the unit of its values as one reads it, such as "mm"; "" for pure numbers.
        curves, levels: what is drawn; later curves lie over earlier ones.
        phases: every second of them is shaded.
        logarithmic: whether the vertical axis is.
        limits: of the vertical axis unless it is logarithmic; None: chosen by what is drawn.
        palette: groups that get the first colours, drawn here or not, so that plots agree on a group's colour.
    """

    title: str
    quantity: str
    unit: str
    curves: Sequence[Curve]
    levels: Sequence[Level] = ()
    phases: Sequence[Phase] = ()
    logarithmic: bool = False
    limits: tuple[float | None, float | None] = (None, None)
    palette: Sequence[str] = ()

    expected = {"curves": _CURVES, "levels": _LEVELS, "phases": _PHASES, "limits": _LIMITS}

    @property
    def axis_label(self) -> str:
        """The quantity with its unit."""
        return f"{self.quantity} ({self.unit})" if self.unit else self.quantity

    @property
    def colours(self) -> tuple[int, ...]:
        """Indices of the curves' colours in `COLOURS`."""
        groups = list(dict.fromkeys([*self.palette, *(c.group or c.label for c in self.curves)]))
        return tuple(groups.index(c.group or c.label) % len(COLOURS) for c in self.curves)

    @property
    def level_labels(self) -> tuple[str, ...]:
        """The levels' labels in the legend, each with its value."""
        return tuple(f"{level.label}: {level.value:.4g}{self.unit_after_value}" for level in self.levels)

    @property
    def unit_after_value(self) -> str:
        """The unit as it follows a value, with the space between them if it has one."""
        return self.unit if self.unit in ("", "°") else f" {self.unit}"

    @property
    def shown_range(self) -> tuple[float, float] | None:
        """The limits, None if neither is given; where one is given, the other lies a margin beyond what is drawn."""
        drawn = np.concatenate([*(c.values for c in self.curves), [level.value for level in self.levels]])
        drawn = drawn[np.isfinite(drawn)]
        if self.limits == (None, None) or not drawn.size:
            return None
        low, high = (
            float(extreme) if limit is None else limit
            for limit, extreme in zip(self.limits, (drawn.min(), drawn.max()), strict=True)
        )
        margin = _MARGIN * (high - low)
        return (low - margin if self.limits[0] is None else low, high + margin if self.limits[1] is None else high)

    @property
    def has_legend(self) -> bool:
        """Whether a legend says more than the axis does."""
        return len(self.curves) + len(self.levels) > 1 or any(c.label != self.quantity for c in self.curves)


_FILE_NAME = Expected(
    "the name of a file without its folder and suffix",
    '"distance"',
    lambda name: isinstance(name, str) and re.fullmatch(r"[^/\\\0]+", name) is not None and name not in (".", ".."),
)
_PLOTS = sequence_of(TimePlot, '[TimePlot(title="Distance", quantity="distance", unit="mm", curves=[Curve(...)])]')


@dataclass(frozen=True, kw_only=True)
class TimeFigure(Checked):
    """Plots that a figure for papers draws below each other, sharing time.

    Attributes:
        name: of its file within the figures folder, without suffix.
        caption: what it shows, in a sentence or two.
        plots: from top to bottom, column by column.
    """

    name: str
    caption: str
    plots: Sequence[TimePlot]
    columns: int = 1

    expected = {"name": _FILE_NAME, "plots": _PLOTS}


def phases_of(record: Record, signal: str, names: Mapping[int, str] | None = None) -> tuple[Phase, ...]:
    """Return the spans of time in which a signal kept its value, named; adjacent spans of one name are one phase.

    `names` are by the signal's value, by default the items of its enumeration. A signal of which nothing is known (NaN)
    has no phases.

    Raises:
        KeyError: no such signal was recorded.
    """
    values, time = record[signal], record.time
    if not np.isfinite(values).any():
        return ()
    if names is None:
        names = {value: name.replace("_", " ").lower() for value, name in record.items(signal).items()}
    changes = np.flatnonzero(np.diff(values)) + 1
    phases: list[Phase] = []
    for first, last in pairwise([0, *changes.tolist(), len(time) - 1]):
        name = names.get(int(values[first]), str(values[first]))
        phase = Phase(begin=float(time[first]), end=float(time[last]), name=name)
        if phases and phases[-1].name == phase.name:
            phases[-1] = replace(phases[-1], end=phase.end)
        else:
            phases.append(phase)
    return tuple(phases)
