"""What has to be done at the end of a run: units terminated, then freed, then their files removed."""

import collections
from collections.abc import Callable


class Endings:
    """Things to do at the end, the last one first, each once, whatever becomes of the others."""

    def __init__(self) -> None:
        self._left: collections.deque[Callable[[], object]] = collections.deque()
        self._first: Exception | None = None

    def add(self, ending: Callable[[], object]) -> None:
        """Have something done before all that was added until now."""
        self._left.append(ending)

    def carry_out(self) -> None:
        """Do what is left. Where one thing did not return, another thread may call this again and goes on after it.

        Raises:
            Exception: the first that any of it raised, after all was done.
        """
        while self._left:
            try:
                self._left.pop()()
            except Exception as e:
                self._first = self._first or e
        first, self._first = self._first, None
        if first is not None:
            raise first
