"""What somebody outside a simulation may do in a scenario while it goes on: lead a hand."""

from collections.abc import Mapping
from dataclasses import dataclass

_SIZES = {"p_WH_track": 3, "q_WH_track": 4, "finger_track": 14, "closed_track": 1}


@dataclass(frozen=True)
class LedHand:
    """A hand that inputs from outside lead.

    Attributes:
        unit: whose inputs they are: `p_WH_track`, `q_WH_track`, `finger_track`, `closed_track`, `age`.
        p_WH_0: where it rests, in W, m.
        reach: how far from there it may be wanted, m.
    """

    unit: str
    p_WH_0: tuple[float, float, float]
    reach: float

    @property
    def inputs(self) -> Mapping[str, int]:
        """The inputs that a sample of a hand sets, as `unit.input`, and how many entries each has."""
        return {f"{self.unit}.{name}": size for name, size in _SIZES.items()}

    @property
    def age(self) -> str:
        """The input that tells how old the sample is."""
        return f"{self.unit}.age"
