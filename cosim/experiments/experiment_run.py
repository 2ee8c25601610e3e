"""Plays a stimulus to one unit and records its outputs, in an isolated process (`isolated_process`).

The inputs hold the values of the latest row at or before a communication point, from initialisation on; the outputs are
recorded at every communication point. Rows whose times are rounded ends of steps count as there
(`SignalTable.snapped`). `run_experiment` starts the process, whose entry is `main`.
"""

import bisect
import itertools
import math
from collections.abc import Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from handover.cosim.blocks.variable import Kind
from handover.cosim.exceptions import InvalidFmu, UnitFailure
from handover.cosim.experiments.signal_table import (
    Column,
    InvalidTable,
    SignalTable,
    columns_of,
    entries_in,
    has_columns,
    read_table,
    write_table,
)
from handover.cosim.fmu.file.description import FmuDescription, describe_fmu
from handover.cosim.fmu.start_values import entries_of
from handover.cosim.probe.finding import Finding, fault
from handover.cosim.probe.isolated_process import Journal, run_isolated
from handover.cosim.probe.probed_instance import ProbedInstance, failure, log_tail

MAX_POINTS = 1_000_000


def stimulus_columns(d: FmuDescription) -> dict[str, Column]:
    """Return the columns that a stimulus may have, by name: entries of inputs, of those with texts only scalars."""
    return columns_of(p for p in d.inputs.values() if p.kind is not Kind.STRING or not p.shape)


def result_columns(d: FmuDescription) -> dict[str, Column]:
    """Return the columns of a recorded result, by name."""
    return columns_of(d.outputs.values())


def communication_points(
    stimulus: Sequence[Fraction], reference: Sequence[Fraction], step: Fraction | None, *, varies_step: bool
) -> list[Fraction]:
    """Return the times at which an experiment's steps end, the first being its start, in seconds.

    They are a step apart and, if the FMU takes steps of any size, also where the stimulus or the reference has a row;
    without a step they are only there.

    Raises:
        InvalidTable: there are too many; or a row lies off the grid, and the unit takes only steps of one size.
    """
    start, stop = stimulus[0], max([*stimulus[-1:], *reference[-1:]])
    if step is not None and (stop - start) / step > MAX_POINTS:
        many = f"until {float(stop):g} s there are more than {MAX_POINTS:g} steps of {float(step):g} s, too many to do"
        raise InvalidTable("stimulus", [many])
    grid = [] if step is None else [start + k * step for k in range(math.floor((stop - start) / step) + 1)]
    rows = {t for t in (*stimulus, *reference) if t >= start}
    if not varies_step and step is not None:
        for name, times in (("stimulus", stimulus), ("result", reference)):
            if off := [t for t in times if (t - start) % step]:
                only = f"the unit takes only steps of {float(step):g} s"
                raise InvalidTable(name, [f"the time {float(off[0]):g} s lies within a step: {only}"])
        return grid
    return sorted({*grid, *rows})


def run_experiment(
    fmu: Path, folder: Path, runs: Sequence[Mapping[str, Path]], step: Fraction | None, scratch: Path, timeout: float
) -> list[Finding]:
    """Play stimuli to an FMU in a process of its own and write what its outputs were; return what went wrong.

    Args:
        fmu: the FMU.
        folder: where it is unpacked.
        runs: the files of each run, which has an instance of its own: `stimulus`, `result` which is written if nothing
            goes wrong and, if there is one, `reference`, at whose times outputs are recorded, too.
        step: communication step, in seconds; None: from row to row.
        scratch: a folder for the process's own files, which may hold others.
        timeout: of all runs together, in seconds.
    """
    task = {
        "fmu": str(fmu.absolute()),
        "folder": str(folder),
        "step": None if step is None else str(step),
        "runs": [{name: str(path) for name, path in files.items()} for files in runs],
    }
    return run_isolated("handover.cosim.experiments.experiment_run", task, scratch, timeout).findings


