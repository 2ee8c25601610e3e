"""What a unit's inputs are between communication points."""

import enum


class Extrapolation(enum.Enum):
    """What a unit's inputs are during its step.

    HOLD: what their sources gave last. LINEAR: on the line through what their sources gave at their last two
    communication points; see `LinearInputs`.
    """

    HOLD = "hold"
    LINEAR = "linear"
