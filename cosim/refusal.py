"""What a block does not take."""

from collections.abc import Sequence
from typing import ClassVar


class Refusal(ValueError):
    """Parameters of which a block cannot be made, or inputs that it cannot take; nothing has changed.

    An FMU's log tells a refusal in one line, with no traceback. Subclasses name their block.

    Attributes:
        faults: all that is wrong, each with what would be right.
    """

    block: str
    is_refusal: ClassVar[bool] = True

    def __init__(self, faults: Sequence[str]) -> None:
        super().__init__(f"{self.block}: " + "; ".join(faults))
        self.faults = list(faults)
