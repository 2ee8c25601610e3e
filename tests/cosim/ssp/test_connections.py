"""What connections of an SSP become: whole arrays or entries, converted or transformed, through systems or not."""

from collections.abc import Callable, Mapping
from fractions import Fraction
from pathlib import Path

import pytest
from support.cosim import decay
from support.cosim.native_units import native_fmu
from support.cosim.ssp_of import MM, component, connection, connectors, described, pack_ssp, system
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


def refusal(open_: Callable[[], SspFile]) -> str:
    with pytest.raises(InvalidSsp) as caught:
        open_()
    assert "\n" not in str(caught.value)
    return "; ".join(caught.value.faults)


@pytest.mark.parametrize(("start", "end"), [("a.y", "b.u"), ("b.u", "a.y")])
def test_values_go_from_output_to_input_whichever_end_is_named_first(opened: Open, start: str, end: str):
    found = wires(opened(component("a", PLAIN) + component("b", PLAIN), connection(start, end)))
    assert found == {"a.y -> b.u": None}


def test_a_linear_transformation_comes_after_the_conversion_of_units(opened: Open):
    """As the schema has it: the source's value is converted before it is transformed."""
    inside = '<ssc:LinearTransformation factor="3" offset="0.5"/>'
    through = system(component("a", PLAIN), connection("a.y", "x"), name="inner", before=connectors(x="output mm"))
    elements, joined = through + component("b", PLAIN), connection("inner.x", "b.u", inside)
    assert wires(opened(elements, joined, MM)) == {"inner.a.y -> b.u": LinearTransformation(3.0, 0.5)}
    elements = component("a", PLAIN) + component("b", PLAIN)
    assert wires(opened(elements, connection("a.y", "b.u", inside))) == {"a.y -> b.u": LinearTransformation(3.0, 0.5)}


def test_a_conversion_can_be_suppressed_on_each_connection(opened: Open):
    """Metres become millimetres on the way out; that these become metres again can be forbidden."""
    inner = system(component("a", PLAIN), connection("a.y", "x"), name="inner", before=connectors(x="output mm"))
    elements, kept = inner + component("b", PLAIN), 'suppressUnitConversion="true"'
    assert wires(opened(elements, connection("inner.x", "b.u"), MM)) == {"inner.a.y -> b.u": None}
    assert wires(opened(elements, connection("inner.x", "b.u", more=kept), MM)) == {
        "inner.a.y -> b.u": LinearTransformation(1000.0)
    }


def test_entries_that_make_up_a_whole_are_connected_as_a_whole(opened: Open):
    elements = component("a", ENTRIES) + component("b", ENTRIES)
    each = "".join(connection(f"a.q[{k}]", f"b.p[{k}]") for k in (3, 1, 2))
    assert wires(opened(elements, each)) == {"a.q -> b.p": None}


def test_an_array_of_scalars_can_be_named_as_a_whole(opened: Open):
    elements = component("a", connectors(q="output")) + component("b", connectors(p="input"))
    assert wires(opened(elements, connection("a.q", "b.p"))) == {"a.q -> b.p": None}
    entry = component("a", connectors(q="output")) + component("b", ENTRIES)
    assert "a whole array and a single entry" in refusal(lambda: opened(entry, connection("a.q", "b.p[1]")))


def test_entries_in_another_order_are_connected_one_by_one(opened: Open):
    elements = component("a", ENTRIES) + component("b", ENTRIES)
    each = "".join(connection(f"a.q[{k}]", f"b.p[{4 - k}]") for k in (1, 2, 3))
    ssp = opened(elements, each)
    assert wires(ssp) == {f"a.q[{k}] -> b.p[{4 - k}]": None for k in (1, 2, 3)}
    assert [n for n in ssp.system.units["b"].description.inputs if n.startswith("p")] == ["p[1]", "p[2]", "p[3]"]
    assert "q" in ssp.system.units["b"].description.outputs


def test_an_array_that_is_taken_apart_for_one_is_so_for_all(opened: Open):
    elements = component("a", ENTRIES) + component("b", ENTRIES) + component("c", ENTRIES)
    whole = "".join(connection(f"a.q[{k}]", f"b.p[{k}]") for k in (1, 2, 3))
    found = wires(opened(elements, whole + connection("a.q[2]", "c.p[1]")))
    assert found == {**{f"a.q[{k}] -> b.p[{k}]": None for k in (1, 2, 3)}, "a.q[2] -> c.p[1]": None}


def test_an_entry_and_a_scalar_can_be_connected(opened: Open):
    elements = component("a", connectors(y="output")) + component("b", ENTRIES)
    assert wires(opened(elements, connection("a.y", "b.p[2]"))) == {"a.y -> b.p[2]": None}


