"""Runs the experiments that an FMU contains, and compares its outputs with the results beside them.

An experiment is a stimulus (CSV, role `experiment`) and a result (CSV, role `result`) of the manifest that
`related_files` reads. An annotation of ours at the stimulus (`Setup`) names the result, the communication step, the
tolerances and the parameters with which the result was made. Of an FMU without it, the result is the one that has a
label in common with the stimulus, or the only one.

An output agrees if no entry differs by more than `relative` times the largest magnitude that its variable has in the
result, plus `absolute`; what is no real number must be equal.
"""

import math
import sys
import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path

import numpy as np

from handover.cosim.blocks.declarations import short_repr
from handover.cosim.blocks.variable import Kind
from handover.cosim.check.experiment_run import communication_points, result_columns, run_experiment, stimulus_columns
from handover.cosim.check.finding import Finding, Level, fault, note, warning
from handover.cosim.check.related_files import EXPERIMENT, RESULT, RelatedFile
from handover.cosim.check.signal_table import (
    Column,
    InvalidTable,
    SignalTable,
    read_header,
    read_table,
    unknown_columns,
)
from handover.cosim.exceptions import nearest
from handover.cosim.fmu.file.archive import FmuArchive
from handover.cosim.fmu.file.default_experiment import proposed_step
from handover.cosim.fmu.file.description import FmuDescription, FmuPort
from handover.cosim.fmu.file.xml import XmlElement
from handover.cosim.fmu.start_values import parsed_number

ANNOTATION = "handover.experiment"
ANNOTATION_NAMESPACE = "urn:handover:experiment"
RELATIVE = 1e-3
"""Relative tolerance where the manifest gives none: other hosts set inputs and end steps in other ways."""
ABSOLUTE = 1e-12
"""Absolute tolerance in a variable's unit, where the manifest gives none: an output that rests at 0 may round."""

_CSV = "text/csv"
_MAX_CHARACTERS = 1000
"""Of a step as a fraction: those of doubles have fewer than 400."""


@dataclass(frozen=True)
class Setup:
    """How a result was made, and how closely it is met.

    Attributes:
        step: communication step in seconds; None: that of the FMU.
        relative, absolute: tolerances, see above; None where none is given.
        parameters: start values of all parameters, as they are written in the model description.
        left_out: names of outputs that the result does not have.
    """

    step: Fraction | None = None
    relative: float | None = None
    absolute: float | None = None
    parameters: Mapping[str, str] = field(default_factory=dict[str, str])
    left_out: Sequence[str] = ()

    def as_xml(self, result: str) -> ET.Element:
        """Return the annotation of a stimulus, which names the result's file as the manifest does."""
        annotation = ET.Element("Annotation", type=ANNOTATION)
        tolerances = {"relative": repr(self.relative), "absolute": repr(self.absolute)}
        attributes = {"xmlns": ANNOTATION_NAMESPACE, "result": result, "step": str(self.step), **tolerances}
        element = ET.SubElement(annotation, "Setup", attributes)
        for name, value in self.parameters.items():
            ET.SubElement(element, "Parameter", name=name, value=value)
        for name in self.left_out:
            ET.SubElement(element, "LeftOut", name=name)
        return annotation


@dataclass(frozen=True)
class ReferenceExperiment:
    """A stimulus of an FMU's manifest with its result, which may be missing."""

    stimulus: RelatedFile
    result: RelatedFile | None
    setup: Setup

    @property
    def name(self) -> str:
        """Its name for messages: the stimulus as the manifest has it."""
        return self.stimulus.source


def experiments_in(files: Sequence[RelatedFile]) -> tuple[list[ReferenceExperiment], list[Finding]]:
    """Return the experiments that can be run, and why others are not."""
    experiments: list[ReferenceExperiment] = []
    findings: list[Finding] = []
    results = [f for f in files if f.role == RESULT and f.path and _is_csv(f)]
    for file in (f for f in files if f.role == EXPERIMENT and f.path):
        if not _is_csv(file) or file.sub_role == "uncertainty-analysis":
            what = f"{file.source}: experiments of {file.type} are not run" if not _is_csv(file) else ""
            findings.append(note(what or f"{file.source}: uncertainty analyses are not run", where=file.where))
            continue
        element = next((a for a in file.annotations if a.tag == f"{{{ANNOTATION_NAMESPACE}}}Setup"), None)
        try:
            setup = Setup() if element is None else _setup(element)
        except ValueError as e:
            findings.append(fault(f"the setup of {file.source}: {e}", where=file.where))
            continue
        named = None if element is None else element.get("result")
        beside = [r for r in results if (r.source == named if named else set(r.labels) & set(file.labels))]
        alone = results if len(results) == 1 and not named else []
        result = next(iter(beside or alone), None)
        if result is None:
            what = f"{file.source}: no result belongs to it{f': {named} is missing' if named else ''}"
            cure = "a CSV file of role result with a label of the experiment's is wanted"
            findings.append(warning(what, where=file.where, cure=cure))
        experiments.append(ReferenceExperiment(file, result, setup))
    return experiments, findings


def _is_csv(file: RelatedFile) -> bool:
    return file.type.partition(";")[0].strip() == _CSV or file.path.lower().endswith(".csv")


