"""A campaign loses and repeats no run when a run server or its command is killed."""

import os
import signal
from pathlib import Path

import pytest
from support.campaigns import carried_out, short_plan
from support.cosim.native_units import native_fmu
from support.processes import servers
from support.sweep_process import ended, runs_in, sweeping, wait_for, without_times

from handover.scenarios.runs.campaign.folder import CampaignFolder
from handover.scenarios.runs.campaign.table import CampaignTable

pytestmark = pytest.mark.slow

POINTS, REPETITIONS = 4, 4
RUNS = POINTS * REPETITIONS


def test_a_command_that_is_killed_goes_on_with_the_same_call(tmp_path: Path):
    """And as it goes on, one of its run servers is killed."""
    plan = short_plan(points=[{"m": str(m)} for m in range(1, POINTS + 1)], repetitions=REPETITIONS)
    undisturbed = carried_out(plan, tmp_path / "undisturbed").path
    out = tmp_path / "c"
    call = [str(native_fmu("mass")), f"m=1:4:{POINTS}", "-p", "f=1", "--repeat", str(REPETITIONS), "--pace", "2"]
    call += ["--no-report", "--workers", "2", "--out", str(out)]
    with sweeping(*call) as going:
        wait_for(lambda: len(runs_in(out)) >= RUNS // 4 and CampaignFolder(out).table.exists(), going)
        going.send_signal(signal.SIGKILL)
        going.wait()
    before = runs_in(out)
    assert RUNS // 4 <= len(before) < RUNS
    assert len(CampaignTable.read(out)) <= len(before)
    with sweeping(*call) as going:
        wait_for(lambda: len(runs_in(out)) > len(before), going)
        os.kill(servers(going.pid)[0], signal.SIGKILL)
        status, value, errors = ended(going)
    assert status == 0, errors
    assert f"{RUNS} of {RUNS} runs done" in value
    assert before.items() <= runs_in(out).items()
    table = CampaignTable.read(out)
    assert len(table) == len(set(table.column("run"))) == len(set(table.column("seed"))) == RUNS
    assert set(table.column("status")) == {"done"}
    assert {p.name for p in (out / "runs").iterdir()} == set(table.column("run"))
    assert without_times(out) == without_times(undisturbed)
