"""Schedulers that cannot be used are reported in one line, before anything is sent to them."""

import asyncio
import contextlib
import socket
import threading
from collections.abc import Generator
from pathlib import Path

import pytest
from support.clusters import scheduler
from support.in_process_pool import InProcessPool
from support.wording import Wording

from handover.scenarios.runs.campaign import cluster
from handover.scenarios.runs.campaign import scheduler as of_scheduler
from handover.scenarios.runs.campaign.cluster import call_with_timeout
from handover.scenarios.runs.campaign.pools import PoolConfig
from handover.scenarios.runs.campaign.scheduler import scheduler_address
from handover.scenarios.runs.execution.errors import PoolError


def refused(address: str) -> str:
    with pytest.raises(PoolError) as caught:
        scheduler_address(address)
    return str(caught.value)


@pytest.fixture(params=[b"", b"HTTP/1.1 400 Bad Request\r\nContent-Length: 0\r\n\r\n"], ids=["silent", "HTTP"])
def other_server(request: pytest.FixtureRequest) -> Generator[str, None, None]:
    """Gives the address of a server that accepts connections and is not a scheduler."""
    accepted: list[socket.socket] = []

    def accept() -> None:
        while True:
            try:
                connection, _ = server.accept()
            except OSError:
                return
            connection.sendall(request.param)
            accepted.append(connection)

    with socket.create_server(("127.0.0.1", 0)) as server:
        accepting = threading.Thread(target=accept)
        accepting.start()
        yield f"tcp://127.0.0.1:{server.getsockname()[1]}"
        server.shutdown(socket.SHUT_RDWR)
        accepting.join()
    for connection in accepted:
        connection.close()


@pytest.mark.parametrize(
    "address",
    ["nonsense", "", "tcp://127.0.0.1", "127.0.0.1:99999", "tcp://127.0.0.1:abc", "http://127.0.0.1:80", "[::1"],
)
def test_a_malformed_address_is_refused(address: str, wording: Wording):
    wording.check(refused(address))


@pytest.mark.slow
def test_a_server_that_is_no_scheduler_is_refused(other_server: str):
    assert refused(other_server).startswith(f"{other_server} ")


@pytest.mark.slow
def test_a_scheduler_is_found_from_where_an_event_loop_runs(tmp_path: Path):
    """As it does in a notebook."""

    async def ask(text: str) -> str:
        return scheduler_address(text)

    with scheduler(tmp_path) as address:
        assert asyncio.run(ask(address.removeprefix("tcp://"))) == address


@pytest.mark.parametrize("checked", [True, False], ids=["checked", "unchecked"])
def test_workers_are_those_of_the_scheduler_that_has_answered(checked: bool, monkeypatch: pytest.MonkeyPatch):
    asked: list[str] = []

    def result(text: str) -> str:
        asked.append(text)
        return f"tcp://{text}"

    @contextlib.contextmanager
    def connect_cluster(address: str) -> Generator[InProcessPool, None, None]:
        asked.append(address)
        yield InProcessPool()

    monkeypatch.setattr(of_scheduler, "scheduler_address", result)
    monkeypatch.setattr(cluster, "connect_cluster", connect_cluster)
    config = PoolConfig(scheduler="h:1")
    if checked:
        config.check()
    with config.start():
        assert asked == ["h:1", "tcp://h:1"]
    assert str(config) == "the workers of h:1"


def test_it_is_called_in_another_thread_and_what_it_raises_is_raised_in_the_caller():
    def ask() -> None:
        raise ValueError("no such worker")

    assert call_with_timeout(threading.get_ident, 60.0) != threading.get_ident()
    with pytest.raises(ValueError, match="no such worker"):
        call_with_timeout(ask, 60.0)


def test_a_call_without_an_answer_times_out():
    never = threading.Event()
    with pytest.raises(TimeoutError, match=r"^no answer within 0\.1 s$"):
        call_with_timeout(lambda: never.wait(60.0), 0.1)
    never.set()
