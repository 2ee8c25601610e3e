"""A worker of a cluster executes only jobs whose results are still wanted."""

import gc
import logging
import weakref
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest
from distributed import Client
from support.scenarios.sample_jobs import job, quick_job

from handover.scenarios.runs.campaign import cluster, run_servers
from handover.scenarios.runs.campaign.run_job import run_job
from handover.scenarios.runs.campaign.run_servers import JobRunner, ServerProcess
from handover.scenarios.runs.results.run_folder import versions


def test_a_job_of_a_batch_that_has_been_ended_starts_no_server(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """The scheduler cancels jobs later than the worker is asked to end them."""
    started: list[ServerProcess] = []
    runners: list[weakref.ref[JobRunner]] = []

    def started_server() -> ServerProcess:
        started.append(ServerProcess())
        return started[-1]

    def noted_runner() -> JobRunner:
        runner = JobRunner()
        runners.append(weakref.ref(runner))
        return runner

    def lost(client: Client, batch: str) -> str:
        arguments: list[Any] = [quick_job(tmp_path / "runs"), batch, versions()]
        return client.submit(cluster.run_job_on_worker, *arguments, pure=False).result(timeout=60).lost

    monkeypatch.setattr(run_servers, "ServerProcess", started_server)
    monkeypatch.setattr(cluster, "JobRunner", noted_runner)
    with Client(processes=False, n_workers=1, threads_per_worker=1, dashboard_address="127.0.0.1:0") as client:
        client.run(cluster.end_runs, "ended")
        assert lost(client, "ended") == "it was ended, as nobody waited for it"
        assert started == []
        assert lost(client, "wanted") == ""
        client.run(cluster.end_runs, "wanted")
        assert [server.lives for server in started] == [False]
        assert lost(client, "wanted") == "it was ended, as nobody waited for it"
        assert len(started) == 1
    assert [p.name for p in (tmp_path / "runs").iterdir()] == ["run"]
    gc.collect()
    assert (len(runners), [r for r in runners if r() is not None]) == (3, [])  # none is kept of a batch that has ended


def test_units_of_ours_tell_of_their_calls_and_a_campaigns_runs_in_their_logs(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, capsys: pytest.CaptureFixture[str]
):
    """What Python's logging takes is for every program that uses the library."""
    given = replace(job(tmp_path / "runs", "r", "strategy=blind"), stop=Fraction(1, 10))
    with caplog.at_level(logging.DEBUG, logger="handover"):
        run_job(given, tmp_path / "runs" / "r")
    lines = [record.getMessage() for record in caplog.records if record.name == "handover.units"]
    assert "scene: [OK] fmi3EnterInitializationMode: initialising at t = 0 s" in lines
    assert any("fmi3Terminate: ends at t" in line for line in lines), lines
    run_job(replace(given, log_level="info"), tmp_path / "runs" / "s")
    assert "info: units are stepped to t = " in capsys.readouterr().err
