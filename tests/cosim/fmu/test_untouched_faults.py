"""Faults of a model description: where co-simulation does not touch them they are told, elsewhere they are refused."""

import logging
import re
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import pytest
from support.cosim import decay
from support.cosim.native_units import Edited, native_fmu

from handover.cosim.check.check_fmu import check_fmu
from handover.cosim.exceptions import InvalidFmu
from handover.cosim.fmu.file.description import describe_fmu
from handover.cosim.master.master import Master
from handover.cosim.stepping.options import MasterOptions
from handover.cosim.system.system import System

STATE2 = '<ScalarVariable name="s" valueReference="90" causality="local" variability="continuous"><Real {}/>'
STATE3 = '<Float64 name="s" valueReference="90" causality="local" variability="continuous" {}/>'


def local(fmi: int, attributes: str) -> tuple[str, str]:
    """Return the edit that adds a local variable, the last one, so that FMI 2's indices stay."""
    row = STATE2.format(attributes) + "</ScalarVariable>" if fmi == 2 else STATE3.format(attributes)
    return "</ModelVariables>", row + "</ModelVariables>"


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize(
    ("attributes", "wanted"),
    [
        ('derivative="999"', "derivative attribute of model variable s .* which does not exist"),
        ('declaredType="Speed"', 'declaredType="Speed" which has not been defined'),
        ('unit="parsec"', 'unit "parsec" of variable "s"'),
        ('displayUnit="km"', "KeyError: None"),
        ('start="3"', 'provides a start value'),
        ('min="low"', "'low' is not a valid value of the atomic type"),
    ],
)  # fmt: skip
def test_a_fault_of_a_local_variable_is_told_and_the_unit_runs(
    edited: Edited, caplog: pytest.LogCaptureFixture, fmi: int, attributes: str, wanted: str
):
    system = System()
    system.add("mass", edited("mass", fmi, local(fmi, attributes)), f=2.0)
    fault = system.units["mass"].description.untouched_fault
    assert re.search(wanted, fault), fault
    with caplog.at_level(logging.WARNING), Master(system) as master:
        master.run(Fraction(1))
        assert master.signals["mass.x"] == pytest.approx(1.0)
    (line,) = [r.getMessage() for r in caplog.records if "does not matter here" in r.getMessage()]
    assert fault in line
    with pytest.raises(InvalidFmu, match=r"its modelDescription.xml is not valid: "):
        Master(system, MasterOptions(strict=True))


@pytest.mark.parametrize("fmi", [2, 3])
def test_what_is_read_is_the_same_with_and_without_the_fault(edited: Edited, fmi: int):
    of_fmi3 = ("counter_tenths", "array_passer", "binary_passer", "ball") if fmi == 3 else ()
    for unit in ("gain", "mass", "sum", "discrete_passer", *of_fmi3):
        sound = describe_fmu(native_fmu(unit, fmi))
        faulty = describe_fmu(edited(unit, fmi, local(fmi, 'derivative="999"')))
        assert faulty.untouched_fault
        assert replace(faulty, path=sound.path, untouched_fault="") == sound


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("<DefaultExperiment", "<LogCategories><Kind/></LogCategories><DefaultExperiment"),
        ("<UnitDefinitions", '<ModelExchange modelIdentifier="a" odd="1"/><UnitDefinitions'),
        ("<UnitDefinitions", "<Vendor/><UnitDefinitions"),
        (' startTime="0"', ' startTime="early"'),
        ('modelName="mass"', 'modelName="mass" generationDateAndTime="yesterday"'),
        ("</Unit>", '<DisplayUnit factor="1"/></Unit>'),
    ],
)
def test_parts_that_only_others_read_may_be_at_fault(edited: Edited, fmi: int, old: str, new: str):
    d, sound = describe_fmu(edited("mass", fmi, (old, new))), describe_fmu(native_fmu("mass", fmi))
    assert d.untouched_fault
    assert (d.inputs, d.outputs, d.parameters) == (sound.inputs, sound.outputs, sound.parameters)


