"""A unit as a host sees it: what its XML says, and its library's functions."""

import ctypes
import math
import tempfile
import xml.etree.ElementTree as ET
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from handover.fmus.binaries import FMI2_FOLDERS
from handover.fmus.compile import host_platform, library
from support.faults.signatures import signatures

ENTRIES = {2: ("Real", "Integer", "Boolean", "String"), 3: ("Float64", "Int64", "Boolean", "String", "Binary")}
"""Types of variables whose getters and setters every unit has."""


@dataclass(frozen=True)
class Variable:
    """A variable; of an array in FMI 2 all its entries together.

    Attributes:
        type: as in the names of getters and setters.
        references: one, or in FMI 2 one an entry.
        start: entries, if they are real or whole numbers.
        items: values of an enumeration.
        exact: bytes of a picture, or None.
    """

    name: str
    type: str
    causality: str
    references: tuple[int, ...]
    size: int
    start: tuple[float, ...]
    minimum: float | None
    maximum: float | None
    items: tuple[int, ...]
    exact: int | None


class ForeignUnit:
    """An FMU, unpacked and its library loaded.

    Attributes:
        functions: by the name after `fmi2` and `fmi3`; `signatures`: the types of their arguments.
        step: the step that the unit suggests, in seconds.
        any_step: whether it takes steps of any size.
        has_event_mode: whether it does something in event mode.
        has_derivatives: whether it gives derivatives.
        clock: value reference of its clock, as an array of one; empty if it has none. `period` is that of its ticks.
    """

    def __init__(self, fmu: Path, fmi: int) -> None:
        self.fmi = fmi
        self._scratch = tempfile.TemporaryDirectory(prefix="faults-")
        folder = Path(self._scratch.name)
        with zipfile.ZipFile(fmu) as archive:
            archive.extractall(folder)
        root = ET.parse(folder / "modelDescription.xml").getroot()
        self.name = root.attrib["modelName"]
        self.token = root.attrib["guid" if fmi == 2 else "instantiationToken"].encode()
        resources = folder / "resources"
        self.resources = resources.as_uri().encode() if fmi == 2 else f"{resources}/".encode()
        abilities = _child(root, "CoSimulation").attrib
        self.any_step = abilities.get("canHandleVariableCommunicationStepSize") == "true"
        self.has_event_mode = abilities.get("hasEventMode") == "true"
        self.has_derivatives = abilities.get(f"providesDirectionalDerivative{'s' * (fmi == 3)}") == "true"
        self.step = float(_child(root, "DefaultExperiment").attrib["stepSize"])
        items = {
            kind.attrib["name"]: tuple(int(i.attrib["value"]) for i in kind.iter("Item"))
            for kind in _child(root, "TypeDefinitions", optional=True)
        }
        self.variables = _grouped([_variable(e, fmi, items) for e in _child(root, "ModelVariables")])
        clocks = list(_child(root, "ModelVariables").iter("Clock"))
        self.has_clocks = bool(clocks)
        self.clock = (ctypes.c_uint32 * len(clocks))(*(int(c.attrib["valueReference"]) for c in clocks))
        self.period = math.inf
        for c in clocks:
            self.period = int(c.attrib["intervalCounter"]) / int(c.attrib["resolution"])
        platform = FMI2_FOLDERS[host_platform()] if fmi == 2 else host_platform()
        suffix = library(host_platform(), fmi).suffix
        loaded = ctypes.CDLL(str(folder / "binaries" / platform / (self.name + suffix)))
        self.functions: dict[str, Callable[..., Any]] = {}
        self.signatures = signatures(fmi)
        for name, arguments in self.signatures.items():
            function = getattr(loaded, f"fmi{fmi}{name}")
            function.argtypes = arguments
            if "Instantiate" in name:
                function.restype = ctypes.c_void_p
            self.functions[name] = function

    def of(self, *causalities: str) -> list[Variable]:
        """Return the variables of these causalities, but not clocks."""
        return [v for v in self.variables if v.causality in causalities and v.type != "Clock"]

    def close(self) -> None:
        """Remove the unpacked files."""
        self._scratch.cleanup()


def _child(element: ET.Element, tag: str, *, optional: bool = False) -> ET.Element:
    found = element.find(tag)
    if found is None and not optional:
        raise LookupError(f"the model description has no {tag}")
    return ET.Element(tag) if found is None else found


def _variable(element: ET.Element, fmi: int, items: dict[str, tuple[int, ...]]) -> Variable:
    facts = {**element.attrib, **(element[0].attrib if fmi == 2 else {})}
    tag = element[0].tag if fmi == 2 else element.tag
    size = 1
    for dimension in element.iter("Dimension"):
        size *= int(dimension.attrib["start"])
    numeric = tag not in ("Boolean", "String", "Binary", "Clock")
    capacity = facts.get("maxSize")
    return Variable(
        name=facts["name"],
        type={"Enumeration": "Integer" if fmi == 2 else "Int64"}.get(tag, tag),
        causality=facts.get("causality", "local"),
        references=(int(facts["valueReference"]),),
        size=size,
        start=tuple(float(x) for x in facts.get("start", "").split()) if numeric else (),
        minimum=float(facts["min"]) if "min" in facts else None,
        maximum=float(facts["max"]) if "max" in facts else None,
        items=items[facts["declaredType"]] if tag == "Enumeration" else (),
        exact=int(capacity) if capacity and facts.get("mimeType", "").startswith("image/") else None,
    )


def _grouped(variables: list[Variable]) -> list[Variable]:
    """Put the entries of FMI 2's arrays together."""
    groups: dict[str, list[Variable]] = {}
    for v in variables:
        groups.setdefault(v.name.partition("[")[0], []).append(v)
    return [
        Variable(
            name=name,
            type=vs[0].type,
            causality=vs[0].causality,
            references=tuple(r for v in vs for r in v.references),
            size=sum(v.size for v in vs),
            start=tuple(x for v in vs for x in v.start),
            minimum=vs[0].minimum,
            maximum=vs[0].maximum,
            items=vs[0].items,
            exact=vs[0].exact,
        )
        for name, vs in groups.items()
    ]
