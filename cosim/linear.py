"""A linear change of a signal's value on its way from an output to an input."""

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Linear:
    """Value at the input = factor * value at the output + offset: two operations in double precision, each rounded."""

    factor: float = 1.0
    offset: float = 0.0

    @property
    def is_identity(self) -> bool:
        """Whether it changes nothing."""
        return self == Linear()

    @property
    def fault(self) -> str | None:
        """What is wrong with it, saying what would be right, or None."""
        if math.isfinite(self.factor) and math.isfinite(self.offset):
            return None
        return f"factor {self.factor!r} and offset {self.offset!r} must be finite numbers"

    def __str__(self) -> str:
        if self.factor == 1.0:
            return f"plus {self.offset:.6g}"
        return f"times {self.factor:.6g}" + (f", plus {self.offset:.6g}" if self.offset else "")
