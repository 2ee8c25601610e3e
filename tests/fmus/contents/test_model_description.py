"""The model descriptions against the standards' rules: structure, starts, bounds, units, enumerations, texts."""

import dataclasses
import enum
import xml.etree.ElementTree as ET
import zipfile
from fractions import Fraction
from pathlib import Path
from typing import Annotated, Any

import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu
from support.fmus.workshop import Workshop
from support.sample_units import declarations

from handover.cosim.blocks.description import Description, describe
from handover.cosim.blocks.ports import parameter
from handover.cosim.blocks.units import Number
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
def test_it_is_valid_and_its_first_line_says_the_encoding(workshop: Workshop, fmi: int, block: str):
    fmu = workshop.fmu(block, fmi)
    assert validate_fmu(str(fmu)) == []
    with zipfile.ZipFile(fmu) as archive:
        assert archive.read("modelDescription.xml").startswith(b"<?xml version='1.0' encoding='utf-8'?>\n")


@pytest.mark.parametrize(("fmi", "block"), FORMS)
def test_causality_decides_variability_initial_and_start(workshop: Workshop, fmi: int, block: str):
    root = root_of(workshop.fmu(block, fmi))
    with_start_element = {v.attrib["name"] for v in root.iter() if v.find("Start") is not None}
    for name, v in variables_of(root).items():
        has_start = "start" in v or name in with_start_element
        if v["causality"] == "parameter":
            assert (v["variability"], v["initial"], has_start) == ("fixed", "exact", True), name
        elif v["causality"] == "input":
            assert ("initial" in v, has_start) == (False, True), name
        elif v["causality"] == "output":
            assert (v["initial"], has_start) == ("calculated", False), name
        else:
            assert (name, v["causality"], v["variability"], has_start) == ("time", "independent", "continuous", False)


@pytest.mark.parametrize(("fmi", "block"), FORMS)
def test_only_real_variables_are_continuous_and_no_output_of_a_sampled_block(workshop: Workshop, fmi: int, block: str):
    v = variables_of(root_of(workshop.fmu(block, fmi)))
    way = "way[2]" if fmi == 2 else "way"
    assert v["heading"]["variability"] == "continuous"
    assert v["count"]["variability"] == v["gear_out"]["variability"] == v["told"]["variability"] == "discrete"
    assert v[way]["variability"] == ("continuous" if block == ALL else "discrete")


def test_fmi_2_lists_outputs_and_initial_unknowns_by_index(workshop: Workshop):
    root = root_of(workshop.fmu(WITHOUT_DATA, 2))
    index = {name: i + 1 for i, name in enumerate(variables_of(root))}
    inputs = [index["heading"], index["heat"]]
    parameters = [i for name, i in index.items() if name.startswith(("gear", "label", "wide", "free", "empty"))]
    parameters.remove(index["gear_out"])
    outputs = [index[name] for name in ("way[1]", "way[2]", "gear_out", "told")]
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
    outputs = ["way", "x", "gear_out", "data_out", "told", "on"]
    for listed in (now, first):
        assert [int(u.attrib["valueReference"]) for u in listed] == [reference[name] for name in outputs]
    assert [numbers(u) for u in now] == [feeding.get(name, []) for name in outputs]
    assert [numbers(u) for u in first] == [[*parameters, *feeding.get(name, [])] for name in outputs]


def numbers(unknown: ET.Element) -> list[int]:
    return [int(n) for n in unknown.attrib["dependencies"].split()]


@pytest.mark.parametrize(("fmi", "block"), FORMS)
def test_bounds_are_reported_where_they_bind(workshop: Workshop, fmi: int, block: str):
    v = variables_of(root_of(workshop.fmu(block, fmi)))

    def bounds(name: str) -> tuple[str | None, str | None]:
        return v[name].get("min"), v[name].get("max")

    assert bounds("gear") == ("-2", "5")
    assert bounds("gear_out") == (None, "5")
    assert bounds("heading") == ("-180.0", "180.0")
    assert bounds("count") == ("-5", None)
    assert bounds("free") == bounds("heat") == (None, None)
    for name in ("wide[1]", "wide[2]") if fmi == 2 else ("wide",):
        assert bounds(name) == ("0.0", "0.5")


