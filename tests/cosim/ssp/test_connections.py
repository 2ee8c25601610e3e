"""What connections of an SSP become: whole arrays or entries, converted or transformed, through systems or not."""

from collections.abc import Callable, Mapping
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest
from support.cosim import decay
from support.cosim.native_units import native_fmu
from support.cosim.ssp_of import MM, component, connection, connectors, described, pack_ssp, system
from support.forked_probes import forked_probes
from support.wording import Wording

from handover.cosim.exceptions import InvalidSsp
from handover.cosim.ssp.check_ssp import check_ssp
from handover.cosim.ssp.ssp_file import SspFile
from handover.cosim.system.conversion import LinearTransformation

VARIABLE = (
    '<ScalarVariable name="{}" valueReference="{}" causality="{}" variability="continuous"><Real {}/></ScalarVariable>'
)
NAMES = {"p[1]": "input", "p[2]": "input", "p[3]": "input", "q[1]": "output", "q[2]": "output", "q[3]": "output"}
ARRAYS = "".join(
    VARIABLE.format(name, k + 10, kind, 'start="0"' if kind == "input" else "")
    for k, (name, kind) in enumerate(NAMES.items())
)
PLAIN = connectors(u="input", y="output")
TWO = component("a", PLAIN) + component("b", PLAIN)
TABLE = '<ssc:BooleanMappingTransformation><ssc:MapEntry source="1" target="0"/></ssc:BooleanMappingTransformation>'
ENTRIES = connectors(**NAMES)

Open = Callable[..., SspFile]


@pytest.fixture
def opened(tmp_path: Path) -> Open:
    """Open an SSP of decay.c's FMU, which nothing of is loaded; `more` are further files."""
    fmu = decay.pack(
        tmp_path / "unit.fmu",
        b"",
        decay.edited(
            ("<ModelVariables>", f"<ModelVariables>{ARRAYS}"),
            ('index="3"', 'index="9"'),
            ("</Outputs>", "".join(f'<Unknown index="{n}"/>' for n in (4, 5, 6)) + "</Outputs>"),
        ),
    )

    def open_(elements: str, connections: str = "", more: str = "", version: str = "1.0") -> SspFile:
        description = described(system(elements, connections), more, version)
        with SspFile(pack_ssp(tmp_path / "a.ssp", description, {"resources/unit.fmu": fmu})) as ssp:
            return ssp

    return open_


def wires(ssp: SspFile) -> Mapping[str, LinearTransformation | None]:
    return {f"{c.source} -> {c.target}": c.transformation for c in ssp.system.connections}


def refusal(open_: Callable[..., SspFile], *arguments: Any, **more: str) -> str:
    with pytest.raises(InvalidSsp) as caught:
        open_(*arguments, **more)
    assert "\n" not in str(caught.value)
    return "; ".join(caught.value.faults)


def test_values_go_from_output_to_input_whichever_end_is_named_first(opened: Open):
    for ends in (("a.y", "b.u"), ("b.u", "a.y")):
        assert wires(opened(TWO, connection(*ends))) == {"a.y -> b.u": None}


def test_a_linear_transformation_comes_after_the_conversion_of_units(opened: Open):
    """As the schema has it: the source's value is converted before it is transformed."""
    inside = '<ssc:LinearTransformation factor="3" offset="0.5"/>'
    through = system(component("a", PLAIN), connection("a.y", "x"), name="inner", before=connectors(x="output mm"))
    elements, joined = through + component("b", PLAIN), connection("inner.x", "b.u", inside)
    assert wires(opened(elements, joined, MM)) == {"inner.a.y -> b.u": LinearTransformation(3.0, 0.5)}
    assert wires(opened(TWO, connection("a.y", "b.u", inside))) == {"a.y -> b.u": LinearTransformation(3.0, 0.5)}


def test_a_conversion_can_be_suppressed_on_each_connection(opened: Open):
    """Metres become millimetres on the way out; that these become metres again can be forbidden."""
    inner = system(component("a", PLAIN), connection("a.y", "x"), name="inner", before=connectors(x="output mm"))
    elements, kept = inner + component("b", PLAIN), 'suppressUnitConversion="true"'
    assert wires(opened(elements, connection("inner.x", "b.u"), MM)) == {"inner.a.y -> b.u": None}
    assert wires(opened(elements, connection("inner.x", "b.u", more=kept), MM)) == {
        "inner.a.y -> b.u": LinearTransformation(1000.0)
    }


