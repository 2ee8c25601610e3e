"""A campaign of 60 runs loses and repeats no run when a worker or its command is killed."""

import signal
from pathlib import Path

import pytest
from clusters import scheduler, worker
from sweep_process import ended, runs_in, sweeping, wait_for, without_times, workers_of

from handover.scenarios.campaign.table import CampaignTable

pytestmark = pytest.mark.slow

OF_EACH = ["helix_handover", "alpha=0.1:0.4:6", "--seed", "7", "-p", "patience=1", "--no-report", "--repeat"]
CALL = [*OF_EACH, "10"]


@pytest.fixture(scope="module")
def worker_killed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A campaign by workers that a user has started, one of which was killed; its runs until then were not repeated."""
    folder = tmp_path_factory.mktemp("cluster")
    out = folder / "c"
    with (
        scheduler(folder) as address,
        worker(folder, address) as nanny,
        worker(folder, address),
        sweeping(*CALL, "--scheduler", address, "--out", out) as going,
    ):
        wait_for(lambda: len(runs_in(out)) >= 15, going)
        before = runs_in(out)
        workers_of(nanny)[0].kill()
        status, _, errors = ended(going)
    assert status == 0, errors
    assert before.items() <= runs_in(out).items()
    return out


def test_a_worker_that_is_killed_costs_no_run(worker_killed: Path, tmp_path: Path):
    table = CampaignTable.read(worker_killed)
    assert len(table) == len(set(table.column("run"))) == len(set(table.column("seed"))) == 60
    assert set(table.column("status")) == {"done"}
    assert set(runs_in(worker_killed)) == set(table.column("run"))
    assert list((worker_killed / "runs").glob(".*")) == []
    with sweeping(*OF_EACH, "2", "--workers", "2", "--out", tmp_path / "undisturbed") as going:
        status, _, errors = ended(going)
    assert status == 0, errors
    first = [row for row in without_times(worker_killed) if row["repetition"] < 2]
    assert without_times(tmp_path / "undisturbed") == first


def test_a_command_that_is_killed_goes_on_with_the_same_call(worker_killed: Path, tmp_path: Path):
    out = tmp_path / "c"
    with sweeping(*CALL, "--workers", "2", "--out", out) as going:
        wait_for(lambda: len(runs_in(out)) >= 25, going)
        going.send_signal(signal.SIGKILL)
        going.wait()
    before = runs_in(out)
    assert 25 <= len(before) < 60
    assert len(CampaignTable.read(out)) <= len(before)
    with sweeping(*CALL, "--workers", "2", "--out", out) as going:
        wait_for(lambda: len(runs_in(out)) >= 40, going)
        workers_of(going.pid)[0].kill()
        status, value, errors = ended(going)
    assert status == 0, errors
    assert "60 of 60 runs done" in value
    assert before.items() <= runs_in(out).items()
    assert without_times(out) == without_times(worker_killed)
    assert list((out / "runs").glob(".*")) == []
