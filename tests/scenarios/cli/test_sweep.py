"""`handover sweep`: its output, its exit status, and the usage errors."""

import contextlib
import sys
from collections.abc import Callable, Generator
from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from support.clusters import closed_port
from support.in_process_pool import LOCAL_CLUSTER, InProcessPool, local_cluster_of
from support.wording import Wording

from handover.cosim.files import folder_locked
from handover.fmus.build import cached
from handover.scenarios.campaign import plan_check
from handover.scenarios.campaign.plan import CampaignPlan
from handover.scenarios.campaign.table import CampaignTable
from handover.scenarios.campaign.worker_pool import RunJob
from handover.scenarios.cli.command import main
from handover.scenarios.execution.errors import ClusterLost, PoolError

CALL = [
    "sweep",
    "ir_grasp",
    "forward=0.03,0.1",
    "-p",
    "strategy=forward",
    "-p",
    "run_up=0",
    "--out",
    "c",
    "--no-report",
    "--workers",
    "2",
]
BEGINNING = "2 runs of ir_grasp on 2 workers into c\n"
ALL = ("000_forward=0.03_r0000", "001_forward=0.1_r0000")


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def sweep(
    monkeypatch: pytest.MonkeyPatch, *call: str, before: Callable[[RunJob], str] = lambda _job: ""
) -> tuple[Result, list[str]]:
    """Return how a command ended, and which runs it began."""
    pool = InProcessPool(before)
    monkeypatch.setitem(sys.modules, LOCAL_CLUSTER, local_cluster_of(pool))
    return CliRunner().invoke(main, call), pool.begun