class _Run:
    """A unit, the inputs that it gets and the outputs that it gives."""

    def __init__(self, unit: ProbedInstance, stimulus: SignalTable) -> None:
        self._unit, self._stimulus = unit, stimulus
        self._inputs = stimulus_columns(unit.description)
        self._outputs = [p for p in unit.description.outputs.values() if has_columns(p)]
        self._columns = columns_of(self._outputs)
        self._texts: dict[str, str] = {}

    def play(self, points: Sequence[Fraction]) -> SignalTable:
        """Return the outputs at the communication points.

        Raises:
            UnitFailure: a call failed.
            _NotFinite: an output is not a number.
        """
        unit = self._unit
        unit.start(float(points[0]), self._start_values())
        rows = [self._recorded()]
        for t, end in itertools.pairwise(points):
            self._set_inputs(bisect.bisect_right(self._stimulus.times, t) - 1)
            unit.set_inputs()
            unit.step(float(t), float(end - t))
            unit.get_outputs()
            rows.append(self._recorded())
        return SignalTable(points, dict(zip(self._columns, zip(*rows, strict=True), strict=True)))

    def _start_values(self) -> dict[str, Any]:
        """Return the values of the inputs in the first row; entries without a column have the FMU's."""
        values: dict[str, Any] = {}
        for name, column in self._stimulus.columns.items():
            port, i = self._inputs[name]
            if port.kind is Kind.STRING:
                values[port.name] = self._texts[port.name] = column[0]
            else:
                values.setdefault(port.name, entries_of(port, {}))[i] = column[0]
        ports = self._unit.description.inputs
        return {n: v if isinstance(v, str) else np.reshape(v, ports[n].shape) for n, v in values.items()}

    def _set_inputs(self, row: int) -> None:
        for name, column in self._stimulus.columns.items():
            port, i = self._inputs[name]
            if port.kind is not Kind.STRING:
                self._unit.u[port.name][0][i] = column[row]
            elif self._texts[port.name] != column[row]:
                self._texts[port.name] = column[row]
                self._unit.set_start({port.name: column[row]})

    def _recorded(self) -> list[Any]:
        values = [x for p in self._outputs for x in entries_in(p, self._unit.y[p.name])]
        for (name, (port, _)), value in zip(self._columns.items(), values, strict=True):
            if port.kind is Kind.REAL and not math.isfinite(value):
                raise _NotFinite(f"output {name!r} at t = {self._unit.time:.6g} s", value)
        return values


class _NotFinite(Exception):
    """An output is not a number: where, and what it is."""

    def __init__(self, where: str, value: float) -> None:
        super().__init__(where, value)
        self.where, self.value = where, value


def main(task: Mapping[str, Any]) -> None:
    """Make `task["runs"]` of the FMU `task["fmu"]`, unpacked in `task["folder"]`, with the step `task["step"]`."""
    journal = Journal(Path(task["journal"]))
    d = describe_fmu(Path(task["fmu"]))
    step = None if task["step"] is None else Fraction(task["step"])
    for files in task["runs"]:
        _run(d, Path(task["folder"]), {name: Path(path) for name, path in files.items()}, step, journal)
    journal.begins("unloading the library")
    journal.ends()


def _run(d: FmuDescription, folder: Path, files: Mapping[str, Path], step: Fraction | None, journal: Journal) -> None:
    stimulus = read_table(files["stimulus"].read_bytes(), "stimulus", stimulus_columns(d))
    start = stimulus.times[0]
    stimulus = stimulus.snapped(start, step)
    times = ()
    if "reference" in files:
        times = read_table(files["reference"].read_bytes(), "result", {}).snapped(start, step).times
    points = communication_points(stimulus.times, times, step, varies_step=d.capabilities.varies_step)
    try:
        unit = ProbedInstance("unit", d, folder, journal)
    except InvalidFmu as e:
        journal.found(fault(e.fault, where="instantiation", log=log_tail(e.log)))
    else:
        try:
            result = _Run(unit, stimulus).play(points)
            unit.end()
            files["result"].write_bytes(write_table(result, result_columns(d)))
        except UnitFailure as e:
            journal.found(failure(e))
        except _NotFinite as e:
            journal.found(fault(f"not finite: {e.value}", where=e.where))
        finally:
            unit.free()
