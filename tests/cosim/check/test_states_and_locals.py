"""A check tells by how much a restored state is off, and which variables a unit's library does not know."""

import zipfile
from fractions import Fraction
from pathlib import Path

import pytest
from native_units import native_fmu

from handover.cosim.check.check_fmu import check_fmu
from handover.cosim.fmu.file.fmpy_edge import unpack
from handover.cosim.master.master import Master
from handover.cosim.probe.finding import Finding, Level
from handover.cosim.probe.isolated_process import Journal
from handover.cosim.probe.probed_instance import probed
from handover.cosim.system.system import System


def found_in_run(file: Path) -> list[Finding]:
    report = check_fmu(file, timeout=60.0)
    assert report.sections[-1].reached, [f.line for s in report.sections for f in s.findings]
    return list(report.sections[-1].findings)


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize(
    ("unit", "level", "share"),
    [
        ("state_off_by_1e6", Level.WARNING, 1e-6),
        ("state_off_by_1e4", Level.WARNING, 1e-4),
        ("state_off_by_1e2", Level.FAULT, 1e-2),
    ],
)
def test_what_a_restored_state_is_off_by_is_told_with_its_size(fmi: int, unit: str, level: Level, share: float):
    (finding,) = found_in_run(native_fmu(unit, fmi))
    assert finding.level is level
    assert finding.where == ("fmi2SetFMUstate" if fmi == 2 else "fmi3SetFMUState")
    size = f"y by {share / (1 + 2 * share):.2g} of its largest value"  # five steps of ten too many, at t = 1 s
    assert finding.what == f"steps from a restored state (t = 0.5 s) give other outputs than the first time: {size}"


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("count", [1, 6])
def test_a_derivative_that_the_library_does_not_know_is_found(tmp_path: Path, fmi: int, count: int):
    known, unknown = [f"known_{i}" for i in range(count - 1)], "der(x)"
    file = with_locals(tmp_path, fmi, {**dict.fromkeys(known, 3), unknown: 77})
    (finding,) = found_in_run(file)
    assert finding.level is Level.FAULT
    assert finding.where == f"variable {unknown!r}"
    call = "fmi2GetReal" if fmi == 2 else "fmi3GetFloat64"
    assert finding.what == f"its value cannot be read: {call} answered Error"
    assert "no such variable with value reference 77" in finding.log[-1]


@pytest.mark.slow
def test_locals_that_the_search_does_not_come_to_are_told(tmp_path: Path):
    file = with_locals(tmp_path, 3, {f"der(x_{i})": 77 for i in range(40)})
    *faults, last = found_in_run(file)
    assert {f.level for f in faults} == {Level.FAULT}
    assert last.level is Level.NOTE
    text = "variables inside: after 60 restarts it is not known which of these can be read: der(x_"
    assert last.line.startswith(text)
    assert f" and {40 - len(faults) - 5} more; mend those that cannot, and check again" in last.line


@pytest.mark.parametrize("fmi", [2, 3])
def test_locals_that_the_library_knows_are_no_finding(tmp_path: Path, fmi: int):
    assert found_in_run(with_locals(tmp_path, fmi, {"der(x)": 3})) == []


def with_locals(folder: Path, fmi: int, references: dict[str, int]) -> Path:
    """Return the native mass with further variables, derivatives of its position, under value references."""
    derivative = 'derivative="2"'  # x is the second variable, and has value reference 2
    rows = [
        f'<ScalarVariable name="{name}" valueReference="{r}" causality="local"><Real {derivative}/></ScalarVariable>'
        if fmi == 2
        else f'<Float64 name="{name}" valueReference="{r}" causality="local" {derivative}/>'
        for name, r in references.items()
    ]
    file = folder / "mass.fmu"
    with zipfile.ZipFile(native_fmu("mass", fmi)) as source, zipfile.ZipFile(file, "w") as target:
        for name in source.namelist():
            content = source.read(name)
            target.writestr(name, content.replace(b"</ModelVariables>", "".join(rows).encode() + b"</ModelVariables>"))
    return file


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


@pytest.mark.parametrize("unit", ["ball", "counter_tenths", "watch"])
def test_units_with_event_mode_pass(unit: str):
    report = check_fmu(native_fmu(unit), timeout=60.0)
    assert report.passed, [f.line for s in report.sections for f in s.findings]
    assert "second instance, reset" in report.sections[-1].summary