@pytest.mark.parametrize(
    ("old", "new", "wanted"),
    [
        ('"parameter" variability="fixed"', '"parameter"', "illegal combination of causality"),
        ('"parameter" variability="fixed"', '"parameter" variability="constant"', "illegal combination of causality"),
        ('"output" variability', '"output" initial="exact" variability', '"y" .* has no start value'),
        ('<Real unit="m" max="100"/>', '<Real unit="m" max="100" start="1"/>', '"y" .* provides a start value'),
    ],
)
def test_when_parameters_and_outputs_have_their_values_is_said_by_their_causality(
    tmp_path: Path, old: str, new: str, wanted: str
):
    sound = describe_fmu(decay.pack(tmp_path / "a.fmu", b""))
    d = describe_fmu(decay.pack(tmp_path / "a.fmu", b"", decay.edited((old, new))))
    assert re.search(wanted, d.untouched_fault)
    assert replace(d, untouched_fault="") == sound


@pytest.mark.parametrize("causality", ["local", "output"])
def test_time_need_not_be_the_one_independent_variable(edited: Edited, causality: str):
    d = describe_fmu(edited("mass", 3, ('causality="independent"', f'causality="{causality}"')))
    assert "Exactly one independent variable must be defined" in d.untouched_fault
    assert ("time" in d.outputs) == (causality == "output")


def test_an_enumeration_that_is_said_to_be_continuous_changes_at_events(tmp_path: Path):
    types = '<TypeDefinitions><SimpleType name="T"><Enumeration><Item name="A" value="1"/></Enumeration></SimpleType>'
    row = '<ScalarVariable name="e" valueReference="7" causality="output"><Enumeration declaredType="T"/>'
    description = decay.edited(
        ("<DefaultExperiment", types + "</TypeDefinitions><DefaultExperiment"),
        ("</ModelVariables>", row + "</ScalarVariable></ModelVariables>"),
        (
            '<Outputs><Unknown index="3" dependencies=""/>',
            '<Outputs><Unknown index="3" dependencies=""/><Unknown index="5"/>',
        ),
    )
    d = describe_fmu(decay.pack(tmp_path / "e.fmu", b"", description))
    assert 'variable "e"' in d.untouched_fault
    assert 'must have variability != "continuous"' in d.untouched_fault
    assert d.outputs["e"].discrete
    assert d.outputs["e"].items == (("A", 1),)
    assert list(d.outputs) == ["y", "e"]


@pytest.mark.parametrize(
    ("old", "new", "wanted"),
    [
        ('causality="input"', 'causality="imput"', "'imput' is not an element of the set"),
        ('<Real start="0"', "<Real", '"u" .* has no start value'),
        (' guid="decay"', "", "attribute 'guid' is required but missing"),
        ('modelIdentifier="Decay"', "", "attribute 'modelIdentifier' is required but missing"),
        ('<Outputs><Unknown index="3"', '<Outputs><Unknown index="7"', "index 7 leads to no variable"),
        ('"3" dependencies=""/></Outputs>', '"3" dependencies="9"/></Outputs>', "dependencies 9 leads to no variable"),
        ('"output" variability="continuous"', '"output" variability="fixed"', "illegal combination"),
    ],
)  # fmt: skip
def test_a_fault_in_what_co_simulation_reads_is_refused(tmp_path: Path, old: str, new: str, wanted: str):
    file = decay.pack(tmp_path / "a.fmu", b"", decay.edited((old, new)))
    with pytest.raises(InvalidFmu, match=f"its modelDescription.xml is not valid: .*{wanted}"):
        describe_fmu(file)


