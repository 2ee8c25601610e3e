"""Rounds that are carried out again from their recorded inputs: the same bytes, or the first difference."""

import contextlib
import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow
import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner, Result
from support.scenarios.sample_study import record, same, session, write_study

from handover.cosim.record.reader import Record
from handover.cosim.system.time_series import TimeSeries
from handover.scenarios.cli.command import main
from handover.scenarios.runs.execution.interruption import Interruption
from handover.scenarios.runs.execution.request import RunRequest
from handover.scenarios.runs.execution.runner import run_task
from handover.scenarios.runs.results.task import InputSources, Task
from handover.scenarios.study.folder.study_folder import StudyFolder
from handover.scenarios.study.plan.led_hands import led_hand_of, round_parameters
from handover.scenarios.study.plan.plan import default_plan, parse_plan
from handover.scenarios.study.session import round_check
from handover.scenarios.study.session.round_check import first_difference

pa: Any = pyarrow
PLAN = parse_plan(f"{default_plan()}\n[parameters]\npatience = 1.0\n")


def checked(out: Path) -> Result:
    return CliRunner().invoke(main, ["study", "replay", str(out), "P01", "1", "--check"])


@pytest.fixture(scope="module")
def played(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a study whose first round was played by a hand that was led to and fro from outside; not to be changed."""
    out = tmp_path_factory.mktemp("study") / "out"
    folder = StudyFolder.opened(out, PLAN).begin(session(1, PLAN))
    planned = folder.rounds[0]
    given = round_parameters(planned.condition)
    led = led_hand_of(planned.condition.scenario, given)
    t = np.arange(0.0, 100.0, 0.02)
    p_WH = np.array(led.p_WH_0) + 0.1 * np.sin(t)[:, None] * np.array([0.0, 1.0, 0.5])
    q_WH = np.tile([1.0, 0.0, 0.0, 0.0], (len(t), 1))
    values = [p_WH, q_WH, np.zeros((len(t), 14)), (np.sin(3.0 * t) > 0.0)[:, None].astype(np.float64)]
    series = {name: TimeSeries(t, v, linear=False) for name, v in zip(led.inputs, values, strict=True)}
    series[led.age] = TimeSeries(t, np.full((len(t), 1), 0.01), linear=False)
    with contextlib.ExitStack() as opened:
        task = RunRequest(
            subject=planned.condition.scenario,
            parameters=given,
            seed=planned.seed,
            out=folder.run_folder(1),
            presented=False,
            sources=InputSources(series, {"from": "page"}, is_complete=True),
        ).task(opened)
        run_task(task, lambda _t, _end: None, Interruption())
    folder.record_round(1, record())
    return out


def test_a_round_is_the_same_byte_for_byte_when_carried_out_again(played: Path):
    done = checked(played)
    assert done.exit_code == 0, done.output
    hand = Record(StudyFolder.read(played).session(1).run_folder(1) / "signals.parquet")
    assert f"the same byte for byte when carried out again, {len(hand.signals)} signals in" in done.output
    assert np.ptp(hand["person.p_WH"][:, 1]) > 0.05
    assert "other versions" not in done.output


def test_a_changed_record_and_other_versions_are_reported(
    played: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    out = shutil.copytree(played, tmp_path / "out")
    folder = StudyFolder.read(out).session(1).run_folder(1)
    sound = shutil.copytree(folder, tmp_path / "sound")

    def repeat(task: Task, *_: object) -> None:
        shutil.copytree(sound, task.folder.path, dirs_exist_ok=True)

    monkeypatch.setattr(round_check, "run_task", repeat)
    table: Any = pq.read_table(folder / "signals.parquet")
    name = next(n for n in table.column_names if n.startswith("person.p_WH["))
    values = table.column(name).to_numpy().copy()
    row, was = len(values) // 2, float(values[len(values) // 2])
    values[row] = np.nextafter(was, 1.0)
    field = table.schema.field(name)
    table = table.set_column(table.schema.get_field_index(name), field, pa.array(values, field.type))
    pq.write_table(table, folder / "signals.parquet")
    about = json.loads((folder / "run.json").read_text(encoding="utf-8"))
    about["versions"]["handover-cosim"] = "0.0.1"
    (folder / "run.json").write_text(json.dumps(about), encoding="utf-8")
    done = checked(out)
    assert done.exit_code == 1, done.output
    reported = f"first in {name} at {float(table.column('time')[row].as_py())!r} s: "
    assert f"{reported}{float(values[row])!r} in the record, {was!r} in the repeated run" in done.output
    assert "P01, round 1 was recorded by other versions: handover-cosim 0.0.1 (here " in done.output


def test_the_first_difference_is_the_first_in_time(tmp_path: Path):
    def of(name: str, **signals: list[float]) -> Record:
        pq.write_table(pa.table({"time": [0.0, 0.1, 0.2], **signals}), tmp_path / name)
        return Record(tmp_path / name)

    one = of("one", a=[1.0, 2.0, 3.0], b=[float("nan"), 5.0, 6.0])
    assert first_difference(one, of("same", a=[1.0, 2.0, 3.0], b=[float("nan"), 5.0, 6.0])) is None
    reported = first_difference(one, of("other", a=[1.0, 2.0, -3.0], b=[float("nan"), -5.0, 6.0]))
    assert reported == "b at 0.1 s: 5.0 in the record, -5.0 in the repeated run"
    assert first_difference(one, of("less", a=[1.0, 2.0, 3.0])) == "b: in the record alone"


def test_a_round_without_a_record_cannot_be_checked(tmp_path: Path):
    write_study(tmp_path / "out", 1, same)
    done = checked(tmp_path / "out")
    assert done.exit_code == 2
    assert "played to its end" in done.output
