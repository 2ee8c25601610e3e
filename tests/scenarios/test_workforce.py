"""A call asks once whether a scheduler is where it says."""

import contextlib
from collections.abc import Generator

import pytest
from own_crew import OwnCrew

from handover.scenarios.campaign import local_cluster
from handover.scenarios.campaign import scheduler as scheduler_address
from handover.scenarios.campaign.pool_config import Workforce


@pytest.mark.parametrize("checked", [True, False], ids=["checked", "unchecked"])
def test_workers_are_those_of_the_scheduler_that_has_answered(checked: bool, monkeypatch: pytest.MonkeyPatch):
    asked: list[str] = []

    def answer(told: str) -> str:
        asked.append(told)
        return f"tcp://{told}"

    @contextlib.contextmanager
    def crew_at(address: str) -> Generator[OwnCrew, None, None]:
        asked.append(address)
        yield OwnCrew()

    monkeypatch.setattr(scheduler_address, "scheduler_address", answer)
    monkeypatch.setattr(local_cluster, "crew_at", crew_at)
    workforce = Workforce(scheduler="h:1")
    if checked:
        workforce.check()
    with workforce.start():
        assert asked == ["h:1", "tcp://h:1"]
    assert str(workforce) == "the workers of h:1"