def test_arrays_are_connected_as_a_whole_or_entry_by_entry(opened: Open, wording: Wording):
    scalars, entries = component("a", connectors(y="output", q="output")), component("a", ENTRIES)
    target, whole = component("b", ENTRIES), component("b", connectors(p="input"))
    each = "".join(connection(f"a.q[{k}]", f"b.p[{k}]") for k in (3, 1, 2))
    backwards = "".join(connection(f"a.q[{k}]", f"b.p[{4 - k}]") for k in (1, 2, 3))
    one = connection("a.q[2]", "c.p[1]")
    for elements, joined, wanted in (
        (entries + target, each, ["a.q -> b.p"]),
        (scalars + whole, connection("a.q", "b.p"), ["a.q -> b.p"]),
        (entries + target, backwards, [f"a.q[{k}] -> b.p[{4 - k}]" for k in (1, 2, 3)]),
        (
            entries + target + component("c", ENTRIES),  # an array that is taken apart for one is so for all
            each + one,
            [*(f"a.q[{k}] -> b.p[{k}]" for k in (3, 1, 2)), "a.q[2] -> c.p[1]"],
        ),
        (scalars + target, connection("a.y", "b.p[2]"), ["a.y -> b.p[2]"]),
    ):
        assert wires(opened(elements, joined)) == dict.fromkeys(wanted)
    b = opened(entries + target, backwards).system.units["b"].description
    assert [n for n in b.inputs if n.startswith("p")] == ["p[1]", "p[2]", "p[3]"]
    assert "q" in b.outputs
    wording.check(refusal(opened, scalars + target, connection("a.q", "b.p[1]")))


def test_systems_within_systems_are_taken_apart(opened: Open):
    """An empty element is the system itself."""
    within = connection("u", "a.u") + connection("a.y", "y")
    empty = within.replace('startConnector="u"', 'startElement="" startConnector="u"')
    empty = empty.replace('endConnector="y"', 'endElement="" endConnector="y"')
    assert empty.count('Element=""') == 2
    for ends in (within, empty):
        inner = system(component("a", PLAIN), ends, name="inner", before=PLAIN)
        around = connection("y", "inner.y") + connection("u", "inner.u")
        outer = system(inner, around, name="outer", before=PLAIN)
        ssp = opened(outer + component("b", PLAIN), connection("b.y", "outer.u") + connection("outer.y", "b.u"))
        assert list(ssp.system.units) == ["outer.inner.a", "b"]
        assert wires(ssp) == {"b.y -> outer.inner.a.u": None, "outer.inner.a.y -> b.u": None}


def test_two_elements_of_one_path_are_refused(opened: Open, wording: Wording):
    """Of two components one would be left out without a word."""
    wording.check(refusal(opened, component("a.b", PLAIN) + system(component("b", PLAIN), name="a")))


def test_a_connection_or_connector_that_does_not_fit_is_refused(opened: Open, wording: Wording):
    for connections in (
        connection("c.y", "b.u"),
        connection("a.z", "b.u"),
        connection("z", "b.u"),
        connection("a.u", "b.u"),
        connection("a.y", "b.y"),
        connection("a.y", "b.u") + connection("b.y", "b.u"),
        connection("a.y", "b.u", '<ssc:LinearTransformation factor="x"/>'),
        connection("a.y", "b.u", '<ssc:LinearTransformation factor="INF"/>'),
        connection("a.y", "b.u", TABLE),
        connection("c.y", "b.u") + "\n" + connection("a.u", "b.u"),
    ):
        wording.check(refusal(opened, TWO, connections))
    for inside in (
        connectors(z="output"),
        connectors(y="input"),
        connectors(y="output mm"),
        connectors(y="output").replace("Real", "Integer"),
        connectors(u="input") * 2,
    ):
        wording.check(refusal(opened, component("a", inside), more=MM))
    seconds = '<ssd:Units><ssc:Unit name="s"><ssc:BaseUnit s="1"/></ssc:Unit></ssd:Units>'
    inner = system(component("a", PLAIN), connection("a.y", "x"), name="inner", before=connectors(x="output s"))
    wording.check(refusal(opened, inner + component("b", PLAIN), connection("inner.x", "b.u"), seconds))
    itself = system(component("a", PLAIN), connection("u", "y") + connection("u", "a.u"), name="inner", before=PLAIN)
    wording.check(refusal(opened, itself, connection("inner.y", "inner.u")))
    indexed = connection("a.y", "b.u", more='startIndices="1"')
    wording.check(refusal(opened, TWO, indexed, version="2.0"))


