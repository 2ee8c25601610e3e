"""The model descriptions against the standards' rules: structure, starts, bounds, units, enumerations, texts."""

import dataclasses
import enum
import xml.etree.ElementTree as ET
import zipfile
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pytest
from fmpy.validation import validate_fmu
from support.fmus.workshop import Workshop
from support.sample_units import declarations
from support.wording import Wording

from handover.cosim.blocks.description import Description, describe
from handover.cosim.blocks.ports import parameter
from handover.cosim.blocks.units import Number
from handover.cosim.blocks.variable import Kind
from handover.cosim.fmu.file.default_experiment import default_experiment
from handover.cosim.fmu.file.description import describe_fmu
from handover.cosim.fmu.file.xml import parse_xml
from handover.fmus.contents.fmi2_description import fmi2_description
from handover.fmus.contents.fmi3_description import fmi3_description
from handover.fmus.contents.model_description import AmbiguousName, InvalidText, Model
from handover.fmus.layout import DuplicateName, Form, Layout

ALL, WITHOUT_DATA = "declarations:Declarations", "declarations:WithoutData"

FORMS = [(2, WITHOUT_DATA), (3, WITHOUT_DATA), (3, ALL)]


def root_of(fmu: Path) -> ET.Element:
    with zipfile.ZipFile(fmu) as archive:
        return ET.fromstring(archive.read("modelDescription.xml"))


def variables_of(root: ET.Element) -> dict[str, dict[str, str]]:
    """Attributes by name of all variables but clocks, in FMI 2 those of the type among them."""
    listed = root.find("ModelVariables")
    assert listed is not None
    valued = [v for v in listed if v.tag != "Clock"]
    return {v.attrib["name"]: {**v.attrib, **(v[0].attrib if v.tag == "ScalarVariable" else {})} for v in valued}


@pytest.mark.parametrize(("fmi", "block"), FORMS)
def test_it_is_valid_and_causality_decides_variability_initial_and_start(workshop: Workshop, fmi: int, block: str):
    fmu = workshop.fmu(block, fmi)
    assert validate_fmu(str(fmu)) == []
    with zipfile.ZipFile(fmu) as archive:
        assert archive.read("modelDescription.xml").startswith(b"<?xml version='1.0' encoding='utf-8'?>\n")
    root, way = root_of(fmu), "way[2]" if fmi == 2 else "way"
    variables = variables_of(root)
    with_start_element = {v.attrib["name"] for v in root.iter() if v.find("Start") is not None}
    for name, v in variables.items():
        has_start = "start" in v or name in with_start_element
        if v["causality"] == "parameter":
            assert (v["variability"], v["initial"], has_start) == ("fixed", "exact", True), name
        elif v["causality"] == "input":
            assert ("initial" in v, has_start) == (False, True), name
        elif v["causality"] == "output":
            assert (v["initial"], has_start) == ("calculated", False), name
        else:
            assert (name, v["causality"], v["variability"], has_start) == ("time", "independent", "continuous", False)
    found = [variables[name]["variability"] for name in ("heading", "count", "gear_out", "reported", way)]
    assert found == ["continuous", *["discrete"] * 3, "continuous" if block == ALL else "discrete"]


@pytest.mark.parametrize(("fmi", "block"), FORMS)
def test_it_is_read_back_as_declared(workshop: Workshop, fmi: int, block: str):
    fmu = workshop.fmu(block, fmi)
    declared, read, root = describe(getattr(declarations, block.partition(":")[2])), describe_fmu(fmu), root_of(fmu)
    for side in ("parameters", "inputs", "outputs"):
        ports = getattr(read, side)
        assert list(ports) == [v.name for v in getattr(declared, side)]
        for v in getattr(declared, side):
            for aspect in ("kind", "causality", "description", "shape", "items", *["unit"] * (v.kind is Kind.REAL)):
                assert getattr(ports[v.name], aspect) == getattr(v, aspect), (v.name, aspect)
            for bound in (v.minimum, v.maximum), (ports[v.name].minimum, ports[v.name].maximum):
                assert [b for b in bound if b is not None and np.isfinite(b)] == BOUNDS.get(v.name, [])
    starts = {name: port.start for name, port in {**read.parameters, **read.inputs}.items()}
    assert [float(x) for x in str(starts["wide"]).split()] == [0.1, 1e-300]
    assert (float(starts["free"] or 0), starts["gear"], starts["count"]) == (1 / 3, "5", "-3")
    assert (starts["label"], starts["empty"]) == (declared.parameters[1].start, "")
    units = {u.attrib["name"]: u[0].attrib for u in root.findall("UnitDefinitions/Unit")}
    assert units["km"] == {"m": "1", "factor": "1000.0"}
    assert float(units["deg"]["factor"]) == np.pi / 180
    assert 50.0 * float(units["°F"]["factor"]) + float(units["°F"]["offset"]) == pytest.approx(283.15)
    assert units["1"] == {}
    items = [(i.attrib["name"], int(i.attrib["value"])) for i in root.iter("Item")]
    assert items == [("REVERSE", -4), ("IDLE", 1), ("FIRST", 5), ("SECOND", 11)]


BOUNDS: dict[str, list[float]] = {
    "gear": [-2, 5],
    "gear_out": [5],
    "heading": [-180.0, 180.0],
    "count": [-5],
    "wide": [0.0, 0.5],
    "way": [-1.0],
}
"""Of the variables whose bounds bind."""


