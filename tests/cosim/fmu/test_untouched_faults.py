"""Faults of a model description: reported where co-simulation does not touch them, elsewhere refused."""

import logging
from collections.abc import Iterable
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import pytest
from support.cosim import decay
from support.cosim.native_units import Edited, native_fmu
from support.wording import Wording

from handover.cosim.check.check_fmu import check_fmu
from handover.cosim.exceptions import InvalidFmu
from handover.cosim.fmu.file.description import describe_fmu
from handover.cosim.master.master import Master
from handover.cosim.stepping.options import MasterOptions
from handover.cosim.system.system import System

pytestmark = pytest.mark.usefixtures("probes")

STATE2 = '<ScalarVariable name="s" valueReference="90" causality="local" variability="continuous"><Real {}/>'
STATE3 = '<Float64 name="s" valueReference="90" causality="local" variability="continuous" {}/>'


def local(fmi: int, attributes: str) -> tuple[str, str]:
    """Return the edit that adds a local variable, the last one, so that FMI 2's indices stay."""
    row = STATE2.format(attributes) + "</ScalarVariable>" if fmi == 2 else STATE3.format(attributes)
    return "</ModelVariables>", row + "</ModelVariables>"


OF_LOCALS = (
    'derivative="999"', 'declaredType="Speed"', 'unit="parsec"', 'displayUnit="km"', 'start="3"', 'min="low"',
)  # fmt: skip
OSP = '<VendorAnnotations><Tool name="osp"><osp:View osp:x="1"/></Tool></VendorAnnotations><ModelVariables>'
OTHERS_READ = (
    ("<DefaultExperiment", "<LogCategories><Kind/></LogCategories><DefaultExperiment"),
    ("<UnitDefinitions", '<ModelExchange modelIdentifier="a" odd="1"/><UnitDefinitions'),
    ("<UnitDefinitions", "<Vendor/><UnitDefinitions"),
    (' startTime="0"', ' startTime="early"'),
    ('modelName="mass"', 'modelName="mass" generationDateAndTime="yesterday"'),
    ("</Unit>", '<DisplayUnit factor="1"/></Unit>'),
    ("<ModelVariables>", OSP),
)
OUT_OF_OUTPUTS = '<Outputs><Unknown index="3" dependencies=""/>'


@pytest.mark.parametrize("fmi", [2, 3])
def test_a_fault_of_what_only_others_read_is_reported_and_what_is_read_is_the_same(
    edited: Edited, fmi: int, wording: Wording
):
    sound = describe_fmu(native_fmu("mass", fmi))
    for edit in (*(local(fmi, attributes) for attributes in OF_LOCALS), *OTHERS_READ):
        d = describe_fmu(edited("mass", fmi, edit))
        wording.check(d.untouched_fault)
        assert replace(d, path=sound.path, untouched_fault="", experiment=sound.experiment) == sound
    of_fmi3 = ("counter_tenths", "array_passer", "binary_passer", "ball") if fmi == 3 else ()
    for unit in ("gain", "sum", "discrete_passer", *of_fmi3):
        faulty = describe_fmu(edited(unit, fmi, local(fmi, 'derivative="999"')))
        assert faulty.untouched_fault
        assert replace(faulty, path=native_fmu(unit, fmi), untouched_fault="") == describe_fmu(native_fmu(unit, fmi))


@pytest.mark.parametrize("edits", [(local(3, OF_LOCALS[0]),), (local(3, OF_LOCALS[3]),), (("<ModelVariables>", OSP),)])
def test_a_unit_with_such_a_fault_runs_unless_that_is_strict(
    edited: Edited, caplog: pytest.LogCaptureFixture, edits: Iterable[tuple[str, str]]
):
    system = System()
    system.add("mass", edited("mass", 3, *edits), f=2.0)
    with caplog.at_level(logging.WARNING), Master(system) as master:
        master.run(Fraction(1))
        assert master.signals["mass.x"] == pytest.approx(1.0)
    (line,) = [r.getMessage() for r in caplog.records if "does not matter here" in r.getMessage()]
    assert system.units["mass"].description.untouched_fault in line
    with pytest.raises(InvalidFmu):
        Master(system, MasterOptions(strict=True))


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('"parameter" variability="fixed"', '"parameter"'),
        ('"parameter" variability="fixed"', '"parameter" variability="constant"'),
        ('"output" variability', '"output" initial="exact" variability'),
        ('<Real unit="m" max="100"/>', '<Real unit="m" max="100" start="1"/>'),
    ],
    ids=["no variability", "constant", "no start", "start of a computed one"],
)
def test_when_parameters_and_outputs_have_their_values_is_said_by_their_causality(
    tmp_path: Path, old: str, new: str, wording: Wording
):
    sound = describe_fmu(decay.pack(tmp_path / "a.fmu", b""))
    d = describe_fmu(decay.pack(tmp_path / "a.fmu", b"", decay.edited((old, new))))
    wording.check(d.untouched_fault)
    assert replace(d, untouched_fault="") == sound


def test_time_need_not_be_the_one_independent_variable(edited: Edited, wording: Wording):
    for causality in ("local", "output"):
        d = describe_fmu(edited("mass", 3, ('causality="independent"', f'causality="{causality}"')))
        wording.check(d.untouched_fault)
        assert ("time" in d.outputs) == (causality == "output")