def test_a_unit_that_is_not_defined_is_tolerated_with_a_line_unless_the_fmu_has_it(opened: Open, wording: Wording):
    """Of systems' connectors too, those included that nothing goes on from."""
    (line,) = opened(component("a", connectors(y="output kg"))).system.tolerated
    wording.check(line)
    assert opened(component("a", connectors(y="output m")), more=MM).system.units
    a, whole = component("a", PLAIN), connection("a.y", "y")
    assert not opened(system(a, whole, name="inner", before=connectors(y="output m"))).system.tolerated
    (line,) = opened(system(a, whole, name="inner", before=connectors(y="output bogus"))).system.tolerated
    wording.check(line)


def test_a_prefix_that_a_vendor_does_not_declare_does_not_matter(opened: Open):
    step = '<osp:Algorithm><osp:FixedStepAlgorithm baseStepSize="0.25"/></osp:Algorithm>'
    annotation = f'<ssc:Annotation type="com.opensimulationplatform">{step}</ssc:Annotation>'
    more = (
        f'<ssd:DefaultExperiment stopTime="3"><ssd:Annotations>{annotation}</ssd:Annotations></ssd:DefaultExperiment>'
    )
    ssp = opened(TWO, more=more)
    assert (ssp.stop, len(ssp.system.units)) == (3, 2)
    assert ["prefixes" in line and line.startswith("SystemStructure.ssd: ") for line in ssp.system.tolerated] == [True]


def test_what_is_not_supported_is_reported_with_what_does_not_fit(tmp_path: Path, wording: Wording):
    typed = '<ssd:Connector name="{}" kind="{}"><ssc:{}/></ssd:Connector>'.format
    truth = typed("truth", "output", "Boolean") + typed("truth_in", "input", "Boolean")
    ends = f"<ssd:Connectors>{typed('count', 'output', 'Integer')}{truth}</ssd:Connectors>"
    units = component("a", ends, "resources/passer.fmu") + component("b", connectors(u="input"), "resources/gain.fmu")
    wired = connection("a.count", "b.u") + connection("a.truth", "a.truth_in", TABLE)
    files = {
        "resources/passer.fmu": native_fmu("discrete_passer", 2),
        "resources/gain.fmu": native_fmu("gain", 2),
    }
    path = pack_ssp(tmp_path / "a.ssp", described(system(units, wired)), files)
    wording.check(refusal(SspFile, path))
    with forked_probes():
        checked = list(check_ssp(path, timeout=60.0))
    assert [len(report.sections[0].findings) for report in checked] == [2, 0, 0]  # and then each FMU by itself


def test_start_and_stop_time_are_the_default_experiment_s(opened: Open, wording: Wording):
    experiment = '<ssd:DefaultExperiment startTime="{}" stopTime="{}"/>'.format
    for start, stop, *wanted in (
        ("0", "2.5", "0", "5/2"),
        ("-1.5", "0.3333333333333333", "-3/2", "1/3"),
        ("0.3333333333333333", "1", "1/3", "1"),
    ):
        ssp = opened(TWO, more=experiment(start, stop))
        assert [str(ssp.system.start), str(ssp.stop)] == wanted
    assert opened(TWO, more=experiment("-1e308", "1e308")).stop == 1e308  # what lies between is not a double
    for start, stop in (("2", "2"), ("0", "-1")):
        wording.check(refusal(opened, TWO, more=experiment(start, stop)))


