"""A worker of a cluster executes only jobs whose results are still wanted."""

from pathlib import Path
from typing import Any

import pytest
from distributed import Client
from sample_jobs import job

from handover.scenarios.campaign import worker
from handover.scenarios.campaign.worker import ServerProcess
from handover.scenarios.results.run_folder import versions


def test_a_job_of_a_batch_that_has_been_ended_starts_no_server(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """The scheduler cancels jobs later than the worker is asked to end them."""
    started: list[ServerProcess] = []

    def started_server() -> ServerProcess:
        started.append(ServerProcess())
        return started[-1]

    def lost(client: Client, batch: str) -> str:
        arguments: list[Any] = [job(tmp_path / "runs"), batch, versions()]
        return client.submit(worker.run_job_on_worker, *arguments, pure=False).result(timeout=60).lost

    monkeypatch.setattr(worker, "ServerProcess", started_server)
    with Client(processes=False, n_workers=1, threads_per_worker=1, dashboard_address="127.0.0.1:0") as client:
        client.run(worker.end_runs, "ended")
        assert lost(client, "ended") == "it was ended, as nobody waited for it"
        assert started == []
        assert lost(client, "wanted") == ""
        client.run(worker.end_runs, "wanted")
        assert [server.lives for server in started] == [False]
        assert lost(client, "wanted") == "it was ended, as nobody waited for it"
        assert len(started) == 1
    assert [p.name for p in (tmp_path / "runs").iterdir()] == ["run"]
