"""Writes checkpoints while a run goes on."""

import logging
import math
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path

from handover.cosim.checkpoint import take_checkpoint, write_checkpoint
from handover.cosim.master import Master
from handover.cosim.record.recorder import Recorder
from handover.cosim.system.signals import Signals

_log = logging.getLogger(__name__)


def nothing() -> bytes:
    """Keep nothing besides the units' and the master's states."""
    return b""


class Checkpointer:
    """An observer of `Master.run`, the last of them, that writes a checkpoint every so many simulated seconds.

    A checkpoint is due at the multiples of `every`, and written at the first communication point that is not before.

    Args:
        path: the checkpoint's file, of which a newer one takes the place.
        every: seconds.
        master, recorder: of the run.
        keep: gives what has to be kept besides, such as the states of other observers.
    """

    def __init__(
        self, path: Path, every: Fraction, master: Master, recorder: Recorder, keep: Callable[[], bytes] = nothing
    ) -> None:
        self.path = path
        self._every = every
        self._master, self._recorder, self._keep = master, recorder, keep
        self._next = self._after(master.time)

    def __call__(self, t: float, signals: Signals) -> None:  # noqa: ARG002
        """Write a checkpoint if one is due.

        Raises:
            UnitFailure: a unit does not give its state. RecordNotWritten: the record cannot be written.
        """
        if t >= self._next:
            self.write()
            self._next = self._after(t)

    def write(self) -> None:
        """Write a checkpoint of the communication point that observers saw last; raises as by calling.

        Where it cannot be written, the log says so, the former one stays, and the run goes on.
        """
        checkpoint = take_checkpoint(self._master, self._recorder.sync(), self._keep())
        try:
            write_checkpoint(self.path, checkpoint)
        except OSError as e:
            told = e.strerror or e
            _log.warning("%s cannot be written at t = %g s, the former one stays: %s", self.path, checkpoint.time, told)

    def _after(self, t: float) -> float:
        count = math.floor(Fraction(t) / self._every)
        while float(count * self._every) <= t:  # a time is rounded, so a multiple may seem to be not reached
            count += 1
        return float(count * self._every)