@pytest.mark.parametrize(("stop", "of_run", "taken"), [("", 3, "0.006"), (' stopTime="7"', 3, "0.01")])
def test_an_fmu_that_proposes_no_step_takes_a_500th(tmp_path: Path, stop: str, of_run: int, taken: str):
    """Of its own default experiment, or else of the run."""
    fmu = decay.pack(tmp_path / "unit.fmu", b"", decay.edited((' stopTime="1" stepSize="0.1"', stop)))
    file = pack_ssp(tmp_path / "a.ssp", described(system(component("a"))), {"resources/unit.fmu": fmu})
    if not stop:
        assert "a: its FMU proposes no communication step; give one" in refusal(SspFile, file)
    with SspFile(file, stop=Fraction(of_run)) as ssp:
        assert ssp.system.units["a"].period == Fraction(taken)
        assert [f"{taken} s is taken" in line for line in ssp.system.tolerated] == [True]
    with SspFile(file, Fraction(1, 30)) as ssp:
        assert ssp.system.units["a"].period == Fraction(1, 30)
        assert not ssp.system.tolerated


OMS = '<o:A xmlns:o="urn:o"><o:Information><o:FixedStepMaster stepSize="0.020000"/></o:Information></o:A>'
OSP = '<p:Algorithm xmlns:p="urn:p"><p:FixedStepAlgorithm baseStepSize="0.02"/></p:Algorithm>'


def annotated(kind: str, inside: str) -> str:
    return f'<ssd:Annotations><ssc:Annotation type="{kind}">{inside}</ssc:Annotation></ssd:Annotations>'


def stating(tool: str, units: str) -> str:
    """Return a description whose system states a step of 0.02 s as a tool writes it."""
    whole, osp = system(units), annotated("com.opensimulationplatform", OSP)
    return {
        "OMSimulator": described(whole.replace("</ssd:System>", annotated("org.openmodelica", OMS) + "</ssd:System>")),
        "libcosim": described(whole, f"<ssd:DefaultExperiment>{osp}</ssd:DefaultExperiment>"),
        "SSP 2.0": described(whole, '<ssd:DefaultExperiment stepSize="0.02"/>', version="2.0"),
    }[tool]


def hinted(name: str, seconds: str) -> str:
    hint = f'<p:StepSizeHint xmlns:p="urn:p" value="{seconds}"/>'
    return component(name, annotated("com.opensimulationplatform", hint))


@pytest.mark.parametrize("tool", ["OMSimulator", "libcosim", "SSP 2.0"])
def test_the_step_of_a_system_comes_before_those_that_fmus_propose(tmp_path: Path, tool: str):
    fmu = decay.pack(tmp_path / "unit.fmu", b"")  # proposes 0.1 s
    file = pack_ssp(tmp_path / "a.ssp", stating(tool, component("a")), {"resources/unit.fmu": fmu})
    with SspFile(file) as ssp:
        assert ssp.system.units["a"].period == Fraction(1, 50)
        assert ssp.system.notes == ["the system's step of 0.02 s is taken, not what FMUs propose: a 0.1 s"]
    with SspFile(file, Fraction(1, 4)) as ssp:
        assert ssp.system.units["a"].period == Fraction(1, 4)
        assert ssp.system.notes == ["all units step by 0.25 s, as asked; the system states 0.02 s"]


def test_a_component_s_hint_is_rounded_down_to_steps_of_the_system_as_libcosim_does(tmp_path: Path):
    fmu = decay.pack(tmp_path / "unit.fmu", b"")
    hints = {"a": "0.06", "b": "0.05", "c": "0.001", "d": "0"}
    units = "".join(hinted(name, seconds) for name, seconds in hints.items())
    file = pack_ssp(tmp_path / "a.ssp", stating("libcosim", units), {"resources/unit.fmu": fmu})
    with SspFile(file) as ssp:
        taken = {name: float(unit.period) for name, unit in ssp.system.units.items()}
    assert taken == {"a": 0.06, "b": 0.04, "c": 0.02, "d": 0.02}
    alone = pack_ssp(tmp_path / "b.ssp", described(system(hinted("a", "0.06"))), {"resources/unit.fmu": fmu})
    with SspFile(alone) as ssp:
        assert ssp.system.units["a"].period == Fraction("0.06")


def test_an_annotated_step_is_a_fraction(opened: Open, wording: Wording):
    for period in ("0", "-1/30", "1e999999999", "1/0", "", "0.1"):
        step = f'<Step xmlns="urn:handover:communication" period="{period}" sampled="true"/>'
        wording.check(refusal(opened, component("a", annotated("handover.communication", step))))
