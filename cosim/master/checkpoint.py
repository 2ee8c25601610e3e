"""Checkpoints, from which a run resumes in another process: the states of its units and of its master, in one file.

A `Checkpointer` writes them during a run. The file is a zip archive, not compressed: `checkpoint.json`, for each unit
its state, the contents of its buffers and its CPU times, and `kept`, bytes of whoever runs the master. All of it is
plain data; what a unit makes of its state is the unit's, and many do not look whether it is one of theirs. So
`checkpoint.json` holds the SHA-256 of all others, and bytes that have changed reach no unit.
"""

import array
import hashlib
import json
import logging
import math
import os
import zipfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import Any, TypedDict

from handover.cosim.blocks.state import pack_state, unpack_state
from handover.cosim.exceptions import CosimError, one_line
from handover.cosim.files import check_regular
from handover.cosim.fmu.unit_warnings import WarningData
from handover.cosim.master.master import Master
from handover.cosim.record.recorder import Recorder
from handover.cosim.system.signals import Signals
from handover.cosim.system.system import System
from handover.cosim.typed_data import Count, ExactTime, NotNegative, checked, decoded

_log = logging.getLogger(__name__)

_FORMAT = 2


class InvalidCheckpoint(CosimError):
    """A checkpoint is missing, damaged or of another format."""

    def __init__(self, path: Path, fault: str) -> None:
        super().__init__(f"{path}: {fault}")
        self.path, self.fault = path, fault


class StateNotSaved(CosimError):
    """Units of a run with checkpoints cannot save their states; nothing has started."""

    def __init__(self, units: Mapping[str, str]) -> None:
        reasons = "; ".join(f"{name}: {reason}" for name, reason in units.items())
        super().__init__(f"a run with these units cannot write checkpoints, as they do not save states: {reasons}")
        self.units = dict(units)


def check_states(system: System) -> None:
    """Check that all units declare that their states can be fetched, set and serialised.

    Raises:
        StateNotSaved: with all that do not.
    """
    faults: dict[str, str] = {}
    for name, unit in system.units.items():
        d, state = unit.description, "FMUstate" if unit.description.fmi == 2 else "FMUState"
        flags = {
            f"canGetAndSet{state}": d.capabilities.saves_state,
            f"canSerialize{state}": d.capabilities.serialises_state,
        }
        if not all(flags.values()):
            faults[name] = f"{d.path.name} lacks {' and '.join(flag for flag, has in flags.items() if not has)}"
    if faults:
        raise StateNotSaved(faults)


@dataclass(frozen=True, kw_only=True)
class Checkpoint:
    """A run at a communication point, after its observers have seen it.

    Attributes:
        time: simulated time, s.
        rows: rows of the record until then.
        stepper: the state of the stepper.
        units: of each unit its serialised state.
        contents: of each unit the contents of its buffers, which may be values of another time than its state's.
        cpu: of each unit the CPU seconds of its steps.
        warnings: the calls of units that answered Warning.
        kept: bytes of whoever runs the master.
    """

    time: float
    rows: int
    stepper: Mapping[str, Any]
    units: Mapping[str, bytes]
    contents: Mapping[str, Sequence[Sequence[bytes]]]
    cpu: Mapping[str, bytes]
    kept: bytes = b""
    warnings: Sequence[WarningData] = field(default_factory=list[WarningData])

    def restore(self, master: Master) -> None:
        """Restore this run in a master that has been entered.

        Raises:
            UnitFailure: a unit does not accept its state.
            CosimError: the master has other units, or the checkpoint's parts do not fit them.
        """
        if set(self.units) != set(master.system.units):
            raise CosimError(f"a checkpoint of the units {', '.join(self.units)}, not of these")
        try:
            for name, instance in master.ensemble.instances.items():
                instance.time = self.time
                instance.deserialise_state(self.units[name])
                instance.refill(self.contents[name])
                spent = array.array("d", self.cpu[name])
                if not math.isfinite(sum(spent)):
                    raise ValueError(f"the CPU times of {name} are no finite numbers")
                master.cpu[name][:] = spent
            for warned in self.warnings:
                master.ensemble.instances[warned["instance"]].warnings.add_all(warned)
            master.stepper.set_state(self.stepper)
            last = math.inf if master.stop is None else master.schedule.time(master.schedule.ticks(master.stop))
            reached = Fraction(self.stepper.get("tick", self.stepper.get("now")))
            if late := [unit for unit, due in self.stepper["due"].items() if Fraction(due) < reached]:
                raise ValueError(f"steps of {', '.join(late)} are due before its time")
            if not self.time == master.time <= last:
                raise ValueError(f"its time is {self.time:g} s, its steps reach {master.time:g} s, the run {last:g} s")
        except (LookupError, TypeError, ValueError, AttributeError, ArithmeticError) as e:
            raise CosimError(f"the checkpoint does not fit its run ({type(e).__name__}: {one_line(e)})") from e


