"""Writes the files of FMI-LS-REF into an FMU: manifest, parameter sets, a reference experiment, and a text on them.

The manifest lists by roles what the FMU has anyway, its block's source and its documentation, and what is made here.
The experiment and its result are in CSV, as `handover.cosim.experiments.signal_table` has them.
"""

import dataclasses
import re
import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from handover.cosim.blocks.start_values import fault_of
from handover.cosim.blocks.variable import Declared, Kind, Variable
from handover.cosim.experiments.manifest import DESCRIPTION, FOLDER, MANIFEST, NAMESPACE, ROOT, STANDARD, VERSION
from handover.cosim.fmu.file.description import FmuPort
from handover.fmus.contents.model_description import Model, to_xml
from handover.fmus.layout import Form, Layout

if TYPE_CHECKING:
    from handover.fmus.contents.reference_experiment import RecordedExperiment

PAGE = "documentation/fmi-ls-ref.txt"
"""Where the standard wants a text on the related files."""

_EXPERIMENT = "smoke-test"
_STIMULUS, _RESULT = f"{_EXPERIMENT}/stimulus.csv", f"{_EXPERIMENT}/result.csv"
_FILE_NAME = re.compile(r"[A-Za-z0-9_-][A-Za-z0-9_.-]{0,99}")
_FMI2_TYPES = {Kind.REAL: "Real", Kind.INTEGER: "Integer"}


@dataclass(frozen=True, kw_only=True)
class ParameterSet:
    """Values of a unit's parameters that belong together, such as those of a paper.

    Attributes:
        name: of the set, a file's name without its end: ASCII letters, digits, `_`, `-` and, after the first, `.`.
        description: one line for users.
        values: by parameter; of enumerations the name.
        origins: in a sentence, where a value is from.
        labels: by which sets can be filtered, such as `origin:published`.
    """

    name: str
    description: str
    values: Mapping[str, Any]
    origins: Mapping[str, str] = field(default_factory=dict[str, str])
    labels: Sequence[str] = ()


class CannotRecordExperiment(RuntimeError):
    """An FMU's reference experiment cannot be made; the message says why, and what would be right.

    `handover.fmus.contents.reference_experiment` raises it. The class stands here, since that module loads FMPy, which
    takes long, and who catches it builds most FMUs without an experiment.
    """


class NothingToCompare(CannotRecordExperiment):
    """An FMU has no output that a result in CSV could hold."""

    def __init__(self, unit: str) -> None:
        super().__init__(f"{unit} has no output that a result in CSV could hold: all are binary or have many entries")
        self.unit = unit


class InvalidParameterSet(ValueError):
    """A parameter set has a name that no file can have, names no parameter, or has a value that one cannot have."""

    def __init__(self, unit: str, name: str, faults: Sequence[str]) -> None:
        super().__init__(f"{unit}, parameter set {name!r}: {'; '.join(faults)}")
        self.unit, self.name, self.faults = unit, name, tuple(faults)


def related_files(
    model: Model, source: str, sets: Sequence[ParameterSet] = (), experiment: "RecordedExperiment | None" = None
) -> dict[str, bytes]:
    """Return the files by their paths in the FMU.

    Args:
        model: of the model description.
        source: path of the block's source in the FMU.
        sets: of its parameters.
        experiment: with its result, if there is one.

    Raises:
        InvalidParameterSet: a set does not fit the block's parameters; or its name is no file's, or another set's, too.
    """
    manifest = _Manifest()
    manifest.add("text/x-python", f"../../{source}", "model", "Source of the block, with what it imports beside it")
    manifest.add("text/html", "../../documentation/index.html", "document", "What the unit does, and its ports")
    manifest.add("text/plain", f"../../{PAGE}", "document", "What the related files are, and how the result was made")
    files: dict[str, bytes] = {}
    for parameters in sets:
        _check_name(model.name, parameters.name, [s.name for s in sets])
        path = f"parameters/{parameters.name}.ssv"
        files[f"{FOLDER}/{path}"] = _ssv(model, parameters)
        manifest.add("application/x-ssp-parameter-set", path, "parameter", parameters.description, parameters.labels)
    if experiment is not None:
        label = [f"experiment:{_EXPERIMENT}"]
        files |= {f"{FOLDER}/{_STIMULUS}": experiment.stimulus, f"{FOLDER}/{_RESULT}": experiment.result}
        held = "Inputs over time, held from row to row"
        element = manifest.add("text/csv", _STIMULUS, f"experiment/{_EXPERIMENT}", held, label)
        ET.SubElement(element, "Annotations").append(experiment.setup.as_xml(_RESULT))
        manifest.add("text/csv", _RESULT, "result", "Outputs at all communication points", label)
    files[MANIFEST] = to_xml(manifest.root)
    files[PAGE] = _page(model, sets, experiment).encode()
    return files


