"""What sample blocks without a state share."""

from collections.abc import Mapping
from fractions import Fraction
from typing import Any, ClassVar


class Memoryless:
    """Its outputs are those of a step of no length."""

    feedthrough: ClassVar[Mapping[str, tuple[str, ...]]] = {}
    period: ClassVar[Fraction | None] = None

    def __init__(self, params: Any) -> None:
        self.params = params

    def outputs(self, t: float, u: Any) -> Any:
        return self.step(t, 0.0, u)

    def step(self, t: float, dt: float, u: Any) -> Any:
        raise NotImplementedError

    def get_state(self) -> bytes:
        return b""

    def set_state(self, state: bytes) -> None:
        pass
