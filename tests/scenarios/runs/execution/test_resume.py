"""`handover resume`: a run that was killed ends as if it had not been; what cannot go on is refused as it is."""

import hashlib
import json
import os
import re
import shutil
import signal
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from click.testing import Result
from support.commands import Command, call, data_in, refusal
from support.cosim.native_units import native_fmu
from support.cosim.planted import planted_pickle
from support.failing_systems import failing_ssp
from support.kept_runs import kept_run
from support.killed_run import killed_run
from support.processes import until
from support.rewritten_archive import described_otherwise
from support.wording import Wording

from handover.cosim.blocks.state import pack_state, unpack_state
from handover.cosim.record.reader import Record
from handover.fmus.build import cached
from handover.scenarios.catalog import SCENARIOS
from handover.scenarios.experiment.parameters import parse_parameters
from handover.scenarios.runs.execution import resumption
from handover.scenarios.runs.results.run_folder import RunFolder

fcntl = pytest.importorskip("fcntl")

OF_TIME = ("cpu_", "pace_", "peak_memory")


def summary_of(folder: Path) -> dict[str, Any]:
    """Return all of a summary that measures no time."""
    data = data_in(folder)
    metrics = {k: v for k, v in data["metrics"].items() if not k.startswith(OF_TIME)}
    units = [{k: v for k, v in unit.items() if k != "cpu_seconds"} for unit in data["units"]]
    others = {k: v for k, v in data.items() if k not in ("wall_seconds", "cpu_seconds")}
    return others | {"metrics": metrics, "units": units}


def assert_same(joined: Path, whole: Path) -> None:
    for record in whole.glob("signals.*"):
        assert (joined / record.name).read_bytes() == record.read_bytes(), record.name
    assert summary_of(joined) == summary_of(whole)
    names = {str(p.relative_to(whole)) for p in whole.rglob("*")}
    assert {str(p.relative_to(joined)) for p in joined.rglob("*")} == names
    for picture in whole.glob("pictures/*"):
        assert (joined / "pictures" / picture.name).read_bytes() == picture.read_bytes(), picture.name
    data, wanted = (data_in(folder, "run") for folder in (joined, whole))
    assert data | {"checkpoint": None} == wanted


FORMATS = "ir_grasp --no-report -p strategy=forward -p forward=0.055 --stop 2 --format csv --format mat"


@pytest.mark.parametrize(
    ("scenario", "every", "passed"),
    [
        (FORMATS, 0.7, 1.6),
        pytest.param("vsl_hybrid --no-report", 0.5, 1.2, marks=pytest.mark.slow),
        pytest.param("helix_handover --no-report --stop 0.5", 0.2, 0.3, marks=pytest.mark.slow),
    ],
)
def test_a_run_that_was_killed_goes_on_to_what_it_would_have_been(
    tmp_path: Path, scenario: str, every: float, passed: float
):
    arguments = ("run", *scenario.split())
    whole = kept_run(*arguments)
    killed = killed_run(tmp_path / "killed", passed, *arguments, "--checkpoint", every)
    (killed / "checkpoint.zip.part").write_text("of a process that crashed while it wrote one")
    RunFolder.of_run(killed).add_to_run(failure={"kind": "killed"})  # as the supervisor does for a crashed run
    result = call("resume", killed, "--no-report")
    assert result.exit_code == (1 if "--stop" in arguments else 0), result.output
    assert_same(killed, whole)
    assert Record(killed / "signals.parquet").time[-1] > passed


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT])
def test_so_it_does_where_its_process_was_killed_or_interrupted(number: signal.Signals, tmp_path: Path):
    ended, whole = tmp_path / "ended", tmp_path / "whole"
    arguments = ("run", native_fmu("mass"), "-p", "f=1", "--stop", "3", "--no-report")
    assert call(*arguments, "--out", whole).exit_code == 0
    going = Command(*arguments, "--out", ended, "--checkpoint", "0.1", "--pace", "1")
    until((ended / "checkpoint.zip").exists)
    going.send_signal(number)
    assert going.wait().status in (-signal.SIGKILL, 1)
    results: list[Result] = []

    def resumed() -> bool:
        results.append(call("resume", ended, "--no-report"))
        return "the run still goes on" not in results[-1].output  # as long as its process is not wholly gone

    until(resumed)
    assert results[-1].exit_code == 0, results[-1].output
    assert (ended / "signals.parquet").read_bytes() == (whole / "signals.parquet").read_bytes()


def test_a_run_of_an_ssp_goes_on_with_that_file_alone(tmp_path: Path):
    file, whole = failing_ssp(tmp_path, "gain"), tmp_path / "whole"
    killed = killed_run(tmp_path / "killed", 0.6, "run", file, "--no-report", "--checkpoint", "0.2")
    assert call("run", file, "--no-report", "--out", whole).exit_code == 0
    content = file.read_bytes()
    file.write_bytes(content + b" ")
    assert "gain.ssp is not the file that the run began with" in refusal("resume", killed)
    file.write_bytes(content)
    assert call("resume", killed, "--no-report").exit_code == 0
    assert_same(killed, whole)


