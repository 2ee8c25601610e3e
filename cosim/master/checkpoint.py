"""What a run needs to go on in another process: the states of its units and of its master, in one file.

Writes checkpoints while a run goes on.
"""

import array
import json
import logging
import math
import os
import pickle
import zipfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

from handover.cosim.exceptions import CosimError, one_line
from handover.cosim.master.master import Master
from handover.cosim.record.recorder import Recorder
from handover.cosim.system.signals import Signals
from handover.cosim.system.system import System

_FORMAT = 1


class InvalidCheckpoint(CosimError):
    """A checkpoint cannot be used."""

    def __init__(self, path: Path, fault: str) -> None:
        super().__init__(f"{path}: {fault}")
        self.path, self.fault = path, fault


class StateNotSaved(CosimError):
    """Units of a run that should write checkpoints cannot save their states; nothing has started."""

    def __init__(self, units: Mapping[str, str]) -> None:
        text = "; ".join(f"{name}: {reason}" for name, reason in units.items())
        super().__init__(f"a run with these units cannot write checkpoints, as they do not save their states: {text}")
        self.units = dict(units)


def check_states(system: System) -> None:
    """Check that all units say that their states can be fetched, set and serialised.

    Raises:
        StateNotSaved: with all that do not.
    """
    faults: dict[str, str] = {}
    for name, unit in system.units.items():
        d, state = unit.description, "FMUstate" if unit.description.fmi == 2 else "FMUState"
        able = {
            f"canGetAndSet{state}": d.capabilities.saves_state,
            f"canSerialize{state}": d.capabilities.serialises_state,
        }
        if not all(able.values()):
            faults[name] = f"{d.path.name} lacks {' and '.join(flag for flag, has in able.items() if not has)}"
    if faults:
        raise StateNotSaved(faults)


@dataclass(frozen=True, kw_only=True)
class Checkpoint:
    """A run at a communication point, after its observers have seen it.

    Attributes:
        time: simulated time, s.
        rows: rows of the record until then.
        stepper: what the stepper says of itself.
        units: of each unit its serialised state.
        contents: of each unit what its buffers held, which may be values of another time than its state's.
        cpu: of each unit the CPU seconds of its steps.
        kept: what whoever runs the master wants back.
    """

    time: float
    rows: int
    stepper: Mapping[str, Any]
    units: Mapping[str, bytes]
    contents: Mapping[str, Sequence[Sequence[bytes]]]
    cpu: Mapping[str, bytes]
    kept: bytes = b""

    def restore(self, master: Master) -> None:
        """Take a master that has been entered to where this one was.

        Raises:
            UnitFailure: a unit does not take its state. CosimError: these are other units.
        """
        if set(self.units) != set(master.system.units):
            raise CosimError(f"a checkpoint of the units {', '.join(self.units)}, not of these")
        for name, instance in master.ensemble.instances.items():
            instance.time = self.time
            instance.deserialise_state(self.units[name])
            instance.refill(self.contents[name])
            master.cpu[name][:] = array.array("d", self.cpu[name])
        master.stepper.set_state(self.stepper)


def take_checkpoint(master: Master, rows: int, kept: bytes = b"") -> Checkpoint:
    """Return where a master is, of whose record there are so many rows.

    Raises:
        UnitFailure: a unit does not give its state.
    """
    instances = master.ensemble.instances
    return Checkpoint(
        time=master.time,
        rows=rows,
        stepper=master.stepper.get_state(),
        units={name: i.serialise_state() for name, i in instances.items()},
        contents={name: i.contents() for name, i in instances.items()},
        cpu={name: spent.tobytes() for name, spent in master.cpu.items()},
        kept=kept,
    )


def write_checkpoint(path: Path, checkpoint: Checkpoint) -> None:
    """Write a checkpoint: the file is either the former one or whole, whenever the process ends.

    Raises:
        OSError: it cannot be written; the former one stays.
    """
    head = {
        "format": _FORMAT,
        "time": checkpoint.time,
        "rows": checkpoint.rows,
        "stepper": checkpoint.stepper,
        "units": list(checkpoint.units),
    }
    unfinished = _unfinished(path)
    try:
        with open(unfinished, "wb") as file:
            with zipfile.ZipFile(file, "w") as archive:
                archive.writestr("checkpoint.json", json.dumps(head))
                for i, name in enumerate(checkpoint.units):
                    archive.writestr(f"{i}.state", checkpoint.units[name])
                    archive.writestr(f"{i}.contents", pickle.dumps(checkpoint.contents[name]))
                    archive.writestr(f"{i}.cpu", checkpoint.cpu[name])
                archive.writestr("kept", checkpoint.kept)
            file.flush()
            os.fsync(file.fileno())
        os.replace(unfinished, path)
    except OSError:
        unfinished.unlink(missing_ok=True)
        raise


def remove_checkpoint(path: Path) -> None:
    """Remove a checkpoint, and what a process left that died as it wrote one."""
    path.unlink(missing_ok=True)
    _unfinished(path).unlink(missing_ok=True)


def read_checkpoint(path: Path) -> Checkpoint:
    """Read a checkpoint. Python objects in it are unpickled, so it must be from someone whom one trusts.

    Raises:
        InvalidCheckpoint: there is none, or it is damaged or of another version.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            head = json.loads(archive.read("checkpoint.json"))
            if head["format"] != _FORMAT:
                raise InvalidCheckpoint(path, f"a checkpoint of format {head['format']}; format {_FORMAT} can be read")
            names: list[str] = head["units"]
            return Checkpoint(
                time=head["time"],
                rows=head["rows"],
                stepper=head["stepper"],
                units={name: archive.read(f"{i}.state") for i, name in enumerate(names)},
                contents={name: pickle.loads(archive.read(f"{i}.contents")) for i, name in enumerate(names)},
                cpu={name: archive.read(f"{i}.cpu") for i, name in enumerate(names)},
                kept=archive.read("kept"),
            )
    except FileNotFoundError as e:
        raise InvalidCheckpoint(path, "there is no checkpoint; a run writes them with --checkpoint SECONDS") from e
    except InvalidCheckpoint:
        raise
    except Exception as e:  # whatever the readers of archive, JSON and pickle make of damaged bytes
        raise InvalidCheckpoint(path, f"the checkpoint is damaged: {one_line(e)}") from e


def _unfinished(path: Path) -> Path:
    return path.with_name(path.name + ".part")


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
            value = e.strerror or e
            _log.warning(
                "%s cannot be written at t = %g s, the former one stays: %s", self.path, checkpoint.time, value
            )

    def _after(self, t: float) -> float:
        count = math.floor(Fraction(t) / self._every)
        while float(count * self._every) <= t:  # a time is rounded, so a multiple may seem to be not reached
            count += 1
        return float(count * self._every)
