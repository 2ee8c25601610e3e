"""Ctrl-C and SIGTERM end a campaign cleanly; no process that it started remains."""

import os
import signal
import time
from pathlib import Path

import psutil
import pytest
from support.cosim.native_units import native_fmu
from support.sweep_process import ended, runs_in, sweeping, wait_for

from handover.scenarios.cli.campaign import CampaignInterruption
from handover.scenarios.runs.campaign.table import CampaignTable

pytestmark = pytest.mark.slow

CALL = [str(native_fmu("mass")), "--repeat", "200", "--pace", "5", "--workers", "1", "--no-report"]


def test_a_sigterm_ends_it_in_order(tmp_path: Path):
    out = tmp_path / "c"
    with sweeping(*CALL, "--out", out) as going:
        wait_for(lambda: len(runs_in(out)) >= 3, going)
        family = psutil.Process(going.pid).children(recursive=True)
        going.send_signal(signal.SIGTERM)
        status, value, errors = ended(going)
        assert psutil.wait_procs(family, timeout=60)[1] == []
    done = len(runs_in(out))
    assert (status, value) == (1, "")
    assert errors.splitlines()[-1] == f"{done} of 200 runs done in {out}; run the same command again to resume"
    assert 3 <= len(CampaignTable.read(out)) == done < 200
    assert list((out / "runs").glob(".*")) == []
    assert list(out.glob("*.part")) == []


def test_ctrl_c_before_the_first_run_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """As units are built, which takes long enough to be met."""
    cache, out = tmp_path / "cache", tmp_path / "c"
    monkeypatch.setenv("HANDOVER_CACHE", str(cache))
    with sweeping("ir_grasp", *CALL[1:], "--out", out) as going:
        wait_for(cache.exists, going)
        going.send_signal(signal.SIGINT)
        status, value, errors = ended(going)
    assert (status, value, errors) == (130, "", "Aborted!\n")
    assert not out.exists()


def test_ctrl_c_as_workers_start_leaves_nothing_or_a_campaign_that_can_be_resumed(tmp_path: Path):
    out = tmp_path / "c"
    with sweeping(*CALL, "--out", out) as going:
        wait_for(lambda: (out / "campaign.json").exists(), going)
        going.send_signal(signal.SIGINT)
        status, value, errors = ended(going)
    assert status in (130, 1)
    assert value == ""
    assert out.exists() is ("to resume" in errors)
    assert list(out.glob("runs/.*")) == []


@pytest.mark.skipif(not hasattr(os, "fork"), reason="Windows")
def test_a_second_signal_ends_it_at_once(capfd: pytest.CaptureFixture[str]):
    pid = os.fork()
    if pid == 0:
        with CampaignInterruption():
            try:
                os.kill(os.getpid(), signal.SIGINT)
                time.sleep(5)
            except KeyboardInterrupt:
                os.kill(os.getpid(), signal.SIGINT)
                time.sleep(5)
        os._exit(0)
    _, status = os.waitpid(pid, 0)
    assert os.waitstatus_to_exitcode(status) == 130
    assert capfd.readouterr().err == "Aborted!\n"