def test_an_enumeration_that_is_said_to_be_continuous_changes_at_events(tmp_path: Path, wording: Wording):
    types = '<TypeDefinitions><SimpleType name="T"><Enumeration><Item name="A" value="1"/></Enumeration></SimpleType>'
    row = '<ScalarVariable name="e" valueReference="7" causality="output"><Enumeration declaredType="T"/>'
    description = decay.edited(
        ("<DefaultExperiment", types + "</TypeDefinitions><DefaultExperiment"),
        ("</ModelVariables>", row + "</ScalarVariable></ModelVariables>"),
        (OUT_OF_OUTPUTS, f'{OUT_OF_OUTPUTS}<Unknown index="5"/>'),
    )
    d = describe_fmu(decay.pack(tmp_path / "e.fmu", b"", description))
    wording.check(d.untouched_fault)
    assert d.outputs["e"].discrete
    assert d.outputs["e"].items == (("A", 1),)
    assert list(d.outputs) == ["y", "e"]


@pytest.mark.parametrize(
    ("fmi", "old", "new"),
    [
        (2, 'causality="input"', 'causality="imput"'),
        (2, '<Real start="0"', "<Real"),
        (2, ' guid="decay"', ""),
        (2, 'modelIdentifier="Decay"', ""),
        (2, '<Outputs><Unknown index="3"', '<Outputs><Unknown index="7"'),
        (2, '"3" dependencies=""/></Outputs>', '"3" dependencies="9"/></Outputs>'),
        (2, '"output" variability="continuous"', '"output" variability="fixed"'),
        (3, '<Output valueReference="2"', '<Output valueReference="77"'),
        (3, '<Output valueReference="2" dependencies=""', '<Output valueReference="2" dependencies="4 78"'),
    ],
    ids=[
        "no causality", "no start", "no guid", "no identifier", "index of none", "dependency of none",
        "combination", "reference of none", "FMI 3 dependency of none",
    ],
)  # fmt: skip
def test_a_fault_in_what_co_simulation_reads_is_refused_as_a_check_says(
    edited: Edited, tmp_path: Path, fmi: int, old: str, new: str, wording: Wording
):
    file = decay.pack(tmp_path / "a.fmu", b"", decay.edited((old, new))) if fmi == 2 else edited("mass", 3, (old, new))
    with pytest.raises(InvalidFmu) as refused:
        describe_fmu(file)
    wording.check(refused.value.fault)
    if "leads to no variable" in str(refused.value):
        findings = [f for section in check_fmu(file, timeout=60.0).sections for f in section.findings]
        (found,) = [f for f in findings if "leads to no variable" in f.what]
        assert f"is not valid: {found.where}: {found.what}; {found.cure}" in str(refused.value)


@pytest.mark.parametrize(("step", "fmi"), [("NaN", 2), ("1e-300", 3), ("-1", 2), ("soon", 3)])
def test_a_step_that_is_none_is_warned_of_and_another_taken(edited: Edited, fmi: int, step: str):
    file = edited("mass", fmi, ('stepSize="0.01"', f'stepSize="{step}"'))
    where = f"stepSize='{step}' of its DefaultExperiment (line "
    for period, taken in ((None, Fraction(1, 500)), (Fraction(1, 100), Fraction(1, 100))):
        system = System()
        assert system.add("mass", file, period=period).period == taken
        assert where in system.untouched_faults[file]
        with pytest.raises(InvalidFmu) as refused:
            Master(system, MasterOptions(strict=True))
        assert where in str(refused.value)


@pytest.mark.parametrize(
    ("given", "internal", "step"),
    [("0.0333333", "0.5", Fraction(1, 30)), (None, "0.05", Fraction(1, 20)), ("0", "NaN", None)],
)
def test_a_check_and_a_run_propose_the_same_step(
    edited: Edited, given: str | None, internal: str | None, step: Fraction | None
):
    flag = "" if internal is None else f' fixedInternalStepSize="{internal}"'
    size = "" if given is None else f' stepSize="{given}"'
    file = edited("mass", 3, (' stepSize="0.01"', size), ("<CoSimulation ", f"<CoSimulation{flag} "))
    system = System()
    system.add("mass", file, f=2.0)
    reported = {s.name: s.summary for s in check_fmu(file, timeout=60.0).sections}
    assert len(system.tolerated) == (step is None)
    if step is None:
        step = Fraction(1, 500)  # of the default experiment, which ends at 1 s
        assert reported["interface"] == "co-simulation, no step size given: a run takes 0.002 s"
    else:
        assert reported["interface"] == f"co-simulation, steps of {float(step):g} s"
    assert system.units["mass"].period == step
    assert reported["run"].startswith(f"10 steps of {float(step):g} s")


@pytest.mark.parametrize("fmi", [2, 3])
def test_a_unit_of_measurement_that_is_not_defined_is_warned_of(edited: Edited, fmi: int, wording: Wording):
    """Without a single definition, too. It fits its like; elsewhere values pass as they are, which a line says."""
    file = edited("mass", fmi, ("<UnitDefinitions>", "<!--"), ("</UnitDefinitions>", "-->"))
    system = System()
    odd, sound = (system.add(name, f, f=2.0) for name, f in (("odd", file), ("sound", native_fmu("mass", fmi))))
    system.connect(odd.y.v, sound.u.f)
    assert "not defined" in system.untouched_faults[file]
    (line,) = system.tolerated
    wording.check(line)
    with Master(system) as master:
        master.run(Fraction(1))
        assert master.signals["odd.x"] == pytest.approx(1.0)


def test_a_text_that_starts_as_in_fmi_2_and_a_list_of_no_outputs_are_warned_of(edited: Edited, wording: Wording):
    text = '<String name="label" valueReference="90" causality="parameter" variability="fixed" start="a b"/>'
    d = describe_fmu(edited("mass", 3, ("</ModelVariables>", f"{text}</ModelVariables>")))
    assert d.parameters["label"].start == "a b"
    wording.check(d.untouched_fault)
    file = edited("sink", 2, ("<ModelStructure />", "<ModelStructure><Outputs/></ModelStructure>"))
    wording.check(describe_fmu(file).untouched_fault)