def test_systems_within_systems_are_taken_apart(opened: Open):
    inner = system(component("a", PLAIN), connection("u", "a.u") + connection("a.y", "y"), name="inner", before=PLAIN)
    outer = system(inner, connection("y", "inner.y") + connection("u", "inner.u"), name="outer", before=PLAIN)
    ssp = opened(outer + component("b", PLAIN), connection("b.y", "outer.u") + connection("outer.y", "b.u"))
    assert list(ssp.system.units) == ["outer.inner.a", "b"]
    assert wires(ssp) == {"b.y -> outer.inner.a.u": None, "outer.inner.a.y -> b.u": None}


def test_an_empty_element_is_the_system_itself(opened: Open):
    ends = connection("u", "a.u") + connection("a.y", "y")
    empty = ends.replace('startConnector="u"', 'startElement="" startConnector="u"')
    empty = empty.replace('endConnector="y"', 'endElement="" endConnector="y"')
    assert empty.count('Element=""') == 2
    found = [
        wires(opened(system(component("a", PLAIN), each, name="inner", before=PLAIN) + component("b", PLAIN), outside))
        for each in (ends, empty)
        for outside in [connection("b.y", "inner.u") + connection("inner.y", "b.u")]
    ]
    assert found[0] == found[1] == {"b.y -> inner.a.u": None, "inner.a.y -> b.u": None}


TABLE = '<ssc:BooleanMappingTransformation><ssc:MapEntry source="1" target="0"/></ssc:BooleanMappingTransformation>'
TWO = component("a", PLAIN) + component("b", PLAIN)


@pytest.mark.parametrize(
    "connections",
    [
        connection("c.y", "b.u"),
        connection("a.z", "b.u"),
        connection("z", "b.u"),
        connection("a.u", "b.u"),
        connection("a.y", "b.y"),
        connection("a.y", "b.u") + connection("b.y", "b.u"),
        connection("a.y", "b.u", '<ssc:LinearTransformation factor="x"/>'),
        connection("a.y", "b.u", '<ssc:LinearTransformation factor="INF"/>'),
        connection("a.y", "b.u", TABLE),
    ],
    ids=[
        "no element", "no connector", "no connector of the system", "inputs", "outputs", "fed twice", "no factor",
        "infinite factor", "a table",
    ],
)  # fmt: skip
def test_a_connection_to_nowhere_or_of_the_wrong_kind_is_refused(opened: Open, connections: str, wording: Wording):
    wording.check(refusal(lambda: opened(TWO, connections)))


def test_all_faults_of_connections_are_reported_together_each_with_its_line(opened: Open):
    value = refusal(lambda: opened(TWO, connection("c.y", "b.u") + "\n" + connection("a.u", "b.u")))
    assert value.startswith("SystemStructure.ssd, line 3: there is no element 'c'")
    assert "; SystemStructure.ssd, line 4: a.u - b.u: both ends take" in value


@pytest.mark.parametrize(
    "inside",
    [
        connectors(z="output"),
        connectors(y="input"),
        connectors(y="output mm"),
        connectors(y="output").replace("Real", "Integer"),
        connectors(u="input") * 2,
    ],
    ids=["no variable", "other causality", "other unit", "other type", "twice"],
)
def test_a_connector_is_what_its_fmu_says(opened: Open, inside: str, wording: Wording):
    wording.check(refusal(lambda: opened(component("a", inside), more=MM)))


def test_units_that_do_not_fit_are_refused(opened: Open):
    seconds = '<ssd:Units><ssc:Unit name="s"><ssc:BaseUnit s="1"/></ssc:Unit></ssd:Units>'
    inner = system(component("a", PLAIN), connection("a.y", "x"), name="inner", before=connectors(x="output s"))
    value = refusal(lambda: opened(inner + component("b", PLAIN), connection("inner.x", "b.u"), seconds))
    assert "inner.a.y -> b.u: 'm' cannot be converted to 's': they differ in dimension" in value


def test_a_unit_that_is_not_defined_is_tolerated_with_a_line_unless_the_fmu_has_it(opened: Open):
    """Of systems' connectors too, those included that nothing goes on from."""
    (line,) = opened(component("a", connectors(y="output kg"))).system.tolerated
    assert line.startswith("SystemStructure.ssd, line 3: a.y: 'kg' cannot be converted to 'm': the unit 'kg' is not")
    assert opened(component("a", connectors(y="output m")), more=MM).system.units
    a, whole = component("a", PLAIN), connection("a.y", "y")
    assert not opened(system(a, whole, name="inner", before=connectors(y="output m"))).system.tolerated
    (line,) = opened(system(a, whole, name="inner", before=connectors(y="output bogus"))).system.tolerated
    assert "line 3: a.y - y: 'm' cannot be converted to 'bogus': the unit 'bogus' is not defined" in line


