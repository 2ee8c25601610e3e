"""What passes between a worker and its run server is plain data: a pickle in its place is refused and not executed."""

import io
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import pytest
from support.cosim.planted import planted_pickle
from support.scenarios.sample_jobs import quick_job

from handover.cosim.blocks.block import InvalidState
from handover.cosim.stepping.options import AdaptiveStep, Algorithm, Extrapolation, MasterOptions
from handover.scenarios.runs.campaign import run_servers
from handover.scenarios.runs.campaign.run_servers import ServerLost, ServerProcess, end_runners
from handover.scenarios.runs.campaign.worker_pool import JobResult, read_message, write_message


def sent(message: bytes) -> io.BytesIO:
    return io.BytesIO(len(message).to_bytes(8, "big") + message)


def test_jobs_and_results_come_as_they_were_sent(tmp_path: Path):
    adaptive = AdaptiveStep(uncontrolled=("a.y", "b.y"))
    options = MasterOptions(algorithm=Algorithm.NEWTON, extrapolation=Extrapolation.LINEAR, adaptive=adaptive)
    whole = replace(quick_job(tmp_path), seed=2**70, fmus={"u": "f"}, parameters=("a=1",), options=options)
    pipe = io.BytesIO()
    for message in ((whole, "folder"), JobResult(name="r", lost="é", no_room="x")):
        write_message(pipe, message)
    pipe.seek(0)
    assert read_message(pipe) == (whole, "folder")
    assert read_message(pipe) == JobResult(name="r", lost="é", no_room="x")
    with pytest.raises(EOFError):
        read_message(pipe)


def test_a_message_that_ends_early_is_the_end_of_the_pipe():
    pipe = io.BytesIO()
    write_message(pipe, JobResult(name="r"))
    for size in range(len(pipe.getvalue())):
        with pytest.raises(EOFError):
            read_message(io.BytesIO(pipe.getvalue()[:size]))


def test_a_pickle_in_a_pipe_is_refused_and_not_executed(tmp_path: Path):
    planted, mark = planted_pickle(tmp_path)
    for pipe in (io.BytesIO(planted), sent(planted)):
        with pytest.raises(InvalidState):
            read_message(pipe)
    assert not mark.exists()


def test_a_run_server_ends_at_a_pickle(tmp_path: Path):
    planted, mark = planted_pickle(tmp_path)
    program = [sys.executable, "-m", "handover.scenarios.runs.campaign.run_server"]
    server = subprocess.run(program, input=sent(planted).getvalue(), capture_output=True, check=False)
    assert server.returncode == 1
    assert server.stderr.decode().splitlines()[-1].startswith("handover.cosim.blocks.block.InvalidState: ")
    assert not mark.exists()


def server_of(program: str, monkeypatch: pytest.MonkeyPatch) -> ServerProcess:
    def command(_module: str) -> list[str]:
        return [sys.executable, "-S", "-c", program]

    monkeypatch.setattr(run_servers, "module_command", command)
    return ServerProcess()


def test_a_worker_ends_a_server_that_answers_a_pickle(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    planted, mark = planted_pickle(tmp_path)
    answer = f"import sys; sys.stdin.buffer.read(8); sys.stdout.buffer.write({sent(planted).getvalue()!r})"
    server = server_of(answer, monkeypatch)
    with pytest.raises(ServerLost):
        server.run_job(quick_job(tmp_path), lambda: True)
    assert not server.lives
    assert not mark.exists()


def test_servers_that_do_not_end_are_killed_after_the_time_that_one_has(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(run_servers, "_GRACE", 0.5)
    servers = [server_of("import time; time.sleep(60)", monkeypatch) for _ in range(8)]
    before = time.monotonic()
    end_runners(cast(Any, servers))
    assert time.monotonic() - before < 0.5 * len(servers)
    assert not any(server.lives for server in servers)
