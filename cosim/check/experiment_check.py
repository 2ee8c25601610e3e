"""Runs the experiments that an FMU contains, and compares its outputs with the results beside them.

What an experiment is, and which tolerances it has, is in `handover.cosim.experiments.reference_experiment`.
"""

import math
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from handover.cosim.blocks.declarations import short_repr
from handover.cosim.blocks.variable import Kind
from handover.cosim.exceptions import counted, nearest
from handover.cosim.experiments.experiment_run import (
    communication_points,
    result_columns,
    run_experiment,
    stimulus_columns,
)
from handover.cosim.experiments.reference_experiment import (
    Difference,
    ReferenceExperiment,
    Setup,
    differences,
)
from handover.cosim.experiments.signal_table import (
    InvalidTable,
    SignalTable,
    read_header,
    read_table,
    unknown_columns,
)
from handover.cosim.fmu.file.archive import FmuArchive
from handover.cosim.fmu.file.default_experiment import proposed_step
from handover.cosim.fmu.file.description import FmuDescription, FmuPort
from handover.cosim.fmu.start_values import parsed_number
from handover.cosim.probe.finding import Finding, Level, abbreviated, fault, note


class ExperimentCheck:
    """The check of one FMU's experiments.

    Attributes:
        archive, description: of the FMU.
        variables: the names of all variables that its model description has.
        folder: where it is unpacked.
        scratch: a folder for files.
        timeout: of one run, in seconds.
    """

    def __init__(
        self, archive: FmuArchive, description: FmuDescription, variables: Sequence[str],
        folder: Path, scratch: Path, timeout: float,
    ) -> None:  # fmt: skip
        self._archive, self._d, self._variables = archive, description, variables
        self._folder, self._scratch, self._timeout = folder, scratch, timeout

    def run(self, experiment: ReferenceExperiment) -> tuple[str, list[Finding]]:
        """Run an experiment; return in a few words what was compared, and what was found."""
        where = experiment.stimulus.where
        lines = parameter_faults(self._d, experiment.setup.parameters)
        if lines:
            what = f"{experiment.name}: its result was made with other parameters: {abbreviated(lines)}"
            return "", [fault(what, where=where, cure="a result of the present parameters is wanted")]
        try:
            tables, findings = self._tables(experiment)
            step = experiment.setup.step or proposed_step(self._d.step)
            start = tables[0].times[0]
            stimulus = tables[0].snapped(start, step)
            reference = tables[1].snapped(start, step) if tables[1] else None
            points = communication_points(
                stimulus.times,
                reference.times if reference else (),
                step,
                varies_step=self._d.capabilities.varies_step,
            )
        except InvalidTable as e:
            return "", [fault(str(e), where=where)]
        place = Path(tempfile.mkdtemp(prefix="experiment-", dir=self._scratch))
        files = {"stimulus": place / "stimulus.csv", "result": place / "result.csv"}
        files["stimulus"].write_bytes(self._archive.read(experiment.stimulus.path))
        if experiment.result is not None:
            files["reference"] = place / "reference.csv"
            files["reference"].write_bytes(self._archive.read(experiment.result.path))
        findings += run_experiment(self._d.path, self._folder, [files], step, place, self._timeout)
        n = len(points) - 1
        if any(f.level is Level.FAULT for f in findings):
            return f"{experiment.name}: {n} steps", findings
        if reference is None or experiment.result is None:
            return f"{experiment.name}: {n} steps, nothing compared", findings
        columns = result_columns(self._d)
        result = read_table(files["result"].read_bytes(), "result", columns)
        compared = differences(reference, result, columns)
        findings += _judged(compared, experiment.setup)
        n_outputs = counted(len(compared), "output")
        if absent := len(set(points) - set(reference.times)):
            n_outputs += f" at {n + 1 - absent} of {n + 1} points"
            if experiment.setup.step is not None:
                what = f"{experiment.result.source}: it lacks {absent} of {n + 1} communication points"
                findings.append(fault(what, where=where, cure="the result as it was made has a row for each"))
        most = _largest_in_words(compared, experiment.setup)
        return f"{experiment.name}: {n} steps, {n_outputs} compared, {most}", findings

    def _tables(self, e: ReferenceExperiment) -> tuple[tuple[SignalTable, SignalTable | None], list[Finding]]:
        """Return stimulus and result, and what is good to know about them.

        Raises:
            InvalidTable: one is not what it should be.
        """
        inputs, outputs = stimulus_columns(self._d), result_columns(self._d)
        content = self._archive.read(e.stimulus.path)
        if lacking := unknown_columns(read_header(content, e.stimulus.source), inputs, "input"):
            raise InvalidTable(e.stimulus.source, lacking)
        stimulus = read_table(content, e.stimulus.source, inputs)
        if e.result is None:
            return (stimulus, None), []
        content = self._archive.read(e.result.path)
        header = read_header(content, e.result.source)
        known = [*outputs, *inputs, *self._variables]
        if lacking := unknown_columns(header, known, "variable"):
            raise InvalidTable(e.result.source, lacking)
        if not set(header) & set(outputs):
            raise InvalidTable(e.result.source, [f"no column is an output of the FMU: {nearest('', outputs)}"])
        reference = read_table(content, e.result.source, outputs)
        if early := [t for t in reference.times if t < stimulus.times[0]]:
            when = f"it begins at {float(early[0]):g} s, before its stimulus at {float(stimulus.times[0]):g} s"
            raise InvalidTable(e.result.source, [when])
        skipped = [c for c in header if c not in outputs and c not in inputs]
        notes = [note(f"{e.result.source}: no outputs, not compared: {abbreviated(skipped)}")] if skipped else []
        return (stimulus, reference), notes


