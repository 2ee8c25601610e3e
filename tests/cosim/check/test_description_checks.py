"""What is wrong with a model description: a valid one is edited, and the fault is reported with its place."""

import re
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from support.cosim import decay
from support.cosim.fmu_of import FmuOf
from support.rewritten_archive import DESCRIPTION, rewritten
from support.wording import Wording

from handover.cosim.check.check_fmu import check_fmu
from handover.cosim.check.report import CheckReport
from handover.cosim.probe.finding import Level

NO_LIBRARY = b"\x7fELF\x02\x01\x01" + bytes(11) + b"\xb7\x00"  # of aarch64: the check ends before it is loaded


def checked(file: Path, description: str) -> CheckReport:
    return check_fmu(decay.pack(file, NO_LIBRARY, description), timeout=30.0)


def findings_text(report: CheckReport, level: Level = Level.FAULT) -> str:
    return "\n".join(f.line for s in report.sections[:3] for f in s.findings if f.level is level)


def test_a_sound_description_has_no_findings(tmp_path: Path):
    report = checked(tmp_path / "a.fmu", decay.DESCRIPTION)
    assert [s.level for s in report.sections[:3]] == [Level.OK] * 3
    assert not report.sections[4].reached


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('causality="input"', 'causality="imput"'),
        ('<Integer start="0"', '<Integer start="zero"'),
        ('<Integer start="0"', '<Integer start="12"'),
        ('<Integer start="0"', '<Integer start="3000000000"'),
        ('<Integer start="0" min="0"', '<Integer start="0" min="20"'),
        ('<Integer start="0"', "<Integer"),
        ('<Real start="0"', "<Real"),
        ('<Real unit="m"/>', '<Real unit="parsec"/>'),
        ('<Real unit="m"/>', '<Real displayUnit="mm"/>'),
        ('<Real unit="m"/>', '<Real unit="m" derivative="9"/>'),
        ('<Real unit="m"/>', '<Real unit="m" declaredType="T"/>'),
        ('name="x"', 'name="u"'),
        ('name="x"', 'name="1 x"'),
        ('<Outputs><Unknown index="3"', '<Outputs><Unknown index="7"'),
        ('<Outputs><Unknown index="3" dependencies=""/></Outputs>', ""),
        ('dependencies=""/></Outputs>', 'dependencies="0"/></Outputs>'),
        ('modelIdentifier="Decay"', 'modelIdentifier="3-decay"'),
        ('stepSize="0.1"', 'stepSize="-1"'),
        ('startTime="0" stopTime="1"', 'startTime="2" stopTime="1"'),
        (' guid="decay"', ""),
        ('fmiVersion="2.0"', 'fmiVersion="1.0"'),
        ('fmiVersion="2.0"', ""),
        ("fmiModelDescription", "modelDescription"),
        ('<InitialUnknowns><Unknown index="3"', '<InitialUnknowns><Unknown index="2"'),
        ('name="x" valueReference="0" causality="local"', 'name="x" valueReference="1" causality="input"'),
    ],
)
def test_a_fault_is_reported_with_its_place(tmp_path: Path, old: str, new: str, wording: Wording):
    wording.check(findings_text(checked(tmp_path / "a.fmu", decay.edited((old, new)))))


def test_all_faults_are_reported_together(tmp_path: Path, wording: Wording):
    edits = ('causality="input"', 'causality="imput"'), ('<Integer start="0"', '<Integer start="12"')
    wording.check(findings_text(checked(tmp_path / "a.fmu", decay.edited(*edits, ('stepSize="0.1"', 'stepSize="0"')))))


def test_what_a_unit_needs_is_noted(tmp_path: Path, wording: Wording):
    for flag in ("needsExecutionTool", "canBeInstantiatedOnlyOncePerProcess"):
        report = checked(tmp_path / "a.fmu", decay.edited(("<CoSimulation ", f'<CoSimulation {flag}="true" ')))
        wording.check(findings_text(report, Level.NOTE))
        assert findings_text(report) == ""


def test_an_fmu_for_model_exchange_alone_is_reported(tmp_path: Path, wording: Wording):
    edits = ("CoSimulation", "ModelExchange"), ('canHandleVariableCommunicationStepSize="true" ', "")
    report = checked(tmp_path / "a.fmu", decay.edited(*edits))
    wording.check(findings_text(report))
    assert [s.reached for s in report.sections] == [True, True, True, False, False, False]


@pytest.mark.parametrize(
    ("old", "new", "level"),
    [
        ('fmiVersion="3.0"', 'fmiVersion="3.0-beta.2"', Level.WARNING),
        ('causality="independent"', 'causality="local"', Level.FAULT),
        ('<Dimension start="2" />', '<Dimension valueReference="999" />', Level.FAULT),
        ('name="pair_back" valueReference="', 'name="pair_back" valueReference="9', Level.FAULT),
        ('<Item name="GREEN" value="2"', '<Item name="GREEN" value="1"', Level.FAULT),
        ('name="pair" valueReference="', 'start="1 2 3" name="pair" valueReference="', Level.FAULT),
    ],
    ids=["draft", "no time", "dimension of none", "not listed", "value twice", "start of another shape"],
)
def test_faults_of_fmi_3_are_reported(fmu: FmuOf, tmp_path: Path, old: str, new: str, level: Level, wording: Wording):
    def rewrite(name: str, content: bytes) -> bytes | None:
        if name != DESCRIPTION:
            return None if name.startswith("binaries/") else content
        text = content.decode()
        if "start=" in new:
            text = re.sub(r'(name="pair"[^>]*) start="[^"]*"', r"\1", text)
        assert old in text
        return text.replace(old, new).encode()

    report = check_fmu(rewritten(fmu("Echo"), tmp_path / "a.fmu", rewrite), 30.0)
    wording.check(findings_text(report, level))


VALUES = re.findall(r'"([^"]*)"', decay.DESCRIPTION.partition("?>")[2])
ODD = st.sampled_from(
    ["", " ", "-1", "1e999", "nan", "٣", "²", "0x1", "1 2", "a;b", "&lt;", "99999999999999999999", "true"]
)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=30)
@given(
    edits=st.lists(st.tuples(st.integers(0, len(VALUES) - 1), ODD | st.text("abc<>&'{}\t 01.", max_size=5)), max_size=4)
)
def test_whatever_a_description_says_it_is_checked(tmp_path: Path, edits: list[tuple[int, str]]):
    head, mark, body = decay.DESCRIPTION.partition("?>")
    parts = [str(part) for part in body.split('"')]
    for at, value in edits:
        parts[2 * at + 1] = value
    report = checked(tmp_path / "a.fmu", head + mark + '"'.join(parts))
    assert not report.passed  # the library is for another machine at least
