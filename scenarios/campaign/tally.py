"""How far a campaign has come."""

from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tally:
    """Numbers of a campaign's runs.

    Attributes:
        total: all that are planned.
        kept: those that earlier calls have carried out.
        ended: those that have left a folder, with those kept.
        failed: those of `ended` in which a unit failed.
        lost: those that no worker came back with in this call.
    """

    total: int
    kept: int = 0
    ended: int = 0
    failed: int = 0
    lost: int = 0

    @property
    def left(self) -> int:
        """Runs that are yet to come in this call."""
        return self.total - self.ended - self.lost


OnTally = Callable[[Tally], None]
"""Told how far a campaign has come, at its start and after each run."""