def _largest_in_words(compared: Sequence[Difference], setup: Setup) -> str:
    """Return by how much the output differs that uses most of its tolerance."""

    def use(d: Difference) -> float:
        allowed = setup.allowed(d)
        return d.greatest / allowed if allowed else math.inf if d.greatest else 0.0

    worst = max(compared, key=use)
    if not worst.greatest:
        return "all equal"
    if math.isinf(worst.greatest):
        return f"{worst.name} not equal"
    if not worst.largest:
        return f"{worst.name} {worst.greatest:.1g} off, which is 0 in the result"
    return f"{worst.name} {worst.share:.1g} of its largest value off"


def _judged(compared: Sequence[Difference], setup: Setup) -> Iterator[Finding]:
    """Yield a finding for each output that differs: a fault where it is beyond the tolerance."""
    for d in (d for d in compared if d.greatest):
        where = f"output {d.name!r}"
        if math.isinf(d.greatest):
            yield fault(
                f"it is not as in the result from t = {d.at:.6g} s on", where=where, cure="expected equal values"
            )
            continue
        allowed = setup.allowed(d)
        size = f"it differs from the result by up to {d.greatest:.3g} at t = {d.at:.6g} s"
        origin = f"{setup.relative_of(d):g} of its largest value {d.largest:.3g}, and {setup.absolute:g}"
        level = note if d.greatest <= allowed else fault
        yield level(f"{size}; {allowed:.3g} is allowed ({origin})", where=where)


def parameter_faults(d: FmuDescription, recorded: Mapping[str, str]) -> list[str]:
    """Return, a line each, the parameters that the FMU has not as they were recorded with a result."""
    faults: list[str] = []
    for name, text in recorded.items():
        if name not in d.parameters:
            faults.append(f"{name!r} is not a parameter of the FMU: {nearest(name, d.parameters)}")
        elif not _same_start(d.parameters[name], text):
            given = d.parameters[name].start or ""
            faults.append(f"{name} was {short_repr(text)} and is {short_repr(given)}")
    if recorded:
        faults += [f"{name} was not there" for name in d.parameters if name not in recorded]
    return faults


def _same_start(port: FmuPort, text: str) -> bool:
    given = port.start or ""
    if given == text or port.kind in (Kind.STRING, Kind.BINARY):
        return given == text
    try:
        one, other = ([parsed_number(port, word) for word in each.split()] for each in (given, text))
    except ValueError:
        return False
    return one == other
