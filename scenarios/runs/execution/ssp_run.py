"""An SSP as an experiment: it runs until its stop time, and its outputs are drawn."""

import contextlib
import os
from collections.abc import Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

from handover.cosim.exceptions import InvalidSsp
from handover.cosim.fmu.file.default_experiment import NoStep
from handover.cosim.fmu.file.description import FmuPort
from handover.cosim.ssp.archive import ssp_root
from handover.cosim.ssp.ssp_file import SspFile
from handover.cosim.ssp.xml import STRUCTURE
from handover.cosim.typed_data import is_exact_time
from handover.scenarios.runs.execution import supervisor
from handover.scenarios.runs.execution.errors import UsageError
from handover.scenarios.runs.execution.file_experiment import (
    ENDLESS,
    FileExperiment,
    SettableParameters,
    system_experiment,
)
from handover.scenarios.runs.results.run_folder import sha256_of


def is_ssp(name: str) -> bool:
    """Return whether a name is an SSP's file, its `.ssd` or its unpacked folder, and not a scenario."""
    return Path(name).suffix.lower() in (".ssp", ".ssd") or os.path.isfile(Path(name) / STRUCTURE)


class SspParameters(SettableParameters):
    """The parameters of an SSP that is open: those of its components as `UNIT.NAME`, and its own."""

    def __init__(self, ssp: SspFile) -> None:
        self._ssp = ssp

    @property
    def ports(self) -> Mapping[str, FmuPort]:
        """Their declarations."""
        return self._ssp.parameters

    def port(self, name: str) -> FmuPort | None:
        """Return the declaration of a name, which may also be an output or a local variable with a start value."""
        return self._ssp.port(name)

    def faults(self, texts: Sequence[str]) -> Sequence[str]:
        """Return what would be wrong with the system if it had these values."""
        return self._ssp.faults(_texts_by_name(self._ssp.path, texts))


def open_experiment(
    path: Path,
    stop: Fraction | None,
    step: Fraction | None,
    opened: contextlib.ExitStack,
    parameters: Sequence[str] = (),
    start: Fraction | None = None,
    *,
    endless: bool = False,
) -> FileExperiment:
    """Open an SSP as an experiment; `opened` closes it.

    `parameters` are texts `NAME=VALUE`, see `SspFile`; one that is `endless` needs no stop time.

    Raises:
        InvalidSsp: see `SspFile`; where a unit has no step, it names `--step`.
        UsageError: neither the file nor the command gives a stop time after the start, or a text is of another form.
    """
    texts = _texts_by_name(path, parameters)
    try:
        ssp = opened.enter_context(SspFile(path, step, texts, start, stop))
    except InvalidSsp as e:
        raise InvalidSsp(e.path, naming_step(e.faults)) from e
    supervisor.heartbeat.record_scratch_folder(str(ssp.folder))
    began = ssp.system.start
    until = began + ENDLESS if endless else checked_stop(path, began, stop, ssp.stop)
    heading = f"{ssp.name}, a system from {path.name}"
    parallel_step = None if step else ssp.parallel_step
    return system_experiment(path.name, heading, ssp.system, until, parallel_step, SspParameters(ssp))


def checked_stop(path: Path, start: Fraction, asked: Fraction | None, proposed: Fraction | None) -> Fraction:
    """Return when a run of a file ends that starts at a time, s: as asked, or as the file proposes.

    Raises:
        UsageError: neither gives a time, or one that is not after the start or that a run's folder does not keep.
    """
    later = f"--stop {float(start + 10):g} lets it run from {float(start):g} to {float(start + 10):g} s"
    stop = proposed if asked is None else asked
    if stop is None:
        raise UsageError(f"{path}: it proposes no stop time; {later}")
    if stop <= start:
        whose = "it proposes to stop" if asked is None else "it is to stop"
        raise UsageError(f"{path}: {whose} at {float(stop):g} s, and starts at {float(start):g} s; {later}")
    if not (is_exact_time(start) and is_exact_time(stop)):
        limits = "times below 1e308 s, and not finer than 1e-307 s, are taken"
        raise UsageError(f"{path}: it runs from {float(start):g} to {float(stop):g} s; {limits}")
    return stop


def _texts_by_name(path: Path, given: Sequence[str]) -> dict[str, str]:
    pairs = [tuple(part.strip() for part in text.split("=", 1)) for text in given]
    names = [pair[0] for pair in pairs]
    faults = [f"{t!r} is not of the form NAME=VALUE" for t, p in zip(given, pairs, strict=True) if len(p) < 2]
    faults += [f"{name} is given twice" for name in dict.fromkeys(names) if names.count(name) > 1]
    if faults:
        raise UsageError(f"{path}: {'; '.join(faults)}")
    return {pair[0]: pair[1] for pair in pairs}


def naming_step(faults: Sequence[str]) -> list[str]:
    """Return faults of a system, with the option that gives units a step where one has none."""
    return [f"{f}, such as by --step 0.01" if isinstance(f, NoStep) else f for f in faults]


def source_of(
    path: Path, start: Fraction, stop: Fraction, step: Fraction | None, parameters: Sequence[str]
) -> dict[str, Any]:
    """Return what a run's folder keeps of an SSP so that the run can be resumed: the file, times and given values."""
    times = {"start": str(start), "stop": str(stop), "step": None if step is None else str(step)}
    given = {"parameters": list(parameters)} if parameters else {}
    return {"ssp": str(path.absolute()), "sha256": sha256_of(ssp_root(path)), **times, **given}
