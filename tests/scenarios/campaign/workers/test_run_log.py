"""A run of a campaign tells what its job asks for, and programs that listen what units log."""

import logging
from dataclasses import replace
from pathlib import Path

import pytest
from sample_jobs import job

from handover.scenarios.campaign.run_job import run_job


def test_units_of_ours_tell_of_their_calls(tmp_path: Path, caplog: pytest.LogCaptureFixture):
    """What Python's logging takes is for every program that uses the library."""
    with caplog.at_level(logging.DEBUG, logger="handover"):
        run_job(job(tmp_path / "runs", "r", "strategy=blind"), tmp_path / "runs" / "r")
    lines = [record.getMessage() for record in caplog.records if record.name == "handover.units"]
    assert "scene: [OK] fmi3EnterInitializationMode: initialising at t = 0 s" in lines
    assert any("fmi3Terminate: ends at t" in line for line in lines), lines


def test_a_campaign_s_runs_tell_in_their_logs(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    of_campaign = job(tmp_path / "runs", "r", "strategy=blind")
    run_job(replace(of_campaign, log_level="info"), tmp_path / "runs" / "r")
    assert "info: units are stepped to t = " in capsys.readouterr().err