def _setup(element: XmlElement) -> Setup:
    tag = f"{{{ANNOTATION_NAMESPACE}}}"
    step = _exact_step(element.get("step"))
    if step is None:
        raise ValueError(f"step={element.get('step')[:40]!r} is no positive number of seconds")
    return Setup(
        step=step,
        relative=_tolerance(element, "relative"),
        absolute=_tolerance(element, "absolute"),
        parameters={p.get("name"): p.get("value") for p in element.named(f"{tag}Parameter")},
        left_out=tuple(p.get("name") for p in element.named(f"{tag}LeftOut")),
    )


def _exact_step(text: str) -> Fraction | None:
    """Return a step of 1/30 or 0.02, for example, exactly; None if it is no positive number that a double can hold.

    That is seen before an exact number is made, as one of `1e20000000` would take minutes.
    """
    try:
        if len(text) > _MAX_CHARACTERS or ("/" not in text and not 0.0 < float(text) < math.inf):
            return None
        step = Fraction(text)
    except (ValueError, ZeroDivisionError):
        return None
    return step if sys.float_info.min <= step <= sys.float_info.max else None


def _tolerance(element: XmlElement, name: str) -> float:
    try:
        number = float(element.get(name))
    except ValueError:
        number = math.nan
    if not 0 <= number < math.inf:
        raise ValueError(f"{name}={element.get(name)[:40]!r} is no tolerance; a number from 0 on is right")
    return number


def parameter_faults(d: FmuDescription, recorded: Mapping[str, str]) -> list[str]:
    """Return, a line each, the parameters that the FMU has not as they were recorded with a result."""
    faults: list[str] = []
    for name, text in recorded.items():
        if name not in d.parameters:
            faults.append(f"{name!r} is no parameter of the FMU: {nearest(name, d.parameters)}")
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


@dataclass(frozen=True)
class Difference:
    """By how much an output differs from a reference.

    Attributes:
        name: of the variable.
        greatest: the greatest difference of an entry; infinity of what is no real number and differs.
        at: when, in seconds.
        largest: the largest magnitude that the variable has in the reference; 0 of what is no real number.
    """

    name: str
    greatest: float
    at: float
    largest: float

    @property
    def share(self) -> float:
        """The difference relative to the largest magnitude; 0 where there is none, infinity where that is of 0."""
        if self.greatest == 0:
            return 0.0
        return self.greatest / self.largest if self.largest > 0 else math.inf


def differences(reference: SignalTable, result: SignalTable, columns: Mapping[str, Column]) -> list[Difference]:
    """Return by how much each output differs from a reference, at the times of the reference, which the result has."""
    rows = {float(t): k for k, t in enumerate(result.times)}
    picked = [rows[float(t)] for t in reference.times]
    by_port: dict[str, list[str]] = {}
    for name in reference.columns:
        by_port.setdefault(columns[name][0].name, []).append(name)
    found: list[Difference] = []
    for port, names in by_port.items():
        wanted = [reference.columns[n] for n in names]
        given = [[result.columns[n][k] for k in picked] for n in names]
        if columns[names[0]][0].kind is Kind.REAL:
            apart = np.max(np.abs(np.array(wanted) - np.array(given)), axis=0)
            largest = float(np.max(np.abs(wanted)))
        else:
            differs = [a != b for a, b in zip(zip(*wanted, strict=True), zip(*given, strict=True), strict=True)]
            apart, largest = np.where(differs, math.inf, 0.0), 0.0
        worst = int(np.argmax(apart))
        found.append(Difference(port, float(apart[worst]), float(reference.times[worst]), largest))
    return found


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
            what = f"{experiment.name}: its result was made with other parameters: {_first_of(lines)}"
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
        if any(f.level is Level.FAULT for f in findings) or reference is None:
            return f"{experiment.name}: {n} steps", findings
        columns = result_columns(self._d)
        result = read_table(files["result"].read_bytes(), "result", columns)
        compared = differences(reference, result, columns)
        findings += _judged(compared, experiment.setup)
        n_outputs = f"{len(compared)} output{'s' if len(compared) != 1 else ''}"
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
        notes = [note(f"{e.result.source}: no outputs, not compared: {_first_of(skipped)}")] if skipped else []
        return (stimulus, reference), notes


def _allowed(d: Difference, setup: Setup) -> float:
    relative = RELATIVE if setup.relative is None else setup.relative
    absolute = ABSOLUTE if setup.absolute is None else setup.absolute
    return relative * d.largest + absolute


def _largest_in_words(compared: Sequence[Difference], setup: Setup) -> str:
    """Return by how much the output differs that uses most of its tolerance."""

    def use(d: Difference) -> float:
        allowed = _allowed(d, setup)
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
    relative = RELATIVE if setup.relative is None else setup.relative
    absolute = ABSOLUTE if setup.absolute is None else setup.absolute
    for d in (d for d in compared if d.greatest):
        where = f"output {d.name!r}"
        if math.isinf(d.greatest):
            yield fault(f"it is not as in the result from t = {d.at:.6g} s on", where=where, cure="equal is right")
            continue
        allowed = _allowed(d, setup)
        size = f"it differs from the result by up to {d.greatest:.3g} at t = {d.at:.6g} s"
        origin = f"{relative:g} of its largest value {d.largest:.3g}, and {absolute:g}"
        level = note if d.greatest <= allowed else fault
        yield level(f"{size}; {allowed:.3g} is allowed ({origin})", where=where)


def _first_of(names: Sequence[str], most: int = 10) -> str:
    return ", ".join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")