@pytest.mark.parametrize("name", SCENARIOS)
def test_what_judges_a_run_can_be_kept(name: str):
    experiment = SCENARIOS[name]()
    evaluator = experiment.evaluator(parse_parameters(SCENARIOS[name], []))
    other = experiment.evaluator(parse_parameters(SCENARIOS[name], []))
    other.set_state(evaluator.get_state())
    assert other.get_state() == evaluator.get_state()


@pytest.fixture(scope="module")
def left(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Leave a run that was killed at 0.3 s of 0.5, with figures to be drawn."""
    folder = tmp_path_factory.mktemp("left") / "run"
    scene = folder.with_name("scene.fmu")
    shutil.copy(cached("GraspScene", 3), scene)
    arguments = ("run", "ir_grasp", "--unit", f"scene={scene}", "--checkpoint", "0.1", "--stop", "0.5")
    return killed_run(folder, 0.3, *arguments)


@pytest.fixture
def copy(left: Path, tmp_path: Path) -> Path:
    """Copy it."""
    return Path(shutil.copytree(left, tmp_path / "run"))


def test_page_and_figures_of_the_part_do_not_outlast_going_on_without_a_report(copy: Path):
    (copy / "report.html").write_text("of the part")
    (copy / "figures" / "part.png").write_text("of the part")
    result = call("resume", copy, "--no-report")
    assert result.exit_code == 1, result.output  # it ends before the grasp
    assert Record(copy / "signals.parquet").time[-1] >= 0.5
    assert not (copy / "report.html").exists()
    assert not (copy / "figures").exists()


def refusal_of(folder: Path) -> str:
    """Check that a run is refused in a line, and left as it is but for its record; return the line."""
    before = {p: p.read_bytes() for p in folder.rglob("*") if p.is_file() and "signals" not in p.name}
    (line,) = [line for line in refusal("resume", folder).splitlines() if not line.startswith("this runs ")]
    assert {p: p.read_bytes() for p in before} == before
    return re.sub(r"\(here [^)]*\)", "(here ...)", line.replace(f"(process {os.getpid()})", "(process PID)"))


@pytest.mark.parametrize("other", [{"seed": 9}, {"parameters": {"strategy": "blind"}}])
def test_a_checkpoint_of_another_run_is_refused(copy: Path, other: dict[str, Any]):
    (copy / "run.json").write_text(json.dumps({**data_in(copy, "run"), **other}))
    assert "it is of another run" in refusal_of(copy)


def with_part(
    copy: Path, part: str, content: bytes, kind: int = zipfile.ZIP_STORED, *, keep_digest: bool = False
) -> None:
    """Put something else in the place of a part of the checkpoint, and in that of its digest, or keep that."""
    checkpoint = copy / "checkpoint.zip"
    with zipfile.ZipFile(checkpoint) as archive:
        parts = {name: archive.read(name) for name in archive.namelist()}
    assert part in parts
    if part != "checkpoint.json" and not keep_digest:
        header = json.loads(parts["checkpoint.json"])
        header["sha256"][part] = hashlib.sha256(content).hexdigest()
        parts["checkpoint.json"] = json.dumps(header).encode()
    with zipfile.ZipFile(checkpoint, "w", kind) as archive:
        for name, whole in (parts | {part: content}).items():
            archive.writestr(name, whole)


Damage = Callable[[Path], object]


def text(file: str, content: str) -> Damage:
    return lambda copy: (copy / file).write_text(content)


def part(name: str) -> Damage:
    """Change a part of the checkpoint; the zip's own checksums are right: whoever writes it again writes those too."""
    return lambda copy: with_part(copy, name, b"of another run", keep_digest=True)


def kept(edit: Callable[[Any], Any]) -> Damage:
    """Change what the checkpoint keeps of the scenario."""

    def damage(copy: Path) -> None:
        with zipfile.ZipFile(copy / "checkpoint.zip") as archive:
            found = unpack_state(archive.read("kept"), resumption.RECORDS)
        with_part(copy, "kept", pack_state(edit(found), resumption.RECORDS))

    return damage


def cut(copy: Path) -> None:
    content = (copy / "checkpoint.zip").read_bytes()
    (copy / "checkpoint.zip").write_bytes(content[: len(content) // 2])


def of_numpy_1(copy: Path) -> None:
    data = data_in(copy, "run")
    data["versions"]["numpy"] = "1.0"
    (copy / "run.json").write_text(json.dumps(data))


COMPLETE = '{"complete": true, "success": true, "reason": "", "metrics": {}}'
DAMAGES: dict[str, tuple[Damage, bool]] = {
    "run.json is cut": (text("run.json", "{"), False),
    "run.json is a list": (text("run.json", "[]"), False),
    "versions are a list": (text("run.json", '{"versions": []}'), False),
    "versions are unknown": (text("run.json", '{"scenario": "ir_grasp", "parameters": {}}'), False),
    "of another version": (of_numpy_1, False),
    "complete": (text("summary.json", COMPLETE), False),
    "no checkpoint": (lambda copy: (copy / "checkpoint.zip").unlink(), True),
    "the checkpoint is cut": (cut, True),
    "no record": (lambda copy: (copy / "signals.arrows").unlink(), False),
    **{f"another {name}": (part(name), True) for name in ("0.state", "0.contents", "0.cpu", "kept")},
    "compressed": (lambda copy: with_part(copy, "kept", b"\0" * 10_000_000, zipfile.ZIP_DEFLATED), False),
    "another evaluator": (kept(lambda k: replace(k, evaluator=pack_state({"a": 1}))), False),
    "a bad parameter": (kept(lambda k: replace(k, parameters={**k.parameters, "standoff": "far"})), False),
    "too few parameters": (kept(lambda k: replace(k, parameters={"standoff": "0.07"})), False),
    "options for what is kept": (kept(lambda k: k.options), False),
}
"""What is done to a run's folder, and whether its record is whole afterwards nonetheless."""


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_run_that_cannot_go_on_is_refused_and_its_record_is_whole(damage: str, copy: Path, wording: Wording):
    spoil, recovered = DAMAGES[damage]
    spoil(copy)
    wording.check(refusal_of(copy))
    assert not recovered or Record(copy / "signals.parquet").time[-1] >= 0.3  # all that had been recorded


def test_a_run_that_goes_on_or_that_another_process_is_about_to_go_on_with_is_refused(copy: Path, wording: Wording):
    with open(copy / "signals.tail", "rb") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        wording.check(refusal_of(copy))
    with RunFolder.of_run(copy).held():
        wording.check(refusal_of(copy))
    assert not (copy / "signals.parquet").exists()
    (copy / "checkpoint.zip").unlink()
    assert "there is no checkpoint" in refusal_of(copy)  # who held it has let go of it


def test_fmus_that_changed_are_refused_by_name(copy: Path, left: Path):
    scene = left.with_name("scene.fmu")
    content = scene.read_bytes()
    try:
        with zipfile.ZipFile(scene, "a") as archive:
            archive.writestr("documentation/more.txt", "more")
        assert f"these FMUs are not those that the run began with: scene ({scene})" in refusal_of(copy)
    finally:
        scene.write_bytes(content)
    assert Record(copy / "signals.parquet").time[-1] >= 0.3


def test_a_scenario_whose_code_changed_is_refused_before_it_is_imported(copy: Path, tmp_path: Path, wording: Wording):
    marker = tmp_path / "marker"
    (tmp_path / "changed_scene.py").write_text(f"open({str(marker)!r}, 'w')\n", encoding="utf-8")
    data = data_in(copy, "run")
    data["source"] = {"scenario": "changed_scene:Scene", "folder": str(tmp_path), "sha256": "0"}
    (copy / "run.json").write_text(json.dumps(data))
    wording.check(refusal_of(copy))
    assert not marker.exists()


def test_a_built_unit_that_was_damaged_is_built_again_with_a_note(
    copy: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
):
    monkeypatch.setenv("HANDOVER_CACHE", str(tmp_path / "cache"))
    unit = cached("IrReflex", 3)
    data = data_in(copy, "run")
    data["files"]["reflex"] = str(unit)
    (copy / "run.json").write_text(json.dumps(data))
    sound = unit.read_bytes()
    unit.write_bytes(sound[: len(sound) // 2])
    result = call("resume", copy, "--no-report")
    assert result.exit_code == 1, result.output  # it ends before the grasp
    assert unit.read_bytes() == sound
    assert sum(record.getMessage().startswith(f"{unit} is built again: ") for record in caplog.records) == 1


def test_units_that_do_not_save_their_states_are_refused_at_the_start(tmp_path: Path, wording: Wording):
    def unable(text: str) -> str:
        return text.replace('canSerializeFMUState="true"', "")

    scene, out = described_otherwise(cached("GraspScene", 3), tmp_path / "unable.fmu", unable), tmp_path / "out"
    wording.check(refusal("run", "ir_grasp", "--unit", f"scene={scene}", "--out", out, "--checkpoint", "1"))
    assert not out.exists()


@pytest.mark.parametrize("part", ["checkpoint.json", "0.state", "0.contents", "0.cpu", "kept", "evaluator"])
def test_a_pickle_in_a_checkpoint_is_refused_and_not_executed(part: str, copy: Path, tmp_path: Path):
    planted, mark = planted_pickle(tmp_path)
    if part == "evaluator":
        kept(lambda k: replace(k, evaluator=planted))(copy)
    else:
        with_part(copy, part, planted + b"\0" * (-len(planted) % 8 + 1))
    result = call("resume", copy, "--no-report")
    assert result.exit_code in (2, 3), result.output
    assert len(result.output.splitlines()) <= 3, result.output
    assert part != "evaluator" or "what it keeps of the scenario cannot be read: " in result.output
    assert not mark.exists()
    assert not (copy / "report.html").exists()
