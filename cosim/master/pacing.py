"""Keeps a run in step with the wall clock, and counts where it could not."""

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from typing import Any

_SLICE = 0.1  # s, how often a wait checks whether the run is to end


@dataclass(frozen=True)
class PaceReport:
    """How well a run kept pace with the wall clock.

    Attributes:
        pace: simulated seconds per second of wall time.
        deadlines: communication points that had to wait for the clock.
        missed: those that were reached too late.
        largest_lateness: seconds of wall time by which the worst of them was late; 0 where none was.
        latest_at: simulated time of that deadline in seconds; None where none was late.
        reached: simulated seconds per second of wall time until the last deadline; None before the first.
        changed: whether the pace was changed on the way. Then `pace` is the last one, and all but `first` count from
            the last change, or from a pause after it.
        first: simulated seconds per second of wall time before the first change; None for as fast as it goes, as may
            be `pace`. It says nothing where nothing was changed.
    """

    pace: float | None
    deadlines: int
    missed: int
    largest_lateness: float
    latest_at: float | None
    reached: float | None = None
    changed: bool = False
    first: float | None = None

    @property
    def share(self) -> float:
        """Part of the deadlines that was missed."""
        return self.missed / self.deadlines if self.deadlines else 0.0

    def as_data(self) -> dict[str, Any]:
        """Return the report as JSON can hold it."""
        data = {**asdict(self), "share": self.share}
        return data if self.changed else {k: v for k, v in data.items() if k not in ("changed", "first")}

    def __str__(self) -> str:
        if not self.missed:
            return f"none of {self.deadlines}"
        late = self.largest_lateness
        lateness = f"{late * 1000:.3g} ms" if late < 0.1 else f"{late:.2f} s"
        share = f"{self.missed} of {self.deadlines} ({self.share:.1%})"
        at = "" if self.latest_at is None else f", at t = {self.latest_at:.6g} s"
        return f"{share}, at most {lateness} late{at}"


class Pacer:
    """Lets simulated time t pass at w(t) = w_0 + (t - t_0) / pace of the wall clock, where the run is quick enough.

    Deadlines are counted from the run's start, so a late one does not shift the others, and lateness does not add up.

    Args:
        pace: simulated seconds per second of wall time.
        clock: returns the wall time in seconds.
        sleep: waits for so many seconds.
    """

    def __init__(
        self, pace: float, clock: Callable[[], float] = time.monotonic, sleep: Callable[[float], None] = time.sleep
    ) -> None:
        self._pace, self._clock, self._sleep = pace, clock, sleep
        self._t_0, self._w_0 = 0.0, 0.0
        self._report = PaceReport(pace, 0, 0, 0.0, None)

    @property
    def report(self) -> PaceReport:
        """The report until now."""
        return self._report

    def start(self, t: float) -> None:
        """Count the wall clock from now, at simulated time t in seconds."""
        self._t_0, self._w_0 = t, self._clock()

    def restart(self, pace: float, t: float) -> None:
        """Begin anew at another pace, at simulated time t in seconds; the report, too."""
        self._pace, self._report = pace, PaceReport(pace, 0, 0, 0.0, None)
        self.start(t)

    def wait(self, t: float, ended: Callable[[], bool]) -> None:
        """Wait until simulated time t in seconds is due, or until `ended()` says that the run is to end."""
        if t <= self._t_0:
            return
        deadline = self._w_0 + (t - self._t_0) / self._pace
        left = deadline - self._clock()
        self._count(t, max(-left, 0.0))
        while left > 0 and not ended():
            self._sleep(min(left, _SLICE))
            left = deadline - self._clock()
        spent = self._clock() - self._w_0
        if spent > 0:
            self._report = replace(self._report, reached=(t - self._t_0) / spent)

    def _count(self, t: float, lateness: float) -> None:
        r = self._report
        worst, at = max((r.largest_lateness, r.latest_at), (lateness, t), key=lambda late: late[0])
        self._report = PaceReport(r.pace, r.deadlines + 1, r.missed + (lateness > 0), worst, at if worst else None)
