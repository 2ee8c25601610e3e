"""What became of the steps of a run."""

from dataclasses import dataclass


@dataclass(kw_only=True)
class StepStatistics:
    """Counts of steps, and the range of those that were accepted, in seconds."""

    accepted: int = 0
    rejected: int = 0
    shortest: float = 0.0
    longest: float = 0.0

    def accept(self, step: float) -> None:
        """Count a step that was accepted."""
        self.shortest = step if self.accepted == 0 else min(self.shortest, step)
        self.longest = max(self.longest, step)
        self.accepted += 1
