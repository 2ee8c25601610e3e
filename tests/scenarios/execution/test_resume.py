import hashlib
import json
import shutil
import signal
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import pytest
from click.testing import CliRunner, Result
from killed_run import end_between
from planted import planted_pickle

from handover.cosim.blocks.state import pack_state, unpack_state
from handover.cosim.record.reader import Record
from handover.fmus.build import cached
from handover.scenarios.catalog import SCENARIOS
from handover.scenarios.cli.command import main
from handover.scenarios.cli.summaries.run import print_summary
from handover.scenarios.execution import resumption
from handover.scenarios.experiment.experiment import Outcome
from handover.scenarios.experiment.parameters import parse_parameters
from handover.scenarios.results.folder_data import Summary
from handover.scenarios.results.run_folder import RunFolder
from handover.scenarios.results.summary import RunResult

fcntl = pytest.importorskip("fcntl")

OF_TIME = ("cpu_", "pace_", "peak_memory")


def call(*arguments: str | Path) -> Result:
    return CliRunner().invoke(main, [str(a) for a in arguments])


def summary_of(folder: Path) -> dict[str, Any]:
    """Return all of a summary that measures no time."""
    data = json.loads((folder / "summary.json").read_text())
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
    data, wanted = (json.loads((folder / "run.json").read_text()) for folder in (joined, whole))
    assert data | {"checkpoint": None} == wanted


def slow(*values: Any) -> Any:
    return pytest.param(*values, marks=pytest.mark.slow)


@pytest.mark.parametrize(
    ("scenario", "every", "passed", "number"),
    [
        slow("ir_grasp -p strategy=forward -p forward=0.055 --format csv --format mat", 0.7, 1.6, signal.SIGKILL),
        slow("ir_grasp", 3, 7, signal.SIGKILL),
        slow("ir_grasp", 3, 7, signal.SIGINT),
        slow("flyer_robot_to_human", 4, 9, signal.SIGKILL),
        slow("vsl_hybrid", 0.5, 1.2, signal.SIGKILL),
        slow("helix_handover -p alpha=0.4 -p tuning=thesis", 2, 5, signal.SIGKILL),
    ],
)
def test_a_run_that_was_ended_goes_on_to_what_it_would_have_been(
    tmp_path: Path, scenario: str, every: float, passed: float, number: signal.Signals
):
    killed, whole = tmp_path / "killed", tmp_path / "whole"
    waits = passed + every / 3
    arguments = ("run", *scenario.split(), "--seed", "3", "--out")
    ended = end_between(passed, waits, number, *arguments, killed, "--checkpoint", str(every))
    assert ended in (-signal.SIGKILL, 1)
    assert call(*arguments, whole).exit_code == 0
    (killed / "checkpoint.zip.part").write_text("of a process that crashed while it wrote one")
    RunFolder.of_run(killed).add_to_run(failure={"kind": "killed"})  # as the supervisor does for a crashed run
    result = call("resume", killed)
    assert result.exit_code == 0, result.output
    assert_same(killed, whole)
    assert Record(killed / "signals.parquet").time[-1] > waits


@pytest.mark.slow
def test_a_run_of_an_ssp_goes_on(tmp_path: Path):
    killed, whole, file = tmp_path / "killed", tmp_path / "whole", tmp_path / "grasp.ssp"
    assert call("export", "ir_grasp", "--ssp", file).exit_code == 0
    arguments = ("run", file, "--stop", "4", "--out")
    end_between(2.1, 2.5, signal.SIGKILL, *arguments, killed, "--checkpoint", "1")
    assert call(*arguments, whole).exit_code == 0
    content = file.read_bytes()
    file.write_bytes(content + b" ")
    result = call("resume", killed)
    assert result.exit_code == 2
    assert "grasp.ssp is not the file that the run began with" in result.output
    file.write_bytes(content)
    result = call("resume", killed)
    assert result.exit_code == 0, result.output
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
    """Leave a run that was killed early."""
    folder = tmp_path_factory.mktemp("left") / "run"
    scene = folder.with_name("scene.fmu")
    shutil.copy(cached("GraspScene", 3), scene)
    end_between(
        0.3, 0.35, signal.SIGKILL, "run", "ir_grasp", "--unit", f"scene={scene}", "--out", folder, "--checkpoint", "0.1"
    )
    return folder


@pytest.fixture
def copy(left: Path, tmp_path: Path) -> Path:
    """Copy it."""
    return Path(shutil.copytree(left, tmp_path / "run"))


def test_page_and_figures_of_the_part_do_not_outlast_going_on_without_a_report(copy: Path):
    (copy / "report.html").write_text("of the part")
    (copy / "figures" / "part.png").write_text("of the part")
    result = call("resume", copy, "--no-report")
    assert result.exit_code == 0, result.output
    assert not (copy / "report.html").exists()
    assert not (copy / "figures").exists()


