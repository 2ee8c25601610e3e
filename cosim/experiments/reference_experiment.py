"""The experiments that an FMU contains, with their setup, and by how much outputs differ from a result.

An experiment is a stimulus (CSV, role `experiment`) and a result (CSV, role `result`) of the manifest that
`related_files` reads. An annotation of ours at the stimulus (`Setup`) names the result, the communication step, the
tolerances and the parameters with which the result was made. Of an FMU without it, the result is the one that has a
label in common with the stimulus, or the only one.

An output agrees if no entry differs by more than `relative` times the largest magnitude that its variable has in the
result, plus `absolute`; what is no real number must be equal. Of a Float32 output `relative` is 2**-23 at least: a unit
in its last place, which other machines may round the other way.
"""

import math
import sys
import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction

import numpy as np

from handover.cosim.blocks.ports import Width
from handover.cosim.blocks.variable import Kind
from handover.cosim.experiments.manifest import EXPERIMENT, RESULT, RelatedFile
from handover.cosim.experiments.signal_table import Column, SignalTable
from handover.cosim.fmu.file.xml import XmlElement
from handover.cosim.probe.finding import Finding, fault, note, warning

ANNOTATION = "handover.experiment"
ANNOTATION_NAMESPACE = "urn:handover:experiment"
RELATIVE = 1e-3
"""Relative tolerance where the manifest gives none: other hosts set inputs and end steps in other ways."""
ABSOLUTE = 1e-12
"""Absolute tolerance in a variable's unit, where the manifest gives none: an output that rests at 0 may round."""
FLOAT32_RESOLUTION = 2.0**-23
"""A unit in the last place of a number of 32 bits, relative to the number, at most."""

_CSV = "text/csv"
_MAX_CHARACTERS = 1000
"""Of a step as a fraction: those of doubles have fewer than 400."""


@dataclass(frozen=True)
class Setup:
    """How a result was made, and how closely it is met.

    Attributes:
        step: communication step in seconds; None: that of the FMU.
        relative, absolute: tolerances, see above.
        parameters: start values of all parameters, as they are written in the model description.
        left_out: names of outputs that the result does not have.
    """

    step: Fraction | None = None
    relative: float = RELATIVE
    absolute: float = ABSOLUTE
    parameters: Mapping[str, str] = field(default_factory=dict[str, str])
    left_out: Sequence[str] = ()

    def relative_of(self, d: "Difference") -> float:
        """Return the relative tolerance of an output."""
        return max(self.relative, d.resolution)

    def allowed(self, d: "Difference") -> float:
        """Return by how much the entries of an output may differ, in its unit."""
        return self.relative_of(d) * d.largest + self.absolute

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
        raise ValueError(f"step={element.get('step')[:40]!r} is not a positive number of seconds")
    return Setup(
        step=step,
        relative=_tolerance(element, "relative"),
        absolute=_tolerance(element, "absolute"),
        parameters={p.get("name"): p.get("value") for p in element.named(f"{tag}Parameter")},
        left_out=tuple(p.get("name") for p in element.named(f"{tag}LeftOut")),
    )


def _exact_step(text: str) -> Fraction | None:
    """Return a step of 1/30 or 0.02, for example, exactly; None if it is not a positive number that a double can hold.

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
        raise ValueError(f"{name}={element.get(name)[:40]!r} is not a tolerance; expected a number from 0 on")
    return number


@dataclass(frozen=True)
class Difference:
    """By how much an output differs from a reference.

    Attributes:
        name: of the variable.
        greatest: the greatest difference of an entry; infinity of what is not a real number and differs.
        at: when, in seconds.
        largest: the largest magnitude that the variable has in the reference; 0 of what is not a real number.
        resolution: relative to the magnitude, a unit in the last place of a Float32; 0 of all others.
    """

    name: str
    greatest: float
    at: float
    largest: float
    resolution: float = 0.0

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
        resolution = FLOAT32_RESOLUTION if columns[names[0]][0].width is Width.FLOAT32 else 0.0
        found.append(Difference(port, float(apart[worst]), float(reference.times[worst]), largest, resolution))
    return found
