"""An embedded crew carries out orders whatever is killed, and leaves no process and no half folder."""

import os
import pickle
import signal
import subprocess
import sys
from collections.abc import Generator, Sequence
from pathlib import Path

import psutil
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from crew_orders import bad_order, order
from living import family, lives, parent, servers, until

from handover.scenarios.campaign.local_cluster import embedded_crew
from handover.scenarios.campaign.worker_pool import Crew, RunAnswer, RunOrder, cores

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not sys.platform.startswith("linux"), reason="looks for processes in /proc"),
]


@pytest.fixture(scope="module")
def crew() -> Generator[Crew, None, None]:
    with embedded_crew(2) as crew:
        yield crew


@pytest.fixture
def runs(tmp_path: Path) -> Path:
    return tmp_path / "runs"


def carried_out(crew: Crew, orders: Sequence[RunOrder]) -> list[RunAnswer]:
    return sorted(crew.carry_out(orders), key=lambda answer: answer.name)


def going(runs: Path) -> bool:
    """Return whether both of two workers carry out a run."""
    return len(list(runs.glob(".*/signals.tail"))) == 2


def test_all_are_answered_and_one_that_fails_ends_no_other(crew: Crew, runs: Path, tmp_path: Path):
    orders = [*(order(runs, f"run_{i}", seed=i) for i in range(5)), bad_order(runs, "Crashes", tmp_path)]
    orders.append(bad_order(runs, "IsKilled", tmp_path, "killed"))
    crew.check(runs)
    told = carried_out(crew, orders)
    assert [answer.name for answer in told] == ["bad", "killed", *(f"run_{i}" for i in range(5))]
    assert [answer.name for answer in told if answer.lost] == ["killed"]
    assert "was killed" in told[1].lost
    assert sorted(p.name for p in runs.iterdir()) == ["bad", *(f"run_{i}" for i in range(5))]
    assert len(servers(os.getpid())) == 2  # each worker has had a run


def test_a_killed_worker_is_replaced_and_its_run_begun_anew(crew: Crew, runs: Path):
    orders = [order(runs, f"run_{i}", seed=i) for i in range(8)]
    told: list[str] = []
    for answer in crew.carry_out(orders):
        if not told:
            server = servers(os.getpid())[0]
            os.kill(parent(server), signal.SIGKILL)
            until(lambda: not lives(server))  # noqa: B023 (awaited here)
        told.append(answer.name)
        assert answer.lost == ""
    assert sorted(told) == sorted(p.name for p in runs.iterdir()) == [f"run_{i}" for i in range(8)]


def test_a_run_that_always_takes_its_worker_with_it_is_given_up(crew: Crew, runs: Path, tmp_path: Path):
    (told,) = crew.carry_out([bad_order(runs, "KillsItsWorker", tmp_path)])
    assert told.lost == "its worker was lost 4 times: killed, or out of memory"
    until(lambda: list(runs.iterdir()) == [])  # the last worker's server sees to that when its worker is gone
    assert carried_out(crew, [order(runs)])[0].lost == ""


def test_an_iteration_that_is_left_ends_its_runs(crew: Crew, runs: Path, tmp_path: Path):
    hanging = [bad_order(runs, "Hangs", tmp_path, f"hangs_{i}") for i in range(4)]
    answers = crew.carry_out([order(runs), *hanging])
    assert next(iter(answers)).name == "run"
    answers.close()
    assert servers(os.getpid()) == []
    assert [p.name for p in runs.iterdir()] == ["run"]


def test_only_this_machine_can_speak_to_it(crew: Crew):  # noqa: ARG001 (it is there)
    processes = [psutil.Process(), *psutil.Process().children(recursive=True)]
    connections = [c for process in processes for c in process.net_connections(kind="inet")]
    heard = {c.laddr.ip for c in connections if c.status == psutil.CONN_LISTEN}
    assert heard == {"127.0.0.1"}


def test_by_default_there_is_a_worker_for_each_core():
    assert cores() == len(os.sched_getaffinity(0))
    with embedded_crew(None) as crew:
        assert crew.workers == cores()


@pytest.mark.parametrize(("number", "status"), [(signal.SIGKILL, -9), (signal.SIGINT, 130)])
def test_a_command_that_is_ended_leaves_no_process_and_says_nothing(
    number: signal.Signals, status: int, runs: Path, tmp_path: Path
):
    hanging = [bad_order(runs, "Hangs", tmp_path, f"hangs_{i}") for i in range(4)]
    (tmp_path / "orders").write_bytes(pickle.dumps(hanging))
    command = [sys.executable, str(Path(__file__).with_name("crew_program.py")), str(tmp_path / "orders")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True) as process:
        try:
            until(lambda: going(runs))
            below = family(process.pid)
            assert len(below) >= 6  # two workers, two servers, two runs
            if number == signal.SIGINT:
                os.killpg(process.pid, number)  # as Ctrl-C in a terminal does
            else:
                process.kill()
            assert process.communicate(timeout=60) == (b"", b"")
            assert process.returncode == status
        finally:
            process.kill()
    until(lambda: not any(map(lives, below)))
    until(lambda: list(runs.iterdir()) == [])
