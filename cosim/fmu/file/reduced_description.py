"""A model description reduced to what co-simulation reads: faults elsewhere in it do not keep a unit from running.

A description that breaks the standard is read once more in this form. What is left of it is judged by the same rules:
if they hold, the faults are in parts that no call of a co-simulation depends on, such as local variables, the states'
derivatives, display units or model exchange.
"""

import importlib
import io
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from handover.cosim.fmu.file.archive import DESCRIPTION
from handover.cosim.fmu.file.default_experiment import is_finite
from handover.cosim.fmu.file.xml import with_prefixes

_etree: Any = importlib.import_module("lxml.etree")  # neither it nor its classes have types

_PARTS = ("CoSimulation", "UnitDefinitions", "TypeDefinitions", "DefaultExperiment", "ModelVariables", "ModelStructure")
"""The elements that are kept, in the order of both standards' schemas."""

_ROOT = ("fmiVersion", "modelName", "guid", "instantiationToken")
_UNUSED = ("local", "calculatedParameter", "independent")
"""Causalities of variables that are neither set nor got."""

_PLACEHOLDERS = {"Integer": "Integer", "Enumeration": "Integer", "Boolean": "Boolean", "String": "String"}
"""FMI 2's types of variables that hold their places only, by the types of those that they stand for; else reals."""

_REALS = ("Real", "Float32", "Float64")
_VARIED = ("input", "output")
"""Causalities of variables that may change during a run."""


def reduced_fmu(description: bytes) -> io.BytesIO:
    """Return an archive that holds nothing but the reduced form of a safe, well-formed model description.

    Raises:
        ValueError: an attribute that must be a number is not one.
    """
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w") as z:
        z.writestr(DESCRIPTION, _etree.tostring(_reduced(_etree.fromstring(with_prefixes(description)))))
    archive.seek(0)
    return archive


def _reduced(root: Any) -> Any:
    made = _etree.Element(root.tag, {k: root.get(k) for k in _ROOT if root.get(k) is not None})
    if root.find("UnitDefinitions") is None:
        root.insert(0, _etree.Element("UnitDefinitions"))
    reduce = {
        "CoSimulation": _without_children,
        "UnitDefinitions": _units,
        "DefaultExperiment": _experiment,
        "ModelVariables": _variables_of_2 if root.get("fmiVersion") == "2.0" else _variables_of_3,
        "ModelStructure": _structure,
    }
    for part in _PARTS:
        for element in root.findall(part):
            made.append(reduce.get(part, _as_it_is)(element))
    _name_undefined_units(made)
    return made


def _name_undefined_units(made: Any) -> None:
    """Name the units that are used and not defined, without saying what they are; leave out an empty list of units."""
    (definitions,) = made.findall("UnitDefinitions")
    defined = {unit.get("name") for unit in _elements(definitions)}
    used = {e.get("unit") for part in ("TypeDefinitions", "ModelVariables") for e in made.iterfind(f"{part}//*[@unit]")}
    for name in sorted(used - defined):
        _etree.SubElement(definitions, "Unit", name=name)
    if not len(definitions):
        made.remove(definitions)


def _elements(parent: Any) -> Iterator[Any]:
    """Yield the children that are elements, without comments."""
    return (child for child in parent if isinstance(child.tag, str))


def _copy(element: Any, without: tuple[str, ...] = ()) -> Any:
    return _etree.Element(element.tag, {k: v for k, v in element.attrib.items() if k not in without})


def _as_it_is(element: Any) -> Any:
    return _etree.fromstring(_etree.tostring(element, with_tail=False))


def _without_children(element: Any) -> Any:
    return _copy(element)


def _units(element: Any) -> Any:
    made = _as_it_is(element)
    for unit in _elements(made):
        for child in list(_elements(unit)):
            if child.tag != "BaseUnit":
                unit.remove(child)
    return made


def _experiment(element: Any) -> Any:
    made = _copy(element)
    for name, text in element.attrib.items():
        if not is_finite(text):
            del made.attrib[name]
    return made


