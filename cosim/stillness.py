"""For how long the same call has been under way."""

import time
from collections.abc import Callable

from handover.cosim.heartbeat import Heartbeat


class Stillness:
    """Looks at a heartbeat now and then, and adds up the time in which one call did not return.

    Of the time between two looks at most `most` seconds count: if more has passed, it was the whole process, or the
    machine, that stood still.
    """

    def __init__(self, heartbeat: Heartbeat, most: float, clock: Callable[[], float] = time.monotonic) -> None:
        self._heartbeat, self._most, self._clock = heartbeat, most, clock
        self.beat: tuple[int, int] | None = None
        """The call that was under way at the last look."""
        self._seconds, self._looked = 0.0, clock()

    def look(self) -> float:
        """Return the seconds for which the call that is under way has been seen; 0 where there is none."""
        now, beat = self._clock(), self._heartbeat.beat
        passed, self._looked = now - self._looked, now
        if beat is None or beat != self.beat:
            self.beat, self._seconds = beat, 0.0
        else:
            self._seconds += min(passed, self._most)
        return self._seconds
