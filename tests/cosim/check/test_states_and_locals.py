"""A check tells by how much a restored state is off, and which variables a unit's library does not know."""

import logging
from fractions import Fraction
from pathlib import Path

import pytest
from support.cosim.fmu_of import FmuOf
from support.cosim.native_units import Edited, native_fmu
from support.rewritten_archive import described_otherwise

from handover.cosim.check.check_fmu import check_fmu
from handover.cosim.exceptions import InvalidFmu
from handover.cosim.fmu.file.fmpy_edge import unpack
from handover.cosim.master.master import Master
from handover.cosim.probe.finding import Finding, Level
from handover.cosim.probe.isolated_process import Journal
from handover.cosim.probe.probed_instance import probed
from handover.cosim.stepping.options import MasterOptions
from handover.cosim.system.system import System


def found_in_run(file: Path) -> list[Finding]:
    report = check_fmu(file, timeout=60.0)
    assert report.sections[-1].reached, [f.line for s in report.sections for f in s.findings]
    return list(report.sections[-1].findings)


@pytest.mark.parametrize(
    ("unit", "fmi", "level", "share"),
    [
        ("state_off_by_1e6", 2, Level.WARNING, 1e-6),
        ("state_off_by_1e4", 3, Level.WARNING, 1e-4),
        ("state_off_by_1e2", 3, Level.FAULT, 1e-2),
    ],
)
def test_what_a_restored_state_is_off_by_is_reported_with_its_size(fmi: int, unit: str, level: Level, share: float):
    (finding,) = found_in_run(native_fmu(unit, fmi))
    assert finding.level is level
    assert finding.where == ("fmi2SetFMUstate" if fmi == 2 else "fmi3SetFMUState")
    size = f"y by {share / (1 + 2 * share):.2g} of its largest value"  # five steps of ten too many, at t = 1 s
    assert finding.what == f"steps from a restored state (t = 0.5 s) give other outputs than the first time: {size}"


@pytest.mark.parametrize(("fmi", "count"), [(2, 1), (3, 6)])
def test_a_derivative_that_the_library_does_not_know_is_found(tmp_path: Path, fmi: int, count: int):
    known, unknown = [f"known_{i}" for i in range(count - 1)], "der(x)"
    assert found_in_run(with_locals(tmp_path, fmi, {**dict.fromkeys(known, 3), "der(x)": 3})) == []
    (finding,) = found_in_run(with_locals(tmp_path, fmi, {**dict.fromkeys(known, 3), unknown: 77}))
    assert finding.level is Level.FAULT
    assert finding.where == f"variable {unknown!r}"
    call = "fmi2GetReal" if fmi == 2 else "fmi3GetFloat64"
    assert finding.what == f"its value cannot be read: {call} answered Error"
    assert "no such variable with value reference 77" in finding.log[-1]


@pytest.mark.slow
def test_locals_that_the_search_does_not_come_to_are_reported(tmp_path: Path):
    file = with_locals(tmp_path, 3, {f"der(x_{i})": 77 for i in range(40)})
    *faults, last = found_in_run(file)
    assert {f.level for f in faults} == {Level.FAULT}
    assert last.level is Level.NOTE
    text = "variables inside: after 60 restarts it is not known which of these can be read: der(x_"
    assert last.line.startswith(text)
    assert f" and {40 - len(faults) - 5} more; mend those that cannot, and check again" in last.line


def with_locals(folder: Path, fmi: int, references: dict[str, int]) -> Path:
    """Return the native mass with further variables, derivatives of its position, under value references."""
    derivative = 'derivative="2"'  # x is the second variable, and has value reference 2
    rows = [
        f'<ScalarVariable name="{name}" valueReference="{r}" causality="local"><Real {derivative}/></ScalarVariable>'
        if fmi == 2
        else f'<Float64 name="{name}" valueReference="{r}" causality="local" {derivative}/>'
        for name, r in references.items()
    ]
    end = "</ModelVariables>"
    fmu = native_fmu("mass", fmi)
    return described_otherwise(fmu, folder / "mass.fmu", lambda text: text.replace(end, "".join(rows) + end))