def test_a_run_that_can_go_on_is_reported_how(copy: Path, capsys: pytest.CaptureFixture[str]):
    summary: dict[str, Any] = {
        "scenario": "ir_grasp",
        "success": False,
        "reason": "interrupted",
        "metrics": {},
        "simulated_seconds": 0.3,
        "wall_seconds": 1.0,
    }
    ended = RunResult(outcome=Outcome(success=False, reason="interrupted"), summary=cast(Summary, summary))
    print_summary(ended, (), RunFolder.of_run(copy))
    assert f"to resume: handover resume {copy}\n" in capsys.readouterr().out
    (copy / "checkpoint.zip").unlink()
    print_summary(ended, (), RunFolder.of_run(copy))
    assert "to resume" not in capsys.readouterr().out


def errors_of(result: Result) -> list[str]:
    """Return the lines that are printed, but for those that say which own code is about to be run."""
    return [line for line in result.output.splitlines() if not line.startswith("this runs ")]


def assert_refused(folder: Path, data: str) -> None:
    before = {p: p.read_bytes() for p in folder.rglob("*") if p.is_file() and "signals" not in p.name}
    result = call("resume", folder)
    assert result.exit_code == 2, result.output
    assert data in result.output
    assert len(errors_of(result)) == 1
    assert {p: p.read_bytes() for p in before} == before


def assert_record_is_whole(folder: Path) -> None:
    """Check that no row is lost which the killed process had recorded."""
    assert Record(folder / "signals.parquet").time[-1] >= 0.3


def test_a_folder_of_no_run_is_refused(tmp_path: Path):
    assert_refused(tmp_path, "it is not the folder of a run: it has no run.json")
    assert list(tmp_path.iterdir()) == []


def test_a_damaged_configuration_is_refused(copy: Path):
    (copy / "run.json").write_text("{")
    assert_refused(copy, "its run.json is damaged")
    (copy / "run.json").write_text("[]")
    assert_refused(copy, "its run.json is damaged: Expected `object`")
    (copy / "run.json").write_text('{"versions": []}')
    assert_refused(copy, "its run.json is damaged: ")
    (copy / "run.json").write_text('{"scenario": "ir_grasp", "parameters": {}}')
    assert_refused(copy, "the run began with other versions: python None (here ")


def test_a_complete_run_is_refused(copy: Path):
    (copy / "summary.json").write_text('{"complete": true, "success": true, "reason": "", "metrics": {}}')
    assert_refused(copy, "the run is complete")


def test_a_run_that_goes_on_is_refused(copy: Path):
    with open(copy / "signals.tail", "rb") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        assert_refused(copy, "the run still goes on")
    assert not (copy / "signals.parquet").exists()


def test_a_run_that_another_process_is_about_to_go_on_with_is_refused(copy: Path):
    with RunFolder.of_run(copy).held():
        assert_refused(copy, "the run still goes on")
    assert not (copy / "signals.parquet").exists()
    (copy / "checkpoint.zip").unlink()
    assert_refused(copy, "there is no checkpoint")  # who held it has let go of it


def test_a_run_without_a_checkpoint_is_refused_and_its_record_is_whole(copy: Path):
    (copy / "checkpoint.zip").unlink()
    assert_refused(copy, "there is no checkpoint; a run writes them with --checkpoint SECONDS")
    assert_record_is_whole(copy)