def test_a_prefix_that_a_vendor_does_not_declare_does_not_matter(opened: Open):
    step = '<osp:Algorithm><osp:FixedStepAlgorithm baseStepSize="0.25"/></osp:Algorithm>'
    annotation = f'<ssc:Annotation type="com.opensimulationplatform">{step}</ssc:Annotation>'
    more = (
        f'<ssd:DefaultExperiment stopTime="3"><ssd:Annotations>{annotation}</ssd:Annotations></ssd:DefaultExperiment>'
    )
    ssp = opened(TWO, more=more)
    assert (ssp.stop, len(ssp.system.units)) == (3, 2)
    assert ["prefixes" in line and line.startswith("SystemStructure.ssd: ") for line in ssp.system.tolerated] == [True]


def test_a_value_that_feeds_itself_is_refused(opened: Open):
    inner = system(component("a", PLAIN), connection("u", "y") + connection("u", "a.u"), name="inner", before=PLAIN)
    assert "inner.a.u is fed by itself" in refusal(lambda: opened(inner, connection("inner.y", "inner.u")))


def test_what_is_not_supported_is_told_with_what_does_not_fit(tmp_path: Path):
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
    faults = refusal(lambda: SspFile(path))
    assert "line 3: <ssc:BooleanMappingTransformation> is not supported; <ssc:LinearTransformation> is" in faults
    assert "a.count (integer) -> b.u (real): integer cannot feed real" in faults
    checked = list(check_ssp(path, timeout=60.0))
    assert [len(report.sections[0].findings) for report in checked] == [2, 0, 0]  # and then each FMU by itself


def test_indices_of_version_2_are_refused_by_name(opened: Open):
    indexed = connection("a.y", "b.u", more='startIndices="1"')
    assert "startIndices is not supported" in refusal(lambda: opened(TWO, indexed, version="2.0"))


@pytest.mark.parametrize(
    ("start", "stop", "wanted"),
    [
        ("0", "2.5", ("0", "5/2")),
        ("-1.5", "0.3333333333333333", ("-3/2", "1/3")),
        ("0.3333333333333333", "1", ("1/3", "1")),
    ],
)
def test_start_and_stop_time_are_the_default_experiment_s(opened: Open, start: str, stop: str, wanted: tuple[str, str]):
    ssp = opened(TWO, more=f'<ssd:DefaultExperiment startTime="{start}" stopTime="{stop}"/>')
    assert (str(ssp.system.start), str(ssp.stop)) == wanted


@pytest.mark.parametrize(
    ("start", "stop", "value"), [("2", "2", "ends at 2 s; above 2 s"), ("0", "-1", "ends at -1 s")]
)
def test_an_experiment_that_cannot_be_run_is_refused(opened: Open, start: str, stop: str, value: str):
    more = f'<ssd:DefaultExperiment startTime="{start}" stopTime="{stop}"/>'
    assert value in refusal(lambda: opened(TWO, more=more))


@pytest.mark.parametrize(("stop", "of_run", "taken"), [("", 3, "0.006"), (' stopTime="7"', 3, "0.01")])
def test_an_fmu_that_proposes_no_step_takes_a_500th(tmp_path: Path, stop: str, of_run: int, taken: str):
    """Of its own default experiment, or else of the run."""
    fmu = decay.pack(tmp_path / "unit.fmu", b"", decay.edited((' stopTime="1" stepSize="0.1"', stop)))
    file = pack_ssp(tmp_path / "a.ssp", described(system(component("a"))), {"resources/unit.fmu": fmu})
    if not stop:
        assert "a: its FMU proposes no communication step; give one" in refusal(lambda: SspFile(file))
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


@pytest.mark.parametrize("period", ["0", "-1/30", "1e999999999", "1/0", "", "0.1"])
def test_an_annotated_step_is_a_fraction(opened: Open, period: str):
    step = f'<Step xmlns="urn:handover:communication" period="{period}" sampled="true"/>'
    annotated = f'<ssc:Annotation type="handover.communication">{step}</ssc:Annotation>'
    value = refusal(lambda: opened(component("a", f"<ssd:Annotations>{annotated}</ssd:Annotations>")))
    assert f"period={period!r} is not a number of seconds such as 1/30" in value
