"""A command asks only once whether there is a scheduler at the address."""

import contextlib
from collections.abc import Generator

import pytest
from in_process_pool import InProcessPool

from handover.scenarios.campaign import local_cluster
from handover.scenarios.campaign import scheduler as scheduler_address
from handover.scenarios.campaign.pool_config import PoolConfig


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

    monkeypatch.setattr(scheduler_address, "scheduler_address", result)
    monkeypatch.setattr(local_cluster, "connect_cluster", connect_cluster)
    config = PoolConfig(scheduler="h:1")
    if checked:
        config.check()
    with config.start():
        assert asked == ["h:1", "tcp://h:1"]
    assert str(config) == "the workers of h:1"