def refuse_workers(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let no workers be had."""

    @contextlib.contextmanager
    def refuse(_workers: int | None) -> Generator[InProcessPool, None, None]:
        raise PoolError("there are none")
        yield InProcessPool()

    module = local_cluster_of(InProcessPool())
    monkeypatch.setattr(module, "local_cluster", refuse)
    monkeypatch.setitem(sys.modules, LOCAL_CLUSTER, module)


def raising(error: BaseException, at: int) -> Callable[[RunJob], str]:
    """Return what raises an error before the run of a number, from 0."""
    counted: list[str] = []

    def count(job: RunJob) -> str:
        counted.append(job.name)
        if len(counted) > at:
            raise error
        return ""

    return count


def test_a_campaign_ends_with_a_row_for_each_point(monkeypatch: pytest.MonkeyPatch):
    result, begun = sweep(monkeypatch, *CALL)
    assert result.exit_code == 0, result.output
    assert begun == list(ALL)
    assert "ir_grasp: 2 of 2 runs done" in result.output
    assert [line.split()[:5] for line in result.output.splitlines() if " of 1 " in line] == [
        ["0.03", "1", "0", "of", "1"],
        ["0.1", "1", "1", "of", "1"],
    ]
    assert "0 % to 98 %" in result.output
    assert "table: c/runs.parquet" in result.output


@pytest.mark.slow
def test_an_interrupted_call_goes_on(monkeypatch: pytest.MonkeyPatch):
    result, _ = sweep(monkeypatch, *CALL, before=raising(KeyboardInterrupt(), at=1))
    assert (result.exit_code, result.output) == (
        1,
        f"{BEGINNING}1 of 2 runs done in c; run the same command again to resume\n",
    )
    assert len(CampaignTable.read(Path("c"))) == 1
    result, begun = sweep(monkeypatch, *CALL)
    assert (result.exit_code, begun) == (0, [ALL[1]])


@pytest.mark.slow
def test_a_complete_campaign_starts_no_workers(here: Path, monkeypatch: pytest.MonkeyPatch):
    call = [text for text in CALL if text != "--no-report"]
    sweep(monkeypatch, *call)
    written = [(here / "c" / name).stat().st_mtime_ns for name in ("runs.parquet", "report.html")]
    refuse_workers(monkeypatch)
    result = CliRunner().invoke(main, call)
    assert result.exit_code == 0, result.output
    assert result.stderr == "c has all of its runs; nothing was run\n"
    assert "2 of 2 runs done" in result.stdout
    assert [(here / "c" / name).stat().st_mtime_ns for name in ("runs.parquet", "report.html")] == written
    (here / "c" / "report.html").unlink()
    assert CliRunner().invoke(main, call).exit_code == 0
    assert (here / "c" / "report.html").is_file()


def test_a_run_that_cannot_be_read_is_repeated(here: Path, monkeypatch: pytest.MonkeyPatch):
    sweep(monkeypatch, *CALL)
    (here / "c" / "runs" / ALL[1] / "summary.json").write_text("{")
    result, begun = sweep(monkeypatch, *CALL)
    assert (result.exit_code, begun) == (0, [ALL[1]])


@pytest.mark.slow
def test_without_out_an_interrupted_call_goes_on_too(monkeypatch: pytest.MonkeyPatch):
    call = [text for text in CALL if text not in ("--out", "c")]
    result, _ = sweep(monkeypatch, *call, before=raising(KeyboardInterrupt(), at=1))
    (folder,) = Path("campaigns").iterdir()
    assert result.output.splitlines() == [
        f"2 runs of ir_grasp on 2 workers into {folder}",
        f"1 of 2 runs done in {folder}; run the same command again to resume",
    ]
    result, begun = sweep(monkeypatch, *call)
    assert (result.exit_code, begun) == (0, [ALL[1]])
    assert result.stderr == f"2 runs of ir_grasp on 2 workers into {folder}; 1 are done\n"
    assert list(Path("campaigns").iterdir()) == [folder]


@pytest.mark.slow
def test_a_lost_run_is_reported_by_the_status(monkeypatch: pytest.MonkeyPatch):
    result, _ = sweep(monkeypatch, *CALL, before=lambda job: "its machine burnt" if job.name == ALL[0] else "")
    assert result.exit_code == 3
    assert "1 of 2 runs done, 1 lost" in result.output
    assert "1 lost: its machine burnt" in result.output


@pytest.mark.slow
def test_workers_that_go_stop_it(monkeypatch: pytest.MonkeyPatch):
    result, _ = sweep(monkeypatch, *CALL, before=raising(ClusterLost("the scheduler is gone"), at=1))
    assert (result.exit_code, result.output) == (
        3,
        f"{BEGINNING}Error: the scheduler is gone; 1 of 2 runs done; run the same command again to resume\n",
    )


def test_workers_that_cannot_be_had_leave_nothing(here: Path, monkeypatch: pytest.MonkeyPatch):
    refuse_workers(monkeypatch)
    result = CliRunner().invoke(main, CALL)
    assert (result.exit_code, result.output) == (2, f"{BEGINNING}Error: there are none\n")
    assert list(here.iterdir()) == []


@pytest.mark.parametrize(
    "call",
    [
        ["ir_gasp"],
        ["my_plan.toml"],
        ["x.ssp"],
        ["x.fmu", "a=1,2"],
        ["x.fmu", "--seed", "3", "--unit", "a=b"],
        ["ir_grasp", "--step", "0.1"],
        ["ir_grasp", "thing=cylindr"],
        ["ir_grasp", "forward=0.1", "-p", "forward=0.2"],
        ["ir_grasp", "shift_least=0.01,0.06"],
        ["ir_grasp", "--unit", "sceen=x.fmu"],
        ["ir_grasp", "--unit", "scene=absent.fmu"],
        ["ir_grasp", "-p", "strategy=reflex,blind"],
        ["ir_grasp", "forward=0:0.3:20000", "--repeat", "9"],
        ["ir_grasp", "--workers", "2", "--scheduler", "tcp://h:1"],
        ["ir_grasp", "--first-step", "0.1"],
    ],
    ids=" ".join,
)
def test_usage_errors_are_reported_in_a_line_and_leave_nothing(
    here: Path, call: list[str], monkeypatch: pytest.MonkeyPatch, wording: Wording
):
    result, begun = sweep(monkeypatch, "sweep", *call)
    assert result.exit_code == 2
    assert len(result.output.splitlines()) == 1
    wording.check(result.output)
    assert begun == []
    assert list(here.iterdir()) == []


def test_a_campaign_under_way_is_refused_before_anything_else(here: Path, monkeypatch: pytest.MonkeyPatch):
    def build(_plan: CampaignPlan) -> dict[str, Path]:
        raise AssertionError("units are not to be built")

    monkeypatch.setattr(plan_check, "unit_fmus", build)
    (here / "c").mkdir()
    with folder_locked(here / "c"):
        result, begun = sweep(monkeypatch, *CALL)
    assert (result.exit_code, begun) == (2, [])
    assert result.output.startswith("Error: folder c: another command is running this campaign")


def test_a_scheduler_is_tried_before_units_are_built(here: Path, monkeypatch: pytest.MonkeyPatch):
    def build(_plan: CampaignPlan) -> dict[str, Path]:
        raise AssertionError("units are not to be built")

    monkeypatch.setattr(plan_check, "unit_fmus", build)
    address = f"127.0.0.1:{closed_port()}"
    result = CliRunner().invoke(main, [*CALL[:-2], "--scheduler", address])
    assert result.exit_code == 2
    assert result.output.startswith(f"Error: no scheduler can be reached at tcp://{address}: ")
    assert list(here.iterdir()) == []


def test_a_unit_in_a_place_that_it_does_not_fit_is_reported_at_once(here: Path, monkeypatch: pytest.MonkeyPatch):
    result, begun = sweep(monkeypatch, *CALL, "--unit", f"reflex={cached('GraspScene', 3)}")
    assert result.exit_code == 2, result.output
    assert "unit reflex (GraspScene) needs the output p_WH_cmd (real [2] m)" in result.output
    assert "its sigma_cmd is an input" in result.output
    assert begun == []
    assert list(here.iterdir()) == []


@pytest.mark.parametrize("option", [["--repeat", "0"], ["--repeat", "x"], ["--workers", "0"], ["--seed", "-1"]])
def test_options_out_of_range(option: list[str]):
    assert CliRunner().invoke(main, [*CALL, *option]).exit_code == 2