@pytest.mark.parametrize(("fmi", "block"), FORMS)
def test_units_have_factor_and_offset_to_the_base_units(workshop: Workshop, fmi: int, block: str):
    fmu = workshop.fmu(block, fmi)
    units = {u.attrib["name"]: u[0].attrib for u in root_of(fmu).findall("UnitDefinitions/Unit")}
    assert units["km"] == {"m": "1", "factor": "1000.0"}
    assert float(units["deg"]["factor"]) == np.pi / 180
    heat = units["°F"]
    assert 50.0 * float(heat["factor"]) + float(heat["offset"]) == pytest.approx(283.15)
    assert units["1"] == {}
    ports = describe_fmu(fmu)
    assert ports.inputs["heat"].unit == describe(declarations.Declarations).inputs[1].unit
    assert ports.outputs["way"].unit.factor == 1000.0
    assert "quantity" not in ET.tostring(root_of(fmu), encoding="unicode")


@pytest.mark.parametrize(("fmi", "block"), FORMS)
def test_starts_are_read_back_to_the_last_bit(workshop: Workshop, fmi: int, block: str):
    fmu = workshop.fmu(block, fmi)
    ports = describe_fmu(fmu)
    v = variables_of(root_of(fmu))
    assert [float(x) for x in str(ports.parameters["wide"].start).split()] == [0.1, 1e-300]
    assert float(v["free"]["start"]) == 1 / 3
    assert v["gear"]["start"] == "5"
    assert v["count"]["start"] == "-3"


@pytest.mark.parametrize(("fmi", "block"), FORMS)
def test_enumerations_keep_their_gaps_and_negative_items(workshop: Workshop, fmi: int, block: str):
    root = root_of(workshop.fmu(block, fmi))
    items = [(i.attrib["name"], int(i.attrib["value"])) for i in root.iter("Item")]
    assert items == [("REVERSE", -4), ("IDLE", 1), ("FIRST", 5), ("SECOND", 11)]
    assert variables_of(root)["gear_out"]["declaredType"] == "Gear"
    assert describe_fmu(workshop.fmu(block, fmi)).outputs["gear_out"].items == tuple(items)


@pytest.mark.parametrize(("fmi", "block"), FORMS)
def test_texts_survive_whatever_they_hold(workshop: Workshop, fmi: int, block: str):
    fmu = workshop.fmu(block, fmi)
    read = {v.name: v for v in fmpy.read_model_description(str(fmu)).modelVariables}
    assert read["gear"].description == 'a "gear" <of> 5 & more, größer – 100 %\nsecond line'
    label = " a<b & \"c\"\n\t'd' größer "
    if fmi == 2:
        assert (read["label"].start, read["empty"].start) == (label, "")
    else:
        starts = {
            v.attrib["name"]: [s.attrib["value"] for s in v.findall("Start")] for v in root_of(fmu).iter("String")
        }
        assert starts == {"label": [label], "empty": [""], "told": []}


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


def test_what_an_fmu_could_not_tell_apart_is_refused():
    other = enum.IntEnum("Gear", {"PARK": 0})  # type: ignore
    with pytest.raises(AmbiguousName, match="enumeration 'Gear'"):
        fmi3_description(model_of(gear=(other, parameter(other(0), "another Gear"))))
    with pytest.raises(AmbiguousName, match="enumeration 'Gear'"):
        fmi2_description(model_of(Gear=(Number, parameter(0.0, "named as the type of gear_out"))))
    mile = dataclasses.replace(describe(declarations.Declarations).outputs[0].unit, factor=1609.0)
    with pytest.raises(AmbiguousName, match="unit 'km'"):
        fmi3_description(model_of(far=(Annotated[float, mile], parameter(0.0, "in another km"))))
    with pytest.raises(DuplicateName, match="time"):
        model_of(time=(Number, parameter(0.0, "as the independent variable")))


@pytest.mark.parametrize("describe_in_xml", [fmi2_description, fmi3_description])
def test_a_text_that_xml_cannot_carry_is_refused(describe_in_xml: Any):
    with pytest.raises(InvalidText, match=r"description of bell: 'rings \\x07' has control characters"):
        describe_in_xml(model_of(bell=(Number, parameter(0.0, "rings \x07"))))