@pytest.mark.parametrize("announces", [False, True])
def test_a_unit_with_event_mode_is_tried_as_in_a_run(tmp_path: Path, announces: bool):
    """A ball bounces within steps: a step returns early, or the unit says when its next event is."""
    system = System()
    system.add("ball", native_fmu("ball"), period=Fraction(1, 10), announces=announces)
    d, seen = system.units["ball"].description, list[float]()
    unpack(d.path, tmp_path / "ball", d.fmi, d.identifier)
    unit = probed("ball", d, tmp_path / "ball", Journal(tmp_path / "journal"))
    unit.start(0.0, {"announces": announces})
    with Master(system) as master:
        for k in range(1, 11):
            unit.advance(0.1)
            master.run(Fraction(k, 10))
            assert unit.y["h"][0][0] == pytest.approx(master.signals.plain("ball.h"), abs=1e-9)
            seen.append(unit.time)
        assert unit.y["bounces"][0][0] == master.signals.plain("ball.bounces") == 1
    unit.free()
    assert seen == pytest.approx([k / 10 for k in range(1, 11)])


@pytest.mark.parametrize("unit", ["ball", "counter_tenths"])
def test_units_with_event_mode_pass(unit: str):
    report = check_fmu(native_fmu(unit), timeout=60.0)
    assert report.passed, [f.line for s in report.sections for f in s.findings]
    assert "second instance, reset" in report.sections[-1].summary


UNLISTED = "an output that ModelStructure does not list among the outputs; a run takes it to depend on all inputs"
INVALID = [
    (3, ('start="1.0"', 'start="1.0" min="3" max="2"'), "its min 3 is above its max 2"),
    (2, ('<Real start="1.0" />', '<Real start="1.0" max="0.5" />'), "start value 1.0 is out of its range"),
    (3, ('<Output valueReference="2" dependencies="1" />', ""), UNLISTED),
]


def warnings_of(caplog: pytest.LogCaptureFixture) -> list[str]:
    return [r.getMessage() for r in caplog.records if r.levelno >= logging.WARNING]


@pytest.mark.parametrize(("fmi", "edit", "wanted"), INVALID)
def test_a_run_warns_of_what_a_check_finds_in_the_description(
    edited: Edited, caplog: pytest.LogCaptureFixture, fmi: int, edit: tuple[str, str], wanted: str
):
    file = edited("mixed_gain", fmi, edit)
    system = System()
    system.add("gain", file)
    with caplog.at_level(logging.WARNING), Master(system) as master:
        master.run(Fraction(1))
    (line,) = warnings_of(caplog)
    assert wanted in line
    assert line.startswith(f"{file}: its modelDescription.xml is not valid: ")
    assert wanted in master.description_faults[file]
    with pytest.raises(InvalidFmu, match=wanted):
        Master(system, MasterOptions(strict=True))
    assert wanted in "\n".join(f.line for s in check_fmu(file, timeout=60.0).sections for f in s.findings)


@pytest.mark.parametrize("fmi", [2, 3])
def test_a_file_that_is_replaced_is_read_again(edited: Edited, fmi: int):
    bounds = ('start="1.0"', 'start="1.0" min="3" max="2"')
    faults = []
    for edits in ((), (bounds,), ()):
        system = System()
        system.add("gain", edited("gain", fmi, *edits))
        faults.append(len(Master(system).description_faults))
    assert faults == [0, 1, 0]


@pytest.mark.parametrize("fmi", [2, 3])
def test_a_unit_that_needs_another_tool_is_reported(edited: Edited, caplog: pytest.LogCaptureFixture, fmi: int):
    system = System()
    system.add("gain", edited("gain", fmi, ("<CoSimulation ", '<CoSimulation needsExecutionTool="true" ')))
    with caplog.at_level(logging.WARNING):
        Master(system, MasterOptions(strict=True))
    assert warnings_of(caplog) == [
        "gain needs other software to run, as its FMU says: the tool that exported it, or an interpreter"
    ]


def test_the_python_of_a_unit_of_this_project_is_no_other_tool(fmu: FmuOf):
    system = System()
    system.add("unit", fmu("Mass"))
    assert system.units["unit"].description.capabilities.needs_tool
    assert Master(system, MasterOptions(strict=True)).execution_tools == []


def test_sound_units_have_no_faults(caplog: pytest.LogCaptureFixture):
    for fmi in (2, 3):
        system = System()
        system.add("mass", native_fmu("mass", fmi))
        with caplog.at_level(logging.WARNING):
            Master(system, MasterOptions(strict=True))
    assert warnings_of(caplog) == []