def _check_name(unit: str, name: str, names: Sequence[str]) -> None:
    if not _FILE_NAME.fullmatch(name):
        right = "expected ASCII letters, digits, '_', '-' and, after the first, '.'"
        raise InvalidParameterSet(unit, name, [f"a set's name is that of a file; {right}"])
    if [n.lower() for n in names].count(name.lower()) > 1:
        raise InvalidParameterSet(unit, name, ["two sets have this name, and so would their files"])


class _Manifest:
    def __init__(self) -> None:
        attributes = {"name": STANDARD, "version": VERSION, "description": DESCRIPTION}
        given = {f"fmi-ls:fmi-ls-{name}": value for name, value in attributes.items()}
        self.root = ET.Element(ROOT, {"xmlns:fmi-ls": NAMESPACE, **given})

    def add(self, mime: str, source: str, role: str, description: str, labels: Sequence[str] = ()) -> ET.Element:
        """Add a file; `source` is relative to the manifest."""
        given = {"type": mime, "source": source, "role": role, "description": description}
        element = ET.SubElement(self.root, "Related", given)
        for label in labels:
            ET.SubElement(element, "Label", name=label)
        return element


def _ssv(model: Model, parameters: ParameterSet) -> bytes:
    from handover.cosim.ssp.writing import values_document  # takes long to load, and most FMUs have no sets

    declared = {v.name: v for v in model.description.parameters}
    given = [(name, "no parameter of it" if name not in declared else fault_of(declared[name], value))
            for name, value in parameters.values.items()]  # fmt: skip
    if faults := [f"{name}: {fault}" for name, fault in given if fault]:
        raise InvalidParameterSet(model.name, parameters.name, faults)
    ports = {name: _port(model.layout, model.form, declared[name]) for name in parameters.values}
    values = {name: (ports[name], value) for name, value in parameters.values.items()}
    version = "1.0" if model.form is Form.FMI2 else "2.0"
    return values_document(values, version, f"{model.name}, {parameters.name}", parameters.origins)


def _port(layout: Layout, form: Form, v: Variable) -> FmuPort:
    """Return a parameter as a host finds it in the model description."""
    common = {f.name: getattr(v, f.name) for f in dataclasses.fields(Declared)}
    has_width = form is not Form.FMI2 and v.width is not None
    fmi_type = v.width.value if has_width and v.width else _FMI2_TYPES.get(v.kind, v.kind.value.capitalize())
    return FmuPort(**common, fmi_type=fmi_type, references=layout.references(form)[v.name])


def _page(model: Model, sets: Sequence[ParameterSet], experiment: "RecordedExperiment | None") -> str:
    lines = [
        f"Related files of {model.name}",
        "",
        f"{MANIFEST} lists them (FMI-LS-REF {VERSION}).",
        "",
        "PARAMETERS",
        "",
    ]
    for s in sets:
        lines += [f"parameters/{s.name}.ssv: {s.description}."]
        lines += [f"  {name} = {_shown(value)}: {s.origins.get(name, 'no origin')}" for name, value in s.values.items()]
        lines += [""]
    if not sets:
        lines += ["There are no parameter sets; the model description has the start values.", ""]
    lines += ["EXPERIMENT", ""]
    if experiment is None:
        lines += ["There is none. `handover build --prove` records one.", ""]
    else:
        lines += experiment.text_lines(_STIMULUS, _RESULT)
    return "\n".join(lines)


def _shown(value: Any) -> str:
    text = " ".join(str(value).split())
    return text if len(text) <= 100 else text[:97] + "..."