def take_checkpoint(master: Master, rows: int, kept: bytes = b"") -> Checkpoint:
    """Return a checkpoint of a master, whose record has `rows` rows.

    Raises:
        UnitFailure: a unit does not give its state.
    """
    instances = master.ensemble.instances
    warnings = [warnings.as_data(name) for name, warnings in master.warnings.items()]
    return Checkpoint(
        time=master.time,
        rows=rows,
        stepper=master.stepper.get_state(),
        units={name: i.serialise_state() for name, i in instances.items()},
        contents={name: i.contents() for name, i in instances.items()},
        cpu={name: spent.tobytes() for name, spent in master.cpu.items()},
        kept=kept,
        warnings=warnings,
    )


def write_checkpoint(path: Path, checkpoint: Checkpoint) -> None:
    """Write a checkpoint atomically: the file is the former one or the whole new one, whenever the process ends.

    Raises:
        OSError: it cannot be written; the former one stays.
    """
    parts = {"kept": checkpoint.kept}
    for i, name in enumerate(checkpoint.units):
        parts[f"{i}.state"] = checkpoint.units[name]
        parts[f"{i}.contents"] = pack_state(checkpoint.contents[name])
        parts[f"{i}.cpu"] = checkpoint.cpu[name]
    header = {
        "format": _FORMAT,
        "time": checkpoint.time,
        "rows": checkpoint.rows,
        "stepper": checkpoint.stepper,
        "units": list(checkpoint.units),
        "warnings": list(checkpoint.warnings),
        "sha256": {part: hashlib.sha256(content).hexdigest() for part, content in parts.items()},
    }
    unfinished = _unfinished(path)
    try:
        unfinished.unlink(missing_ok=True)  # a link in a folder of somebody else would have another file written
        with open(unfinished, "wb") as file:
            with zipfile.ZipFile(file, "w") as archive:
                archive.writestr("checkpoint.json", json.dumps(header))
                for part, content in parts.items():
                    archive.writestr(part, content)
            file.flush()
            os.fsync(file.fileno())
        os.replace(unfinished, path)
    except OSError:
        unfinished.unlink(missing_ok=True)
        raise


def remove_checkpoint(path: Path) -> None:
    """Remove a checkpoint, and the unfinished one of a process that crashed while writing."""
    path.unlink(missing_ok=True)
    _unfinished(path).unlink(missing_ok=True)


@dataclass(frozen=True)
class _Format:
    """By which other versions are distinguished from damage."""

    format: int


class _Statistics(TypedDict):
    accepted: Count
    rejected: Count
    shortest: NotNegative
    longest: NotNegative


class _Timing(TypedDict):
    ticks: dict[str, ExactTime | None]


class _StepperState(TypedDict, total=False):
    """What steppers keep, as far as it is numbers; times are ticks, or exact seconds."""

    tick: Count
    now: ExactTime
    wanted: Count
    due: dict[str, Count | ExactTime]
    acted: dict[str, int | ExactTime]
    courses: dict[str, tuple[ExactTime, ExactTime, bool]]
    units: dict[str, _Timing]
    controller: dict[str, float | None]
    statistics: _Statistics


@dataclass(frozen=True)
class _Header:
    """What `checkpoint.json` holds; earlier versions kept no warnings."""

    time: float
    rows: Count
    stepper: dict[str, Any]
    units: list[str]
    sha256: dict[str, str]
    warnings: list[WarningData] = field(default_factory=list[WarningData])


