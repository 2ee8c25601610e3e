"""Observers of a run that goes on from where another process left it."""

from collections.abc import Callable
from dataclasses import dataclass

from handover.cosim.signals import Signals


@dataclass(frozen=True)
class FromThenOn:
    """An observer of a run that goes on from t_0 seconds: `observe` saw that point before, and sees what follows."""

    t_0: float
    observe: Callable[[float, Signals], None]

    def __call__(self, t: float, signals: Signals) -> None:
        """Let `observe` look, unless it has seen this point."""
        if t > self.t_0:
            self.observe(t, signals)
