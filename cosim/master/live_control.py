"""Controls of a run that another process may use while it goes on: pace, pause, single steps and stop.

They lie in a memory-mapped file of five numbers, which the run reads at each communication point. They say when a step
is taken, never what is in it: the record is the same, byte for byte, at any pace.
"""

import contextlib
import math
import mmap
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from handover.cosim.master.pacing import Pacer, PaceReport

_FIELDS = np.dtype(
    [("pace", "<f8"), ("paused", "<i8"), ("steps_asked", "<i8"), ("steps_taken", "<i8"), ("stop", "<i8")]
)
_SLICE = 0.02
"""How often a run that waits looks whether it may go on, s."""


class LiveControl:
    """The controls of a run, in a file of both processes. Each number has one process that writes it.

    Args:
        path: a file that `create` has made; None for memory of this process alone.

    Attributes, written by who controls the run:
        pace: simulated seconds per second of wall time, positive; infinite: as fast as it goes. Another one raises
            ValueError: a run that is to wait is paused.
        paused: whether the run waits at the communication point that it has reached.
        steps_asked: single steps requested while paused, in all.
        stop: whether it is to end after its step.

    Attributes, written by the run:
        steps_taken: how many of these points it has gone on to, or will not as it is no longer paused.
    """

    def __init__(self, path: Path | None) -> None:
        if path is None:
            self._map = mmap.mmap(-1, _FIELDS.itemsize)
        else:
            with open(path, "r+b") as file:
                self._map = mmap.mmap(file.fileno(), _FIELDS.itemsize)
        self._fields: Any = np.frombuffer(self._map, dtype=_FIELDS, count=1)[0]

    @classmethod
    def create(cls, path: Path, pace: float, *, paused: bool) -> "LiveControl":
        """Make the file.

        Raises:
            OSError: it cannot be made.
            ValueError: the pace is not positive.
        """
        path.write_bytes(np.array([(_positive(pace), int(paused), 0, 0, 0)], dtype=_FIELDS).tobytes())
        return cls(path)

    @classmethod
    def in_memory(cls, pace: float) -> "LiveControl":
        """Return controls of this process alone, as of what is replayed in it; not paused.

        Raises:
            ValueError: the pace is not positive.
        """
        control = cls(None)
        control.pace = pace
        return control

    @property
    def pace(self) -> float:  # noqa: D102 (see the class, also below)
        return float(self._fields["pace"])

    @pace.setter
    def pace(self, value: float) -> None:
        self._fields["pace"] = _positive(value)

    @property
    def paused(self) -> bool:  # noqa: D102
        return bool(self._fields["paused"])

    @paused.setter
    def paused(self, value: bool) -> None:
        self._fields["paused"] = value

    @property
    def stop(self) -> bool:  # noqa: D102
        return bool(self._fields["stop"])

    @stop.setter
    def stop(self, value: bool) -> None:
        self._fields["stop"] = value

    def ask_for_step(self) -> None:
        """Pause the run, and let it go on to one more communication point."""
        self._fields["steps_asked"] += 1
        self.paused = True

    def take_step(self) -> bool:
        """Take a step that was asked for; return whether there was one."""
        left = bool(self._fields["steps_taken"] < self._fields["steps_asked"])
        self._fields["steps_taken"] += int(left)
        return left

    def forget_steps(self) -> None:
        """Count all steps that were asked for as taken: the run is not paused."""
        self._fields["steps_taken"] = self._fields["steps_asked"]

    def close(self) -> None:
        """Release the file; what the controls say, and are set to, stays with this object."""
        self._fields = self._fields.copy()
        with contextlib.suppress(BufferError):
            self._map.close()


class ControlledPacer(Pacer):
    """Lets a run wait for the wall clock as its controls say, which may change at any time.

    Deadlines count from the last change of pace, and from the end of the last pause; so does the report.
    """

    def __init__(
        self,
        control: LiveControl,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        super().__init__(_finite(control.pace), clock, sleep)
        self._control = control
        self._first: float = control.pace
        self._current: float = control.pace
        self._changed = False
        self._has_begun = False  # whether a deadline has been waited for
        self._last = 0.0

    @property
    def report(self) -> PaceReport:
        """The report since the last change of pace, or the last pause."""
        if not self._changed:
            return super().report
        return replace(
            super().report, pace=_finite_or_none(self._current), changed=True, first=_finite_or_none(self._first)
        )

    def wait(self, t: float, ended: Callable[[], bool]) -> None:
        """Wait until simulated time t in seconds is due by the controls, or until `ended()` says that the run ends."""
        control, waited = self._control, False
        while not ended():
            if control.paused:
                waited = True
                if control.take_step():
                    break
                self._sleep(_SLICE)
                continue
            control.forget_steps()
            if waited:
                break
            if control.pace != self._current:
                self._current = control.pace
                if self._has_begun:
                    self._changed = True
                else:  # set before the run has waited for anything: it never went at another one
                    self._first = self._current
                self.restart(_finite(self._current), self._last)
            if math.isinf(self._current) or self._is_due(t, ended):
                break
        if waited:
            self.restart(_finite(self._current), t)
        self._last, self._has_begun = t, True

    def _is_due(self, t: float, ended: Callable[[], bool]) -> bool:
        """Wait until t is due; return whether it is, and not paused or at another pace before."""
        control = self._control

        def changed() -> bool:
            return ended() or control.paused or control.pace != self._current

        super().wait(t, changed)
        return not changed()


def _positive(pace: float) -> float:
    if not pace > 0.0:
        raise ValueError(f"the pace must be positive, not {pace}: simulated seconds per second of wall time")
    return pace


def _finite_or_none(pace: float) -> float | None:
    return pace if math.isfinite(pace) else None


def _finite(pace: float) -> float:
    return pace if math.isfinite(pace) else 1.0