def read_checkpoint(path: Path) -> Checkpoint:
    """Read a checkpoint. It takes no more memory than the file is long.

    Raises:
        InvalidCheckpoint: there is none, or it is damaged or of another version.
    """
    try:
        check_regular(path)
        with zipfile.ZipFile(path) as archive:
            if compressed := [e.filename for e in archive.infolist() if e.compress_type != zipfile.ZIP_STORED]:
                raise InvalidCheckpoint(path, f"{compressed[0]} in it is compressed; checkpoints are written without")
            if sum(e.file_size for e in archive.infolist()) > path.stat().st_size:
                raise InvalidCheckpoint(path, "the checkpoint is damaged: its parts overlap")
            described = archive.read("checkpoint.json")
            if (written := decoded(described, _Format).format) != _FORMAT:
                raise InvalidCheckpoint(path, f"a checkpoint of format {written}; format {_FORMAT} can be read")
            header = decoded(described, _Header)
            names, digests = header.units, header.sha256

            def read(part: str) -> bytes:
                content = archive.read(part)
                if hashlib.sha256(content).hexdigest() != digests[part]:
                    raise InvalidCheckpoint(path, f"the checkpoint is damaged: {part} in it is not what was written")
                return content

            return Checkpoint(
                time=header.time,
                rows=header.rows,
                stepper=checked(header.stepper, _StepperState),
                units={name: read(f"{i}.state") for i, name in enumerate(names)},
                contents={name: unpack_state(read(f"{i}.contents")) for i, name in enumerate(names)},
                cpu={name: read(f"{i}.cpu") for i, name in enumerate(names)},
                kept=read("kept"),
                warnings=header.warnings,
            )
    except FileNotFoundError as e:
        how = "with --checkpoint SECONDS a run writes the first after that time"
        raise InvalidCheckpoint(path, f"there is no checkpoint; {how}") from e
    except InvalidCheckpoint:
        raise
    except Exception as e:  # the readers of zip, JSON and states raise various exceptions on damaged bytes
        raise InvalidCheckpoint(path, f"the checkpoint is damaged: {one_line(e)}") from e


def _unfinished(path: Path) -> Path:
    return path.with_name(path.name + ".part")


def nothing() -> bytes:
    """Keep nothing besides the units' and the master's states."""
    return b""


class Checkpointer:
    """An observer of `Master.run`, the last of them, that writes a checkpoint every so many simulated seconds.

    A checkpoint is due at the multiples of `every`, and written at the first communication point at or after one.

    Args:
        path: the file, which each checkpoint replaces.
        every: seconds.
        master, recorder: of the run.
        keep: returns what to keep besides, such as the states of other observers.
    """

    def __init__(
        self, path: Path, every: Fraction, master: Master, recorder: Recorder, keep: Callable[[], bytes] = nothing
    ) -> None:
        self.path = path
        self._every = every
        self._master, self._recorder, self._keep = master, recorder, keep
        self._next = self._after(master.time)

    def __call__(self, t: float, signals: Signals) -> None:  # noqa: ARG002
        """Write a checkpoint if one is due, unless a unit has ended the run, which cannot be resumed.

        Raises:
            UnitFailure: a unit does not give its state.
            RecordNotWritten: the record cannot be written.
        """
        if t >= self._next and self._master.ended is None:
            self.write()
            self._next = self._after(t)

    def write(self) -> None:
        """Write a checkpoint of the communication point that observers saw last; raises as by calling.

        Where it cannot be written, that is logged, the former one stays, and the run continues.
        """
        checkpoint = take_checkpoint(self._master, self._recorder.sync(), self._keep())
        try:
            write_checkpoint(self.path, checkpoint)
            _log.info("a checkpoint at t = %.9g s is written", checkpoint.time)
        except OSError as e:
            reason = e.strerror or e
            _log.warning(
                "%s cannot be written at t = %g s, the former one stays: %s", self.path, checkpoint.time, reason
            )

    def _after(self, t: float) -> float:
        after = (math.floor(Fraction(t) / self._every) + 1) * self._every
        if float(after) <= t:  # t is rounded, so a multiple that is reached may seem to lie after it
            after = math.ceil(Fraction(math.nextafter(t, math.inf)) / self._every) * self._every
        return float(after)
