"""Connections whose input has fewer bits than the output that feeds it."""

from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

from handover.cosim.blocks.ports import Width
from handover.cosim.blocks.variable import Kind
from handover.cosim.exceptions import UnitFailure
from handover.cosim.fmu.description import FmuPort


@dataclass(frozen=True)
class Narrowing:
    """An integer output that feeds a narrower input: copied, a number that does not fit would lose its upper bits.

    Attributes:
        source: the output, `unit.port`.
        unit, port: the input.
        values: the output's values, as they are.
    """

    source: str
    unit: str
    port: str
    width: Width
    values: NDArray[Any]

    def check(self, t: float) -> None:
        """Let only numbers through that fit.

        Raises:
            UnitFailure: one does not.
        """
        for number in self.values.tolist():
            if not self.width.holds(number):
                fault = f"{self.source} is {number}, which does not fit {self.width.told}"
                raise UnitFailure(self.unit, f"setting {self.port}", t, "Error", (fault,))


def narrows(output: FmuPort, target: FmuPort) -> bool:
    """Tell whether an integer output has numbers that the input which it feeds cannot take."""
    a, b = output.width, target.width
    return (
        output.kind is Kind.INTEGER
        and a is not None
        and b is not None
        and not (b.holds(a.lowest) and b.holds(a.highest))
    )
