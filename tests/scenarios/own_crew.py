"""A crew in this process, for tests of what is around crews: it carries runs out one after another."""

import os
import shutil
from collections.abc import Callable, Generator, Sequence
from pathlib import Path

from handover.scenarios.campaign.run_job import carry_out_order
from handover.scenarios.campaign.worker_pool import RunAnswer, RunOrder


class OwnCrew:
    """Carries out real runs; `before` is called with each order and may raise, or return why the run is lost."""

    def __init__(self, before: Callable[[RunOrder], str] = lambda _order: "") -> None:
        self.begun: list[str] = []
        self._before = before

    def check(self, folder: Path) -> None:
        assert folder.is_dir()

    def carry_out(self, orders: Sequence[RunOrder]) -> Generator[RunAnswer, None, None]:
        for order in orders:
            self.begun.append(order.name)
            lost = self._before(order)
            if not lost:
                _run(order)
            yield RunAnswer(name=order.name, lost=lost)


def _run(order: RunOrder) -> None:
    unfinished = Path(order.runs) / f".{order.name}"
    try:
        carry_out_order(order, unfinished)
    except BaseException:
        shutil.rmtree(unfinished, ignore_errors=True)
        raise
    os.replace(unfinished, Path(order.runs) / order.name)
