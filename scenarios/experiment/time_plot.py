"""What is to be drawn over time: curves with a unit, levels, and the phases behind them."""

from collections.abc import Sequence
from dataclasses import dataclass

from handover.cosim.blocks.ports import Floats


@dataclass(frozen=True, kw_only=True)
class Curve:
    """Values over the record's time, shape (rows,); NaN where there is nothing to be drawn.

    Attributes:
        label: what the legend says.
        values: in the plot's unit.
        held: whether a value holds until the next one (a command, a sampled measurement), else they are joined.
        faint: whether it is drawn thin and dotted, as ground truth beside what a controller sees.
        group: curves of one group have one colour; by default each has its own.
    """

    label: str
    values: Floats
    held: bool = False
    faint: bool = False
    group: str = ""


@dataclass(frozen=True, kw_only=True)
class Level:
    """A horizontal line, such as a threshold."""

    label: str
    value: float


@dataclass(frozen=True, kw_only=True)
class TimePlot:
    """Curves over time that share an axis.

    Attributes:
        title: in a few words.
        quantity: what the vertical axis shows, such as "distance".
        unit: the unit of its values as one reads it, such as "mm"; "" for pure numbers.
        curves, levels: what is drawn.
        phases: an enumeration's signal whose values are named over the plot, such as "servo.phase"; "" for none.
        logarithmic: whether the vertical axis is.
    """

    title: str
    quantity: str
    unit: str
    curves: Sequence[Curve]
    levels: Sequence[Level] = ()
    phases: str = ""
    logarithmic: bool = False