@pytest.mark.parametrize(
    ("fmi", "old", "new", "what"),
    [
        (2, '<Outputs><Unknown index="3"', '<Outputs><Unknown index="7"', "index 7"),
        (2, 'index="3" dependencies=""/></Outputs>', 'index="3" dependencies="9"/></Outputs>', "dependencies 9"),
        (3, '<Output valueReference="2"', '<Output valueReference="77"', "valueReference 77"),
        (
            3,
            '<Output valueReference="2" dependencies=""',
            '<Output valueReference="2" dependencies="4 78"',
            "dependencies 78",
        ),
    ],
)
def test_a_run_and_a_check_say_the_same_of_what_leads_to_no_variable(
    edited: Edited, tmp_path: Path, fmi: int, old: str, new: str, what: str
):
    file = decay.pack(tmp_path / "a.fmu", b"", decay.edited((old, new))) if fmi == 2 else edited("mass", 3, (old, new))
    with pytest.raises(InvalidFmu) as refused:
        describe_fmu(file)
    findings = [f for section in check_fmu(file, timeout=60.0).sections for f in section.findings]
    (found,) = [f for f in findings if f"{what} leads to no variable" in f.what]
    assert f"is not valid: {found.where}: {found.what}; {found.cure}" in str(refused.value)


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("step", ["NaN", "INF", "1e-300", "-1", "0", "soon"])
def test_a_step_that_is_none_is_warned_of_and_another_taken(edited: Edited, fmi: int, step: str):
    file = edited("mass", fmi, ('stepSize="0.01"', f'stepSize="{step}"'))
    system = System()
    assert system.add("mass", file).period == Fraction(1, 500)
    where = f"stepSize='{step}' of its DefaultExperiment (line "
    assert where in system.untouched_faults[file]
    with pytest.raises(InvalidFmu, match=re.escape(where)):
        Master(system, MasterOptions(strict=True))
    system = System()
    system.add("mass", file, period=Fraction(1, 100), f=2.0)
    assert where in system.untouched_faults[file]
    with Master(system) as master:
        master.run(Fraction(1))
        assert master.signals["mass.x"] == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("given", "internal", "step"),
    [("0.0333333", "0.5", Fraction(1, 30)), (None, "0.05", Fraction(1, 20)), (None, None, None), ("0", "NaN", None)],
)
def test_a_check_and_a_run_propose_the_same_step(
    edited: Edited, given: str | None, internal: str | None, step: Fraction | None
):
    flag = "" if internal is None else f' fixedInternalStepSize="{internal}"'
    size = "" if given is None else f' stepSize="{given}"'
    file = edited("mass", 3, (' stepSize="0.01"', size), ("<CoSimulation ", f"<CoSimulation{flag} "))
    system = System()
    system.add("mass", file, f=2.0)
    told = {s.name: s.summary for s in check_fmu(file, timeout=60.0).sections}
    assert len(system.tolerated) == (step is None)
    if step is None:
        step = Fraction(1, 500)  # of the default experiment, which ends at 1 s
        assert told["interface"] == "co-simulation, no step size given: a run takes 0.002 s"
    else:
        assert told["interface"] == f"co-simulation, steps of {float(step):g} s"
    assert system.units["mass"].period == step
    assert told["run"].startswith(f"10 steps of {float(step):g} s")


@pytest.mark.parametrize("fmi", [2, 3])
def test_a_unit_of_measurement_that_is_not_defined_is_warned_of(edited: Edited, fmi: int):
    """Without a single definition, too. It fits its like; elsewhere values pass as they are, which a line says."""
    file = edited("mass", fmi, ("<UnitDefinitions>", "<!--"), ("</UnitDefinitions>", "-->"))
    system = System()
    odd, sound = (system.add(name, f, f=2.0) for name, f in (("odd", file), ("sound", native_fmu("mass", fmi))))
    system.connect(odd.y.v, sound.u.f)
    assert "not defined" in system.untouched_faults[file]
    (line,) = system.tolerated
    assert line.startswith("odd.v (real m/s) -> sound.f (real N): the unit 'm/s' is not defined")
    with Master(system) as master:
        master.run(Fraction(1))
        assert master.signals["odd.x"] == pytest.approx(1.0)


def test_a_prefix_that_a_vendor_does_not_declare_is_warned_of(edited: Edited):
    annotation = '<VendorAnnotations><Tool name="osp"><osp:View osp:x="1"/></Tool></VendorAnnotations><ModelVariables>'
    file = edited("mass", 2, ("<ModelVariables>", annotation))
    system = System()
    system.add("mass", file, f=2.0)
    assert "osp" in system.untouched_faults[file]
    with Master(system) as master:
        master.run(Fraction(1))
        assert master.signals["mass.x"] == pytest.approx(1.0)


def test_a_text_that_starts_as_in_fmi_2_is_warned_of(edited: Edited):
    text = '<String name="label" valueReference="90" causality="parameter" variability="fixed" start="a b"/>'
    d = describe_fmu(edited("mass", 3, ("</ModelVariables>", f"{text}</ModelVariables>")))
    assert "'start' is not allowed" in d.untouched_fault
    assert d.parameters["label"].start == "a b"


def test_a_list_of_no_outputs_is_warned_of(edited: Edited):
    file = edited("sink", 2, ("<ModelStructure />", "<ModelStructure><Outputs/></ModelStructure>"))
    assert "Missing child element" in describe_fmu(file).untouched_fault