def _variables_of_2(element: Any) -> Any:
    """Keep what can be set or got; any other variable holds its place, as variables are referred to by it.

    It keeps its type, too: a value reference identifies a value within a type.
    """
    made = _copy(element)
    for i, variable in enumerate(_elements(element)):
        if variable.get("causality", "local") in _UNUSED:
            kind = next((_PLACEHOLDERS[v.tag] for v in _elements(variable) if v.tag in _PLACEHOLDERS), "Real")
            attributes = {"name": f"{i + 1} unused", "valueReference": variable.get("valueReference", "0")}
            made.append(_etree.Element("ScalarVariable", attributes, variability="discrete"))
            _etree.SubElement(made[-1], kind)
            continue
        kept = _copy(variable, without=("previous", "canHandleMultipleSetPerTimeInstant"))
        values = [_copy(v, without=("derivative", "displayUnit", "reinit")) for v in _elements(variable)]
        kept.extend(v for v in values if v.tag not in ("Annotations", "VendorAnnotations"))
        _without_rules_for_others(kept, values)
        made.append(kept)
    return made


def _variables_of_3(element: Any) -> Any:
    """Keep what can be set or got, clocks, and what sizes arrays; the independent variable stands for all others."""
    made = _copy(element)
    sizes = {d.get("valueReference") for d in element.iter("Dimension")}
    taken = {v.get("valueReference") for v in _elements(element)}
    for variable in _elements(element):
        if _is_used(variable) or variable.get("valueReference") in sizes:
            kept = _copy(variable, without=("derivative", "displayUnit", "reinit", "previous"))
            if variable.tag == "String" and "start" in kept.attrib:  # as in FMI 2
                _etree.SubElement(kept, "Start", value=kept.attrib.pop("start"))
            kept.extend(_copy(c, without=("displayUnit",)) for c in _elements(variable) if c.tag != "Annotations")
            _without_rules_for_others(kept, [kept])
            made.append(kept)
    free = next(str(i) for i in range(len(taken) + 1) if str(i) not in taken)
    time = {"name": "unused time", "valueReference": free, "causality": "independent", "variability": "continuous"}
    made.append(_etree.Element("Float64", time))
    return made


def _is_used(variable: Any) -> bool:
    return variable.tag == "Clock" or variable.get("causality", "local") not in _UNUSED


def _without_rules_for_others(variable: Any, values: Sequence[Any]) -> None:
    """Leave out what a variable says of when it has which value, where co-simulation goes by its causality alone.

    Parameters are set once, before the start, and outputs are read. A variable that is said to vary continuously, but
    is not a real, changes at events. `values` are the elements that hold the values' attributes.
    """
    causality = variable.get("causality")
    variable.attrib.pop("initial", None)
    if causality == "parameter" and variable.get("variability") not in ("fixed", "tunable"):
        variable.set("variability", "fixed")
    if causality == "output" and variable.get("variability") != "constant":
        for element in values:
            element.attrib.pop("start", None)
    varies = variable.get("variability", "continuous" if variable.tag == "ScalarVariable" else "")
    if varies == "continuous" and causality in _VARIED and not {v.tag for v in values} & set(_REALS):
        variable.set("variability", "discrete")


def _structure(element: Any) -> Any:
    """Keep what outputs depend on, also at the start; what else is listed is for model exchange."""
    variables = [v for group in element.getparent().findall("ModelVariables") for v in _elements(group)]
    outputs = {i for i, v in enumerate(variables, 1) if v.get("causality") == "output"}
    by_reference = {v.get("valueReference"): v for v in variables}
    made = _copy(element)
    for group in _elements(element):
        if group.tag in ("Outputs", "InitialUnknowns"):
            made.append(_copy(group))
            unknowns = [u for u in _elements(group) if group.tag == "Outputs" or int(u.get("index", "0")) in outputs]
            made[-1].extend(_copy(u, without=("dependenciesKind",)) for u in unknowns)
            if not unknowns:
                made.remove(made[-1])
        elif group.tag in ("Output", "InitialUnknown"):
            known = by_reference.get(group.get("valueReference"))
            if group.tag == "Output" or (known is not None and known.get("causality") == "output"):
                made.append(_copy(group, without=("dependenciesKind",)))
                _leave_out_unused(made[-1], by_reference)
    return made


def _leave_out_unused(unknown: Any, by_reference: Mapping[str, Any]) -> None:
    """Leave out dependencies on variables that are not kept; what refers to none at all stays, and is a fault."""
    if "dependencies" not in unknown.attrib:
        return
    given = unknown.get("dependencies").split()
    kept = [r for r in given if (v := by_reference.get(r)) is None or _is_used(v)]
    unknown.set("dependencies", " ".join(kept))