def test_fmi_2_lists_outputs_and_initial_unknowns_by_index(workshop: Workshop):
    root = root_of(workshop.fmu(WITHOUT_DATA, 2))
    index = {name: i + 1 for i, name in enumerate(variables_of(root))}
    inputs = [index["heading"], index["heat"]]
    parameters = [i for name, i in index.items() if name.startswith(("gear", "label", "wide", "free", "empty"))]
    parameters.remove(index["gear_out"])
    outputs = [index[name] for name in ("way[1]", "way[2]", "gear_out", "reported")]
    now = root.findall("ModelStructure/Outputs/Unknown")
    first = root.findall("ModelStructure/InitialUnknowns/Unknown")
    assert [int(u.attrib["index"]) for u in now] == [int(u.attrib["index"]) for u in first] == outputs
    assert [numbers(u) for u in now] == [inputs, inputs, [], []]
    assert [numbers(u) for u in first] == [[*parameters, *inputs]] * 2 + [parameters] * 2


def test_fmi_3_lists_outputs_and_initial_unknowns_by_value_reference(workshop: Workshop):
    root = root_of(workshop.fmu(ALL, 3))
    reference = {name: int(v["valueReference"]) for name, v in variables_of(root).items()}
    parameters = [reference[name] for name in ("gear", "label", "wide", "free", "empty")]
    feeding = {"way": [reference["heading"], reference["heat"]], "data_out": [reference["data"]]}
    now, first = root.findall("ModelStructure/Output"), root.findall("ModelStructure/InitialUnknown")
    outputs = ["way", "x", "gear_out", "data_out", "reported", "on"]
    for listed in (now, first):
        assert [int(u.attrib["valueReference"]) for u in listed] == [reference[name] for name in outputs]
    assert [numbers(u) for u in now] == [feeding.get(name, []) for name in outputs]
    assert [numbers(u) for u in first] == [[*parameters, *feeding.get(name, [])] for name in outputs]


def numbers(unknown: ET.Element) -> list[int]:
    return [int(n) for n in unknown.attrib["dependencies"].split()]


def test_bytes_tell_their_type_and_greatest_size(workshop: Workshop):
    root = root_of(workshop.fmu(ALL, 3))
    found = {v.attrib["name"]: v for v in root.iter("Binary")}
    assert {name: (v.attrib["mimeType"], v.attrib["maxSize"]) for name, v in found.items()} == dict.fromkeys(
        ("data", "data_out"), ("application/octet-stream", "65536")
    )
    assert [s.attrib for s in found["data"].findall("Start")] == [{"value": ""}]
    assert found["data_out"].findall("Start") == []
    eye = {v.attrib["name"]: v.attrib for v in root_of(workshop.fmu("eye:Eye", 3)).iter("Binary")}
    assert eye["picture"]["mimeType"] == "image/x-raw-bgr; width=1280; height=720"
    assert eye["picture"]["maxSize"] == str(1280 * 720 * 3)


def model_of(**parameters: tuple[Any, Any]) -> Model:
    """A model of EveryKind's kind, with other parameters: type and declaration by name."""
    fields = [(name, hint, field) for name, (hint, field) in parameters.items()]
    params = dataclasses.make_dataclass("Params", fields, frozen=True, kw_only=True)

    class Odd(declarations.WithoutData):
        def __init__(self, params: Any) -> None: ...

    Odd.__init__.__annotations__["params"] = params
    description: Description = describe(Odd)
    return Model(
        name="Odd",
        summary="",
        step=Fraction(1),
        token="",
        description=description,
        layout=Layout(description),
        form=Form.FMI3,
        variable_step=True,
    )


@pytest.mark.parametrize(
    ("step", "stop"), [("0.015", 1.005), ("1.4", 1.4), ("1/30", 1.0), ("0.001", 1.0), ("1e-5", 0.01)]
)
def test_a_default_experiment_is_of_whole_steps(step: str, stop: float):
    stepped = dataclasses.replace(model_of(), step=Fraction(step))
    for described in (fmi2_description(stepped), fmi3_description(stepped)):
        assert default_experiment(parse_xml(described)).stop == stop


def test_what_an_fmu_could_not_tell_apart_or_xml_not_carry_is_refused(wording: Wording):
    other = enum.IntEnum("Gear", {"PARK": 0})  # type: ignore
    mile = dataclasses.replace(describe(declarations.Declarations).outputs[0].unit, factor=1609.0)
    refused: list[tuple[type[Exception], Callable[[Model], bytes], dict[str, tuple[Any, Any]]]] = [
        (AmbiguousName, fmi3_description, {"gear": (other, parameter(other(0), "another Gear"))}),
        (AmbiguousName, fmi2_description, {"Gear": (Number, parameter(0.0, "named as the type of gear_out"))}),
        (AmbiguousName, fmi3_description, {"far": (Annotated[float, mile], parameter(0.0, "in another km"))}),
        (DuplicateName, fmi3_description, {"time": (Number, parameter(0.0, "as the independent variable"))}),
        (InvalidText, fmi2_description, {"bell": (Number, parameter(0.0, "rings \x07"))}),
        (InvalidText, fmi3_description, {"bell": (Number, parameter(0.0, "rings \x07"))}),
    ]
    for error, describe_in_xml, parameters in refused:
        with pytest.raises(error) as caught:
            describe_in_xml(model_of(**parameters))
        wording.check(caught.value)
