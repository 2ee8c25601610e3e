"""How much work iterating was."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass


@dataclass
class IterationCount:
    """Counts of a run so far, at its start not included.

    Attributes:
        steps: steps that were iterated; units that act on each other in a circle make one together.
        iterations: how often all units of a circle stepped to see whether they agree.
        rollbacks: how often they went back to the beginning of a step, for that or to see what acts on what.
        most: the most iterations of a step.
    """

    steps: int = 0
    iterations: int = 0
    rollbacks: int = 0
    most: int = 0

    def add(self, iterations: int, rollbacks: int) -> None:
        """Count a step."""
        self.steps += 1
        self.iterations += iterations
        self.rollbacks += rollbacks
        self.most = max(self.most, iterations)

    def get_state(self) -> dict[str, int]:
        """Return the counts, for `set_state`."""
        return asdict(self)

    def set_state(self, state: Mapping[str, int]) -> None:
        """Go back to counts that `get_state` gave."""
        for name, count in state.items():
            setattr(self, name, count)

    def __str__(self) -> str:
        if not self.steps:
            return "no step was iterated"
        mean = self.iterations / self.steps
        return (
            f"{self.steps} steps were iterated: {mean:.3g} iterations a step, {self.most} at most, "
            f"{self.rollbacks} rollbacks"
        )