def test_a_damaged_checkpoint_is_refused_and_the_record_is_whole(copy: Path):
    content = (copy / "checkpoint.zip").read_bytes()
    (copy / "checkpoint.zip").write_bytes(content[: len(content) // 2])
    assert_refused(copy, "the checkpoint is damaged")
    assert_record_is_whole(copy)


@pytest.mark.parametrize("part", ["0.state", "0.contents", "0.cpu", "kept"])
def test_a_part_of_a_checkpoint_that_has_changed_is_refused_before_a_unit_gets_it(copy: Path, part: str):
    """The zip's own checksums are right: whoever writes it again writes those too."""
    with_part(copy, part, b"of another run", keep_digest=True)
    assert_refused(copy, f"the checkpoint is damaged: {part} in it is not what was written")
    assert_record_is_whole(copy)


def test_a_record_that_is_shorter_than_the_checkpoint_is_refused(copy: Path):
    (copy / "signals.arrows").unlink()
    assert_refused(copy, "rows, the record beside it has 0")


def test_fmus_that_changed_are_refused_by_name(copy: Path, left: Path):
    scene = left.with_name("scene.fmu")
    content = scene.read_bytes()
    try:
        with zipfile.ZipFile(scene, "a") as archive:
            archive.writestr("documentation/more.txt", "more")
        assert_refused(copy, f"these FMUs are not those that the run began with: scene ({scene})")
    finally:
        scene.write_bytes(content)
    assert_record_is_whole(copy)


def test_a_scenario_whose_code_changed_is_refused_before_it_is_imported(copy: Path, tmp_path: Path):
    marker = tmp_path / "marker"
    (tmp_path / "changed_scene.py").write_text(f"open({str(marker)!r}, 'w')\n", encoding="utf-8")
    data = json.loads((copy / "run.json").read_text())
    data["source"] = {"scenario": "changed_scene:Scene", "folder": str(tmp_path), "sha256": "0"}
    (copy / "run.json").write_text(json.dumps(data))
    assert_refused(copy, f"its code, {tmp_path / 'changed_scene.py'}, is not what the run had")
    assert not marker.exists()


def test_a_built_unit_that_was_damaged_is_built_again_with_a_note(
    copy: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
):
    monkeypatch.setenv("HANDOVER_CACHE", str(tmp_path / "cache"))
    unit = cached("IrReflex", 3)
    data = json.loads((copy / "run.json").read_text())
    data["files"]["reflex"] = str(unit)
    (copy / "run.json").write_text(json.dumps(data))
    sound = unit.read_bytes()
    unit.write_bytes(sound[: len(sound) // 2])
    result = call("resume", copy, "--no-report")
    assert result.exit_code == 0, result.output
    assert unit.read_bytes() == sound
    assert sum(record.getMessage().startswith(f"{unit} is built again: ") for record in caplog.records) == 1


def test_other_versions_are_refused_by_name(copy: Path):
    data = json.loads((copy / "run.json").read_text())
    data["versions"]["numpy"] = "1.0"
    (copy / "run.json").write_text(json.dumps(data))
    assert_refused(copy, "the run began with other versions: numpy 1.0 (here 2.")


def test_units_that_do_not_save_their_states_are_refused_at_the_start(tmp_path: Path):
    unable = tmp_path / "unable.fmu"
    with zipfile.ZipFile(cached("GraspScene", 3)) as source, zipfile.ZipFile(unable, "w") as target:
        for name in source.namelist():
            content = source.read(name)
            if name == "modelDescription.xml":
                assert b'canSerializeFMUState="true"' in content
                content = content.replace(b'canSerializeFMUState="true"', b"")
            target.writestr(name, content)
    out = tmp_path / "out"
    result = call("run", "ir_grasp", "--unit", f"scene={unable}", "--out", out, "--checkpoint", "1")
    assert result.exit_code == 2, result.output
    assert "scene: unable.fmu lacks canSerializeFMUState" in result.output
    assert not out.exists()


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


@pytest.mark.parametrize("part", ["checkpoint.json", "0.state", "0.contents", "0.cpu", "kept"])
def test_a_pickle_in_a_checkpoint_is_refused_and_not_executed(part: str, copy: Path, tmp_path: Path):
    planted, mark = planted_pickle(tmp_path)
    with_part(copy, part, planted + b"\0" * (-len(planted) % 8 + 1))
    result = call("resume", copy)
    assert result.exit_code in (2, 3), result.output
    assert len(errors_of(result)) <= 2, result.output
    assert not mark.exists()
    assert not (copy / "report.html").exists()


def kept_in(copy: Path) -> Any:
    with zipfile.ZipFile(copy / "checkpoint.zip") as archive:
        return unpack_state(archive.read("kept"), resumption.RECORDS)


def test_a_pickle_in_the_evaluators_state_is_refused_and_not_executed(copy: Path, tmp_path: Path):
    planted, mark = planted_pickle(tmp_path)
    kept = kept_in(copy)
    with_part(copy, "kept", pack_state(replace(kept, evaluator=planted), resumption.RECORDS))
    assert_refused(copy, "what it keeps of the scenario cannot be read: ")
    with_part(copy, "kept", pack_state(replace(kept, evaluator=pack_state({"a": 1})), resumption.RECORDS))
    assert_refused(copy, "it is not the state of a GraspEvaluator")
    with_part(
        copy, "kept", pack_state(replace(kept, parameters={**kept.parameters, "standoff": "far"}), resumption.RECORDS)
    )
    assert_refused(copy, "standoff: 'far' is not a number")
    with_part(copy, "kept", pack_state(replace(kept, parameters={}), resumption.RECORDS))
    assert_refused(copy, "the parameters of ir_grasp are others")
    with_part(copy, "kept", pack_state(kept.options, resumption.RECORDS))
    assert_refused(copy, "what it keeps")
    assert not mark.exists()


def test_a_compressed_checkpoint_is_refused(copy: Path):
    """It could be of any size once it is read."""
    with_part(copy, "kept", b"\0" * 10_000_000, zipfile.ZIP_DEFLATED)
    assert_refused(copy, "is compressed; checkpoints are written without")
