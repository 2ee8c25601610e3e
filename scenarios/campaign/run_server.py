"""A process that carries out one run after the other, each in a child of its own: `python -m` this module.

It has loaded what runs need, so that a run costs a fork and not the start of an interpreter. It reads orders from
standard input and answers on standard output, all pickled: an order is a `RunOrder` and the folder for its files while
it runs; the answer is a `RunAnswer`. It ends with its input, and a run under way with it.

Where processes cannot be forked (Windows) it carries runs out itself: what a unit does to the process, it does to it.
"""

import contextlib
import gc
import importlib
import os
import pickle
import select
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import BinaryIO, NoReturn

from handover.cosim.fmu.heartbeat import Heartbeat
from handover.fmus.catalog import UNITS, import_block
from handover.scenarios.campaign.run_job import (
    answer_of,
    carry_out_order,
    finish,
    lost_by,
    printing_to,
    refuse_order,
)
from handover.scenarios.campaign.worker_pool import RunAnswer, RunOrder
from handover.scenarios.catalog import SCENARIOS
from handover.scenarios.execution import supervisor
from handover.scenarios.execution.child_process import ChildEnd, ForkedChild
from handover.scenarios.execution.crash import Death
from handover.scenarios.results.summary import Spent

IDLE = 60.0
"""Seconds without an order after which it ends by itself, so that none stays on a cluster that lives on."""


class RunServer:
    """Carries out orders.

    Args:
        orders: where they come from.
        answers: where the answers go.
    """

    def __init__(self, orders: BinaryIO, answers: BinaryIO) -> None:
        self._orders, self._answers = orders, answers
        self._loaded: set[str] = set()
        self._forks = supervisor.can_supervise()

    def serve(self) -> None:
        """Carry out orders until there are no more."""
        while self._comes():
            try:
                order, folder = pickle.load(self._orders)
            except (EOFError, pickle.UnpicklingError):  # the worker has ended, maybe amid an order
                return
            self._load(order.scenario)
            pickle.dump(self._carry_out(order, folder), self._answers)
            self._answers.flush()

    def _comes(self) -> bool:
        """Wait for an order, or the end of them."""
        return not self._forks or bool(select.select([self._orders], [], [], IDLE)[0])

    def _load(self, scenario: str) -> None:
        """Load what the units of a scenario import, once for all its runs."""
        if scenario in self._loaded or scenario not in SCENARIOS:
            return
        self._loaded.add(scenario)
        for unit in SCENARIOS[scenario].units.values():
            with contextlib.suppress(Exception):  # a run that needs it will tell
                import_block(UNITS[unit].block)
                for module in UNITS[unit].deferred:
                    importlib.import_module(module)
        gc.collect()
        gc.freeze()  # else the collector of each child touches, and so copies, all that is loaded

    def _carry_out(self, order: RunOrder, folder: Path) -> RunAnswer:
        try:
            log = tempfile.TemporaryFile(dir=order.runs)  # noqa: SIM115 (closed below)
        except OSError as e:
            return lost_by(e, order, f"{order.runs} cannot be written: {e.strerror}")
        with log:
            if self._forks:
                answer = self._fork(order, folder, log)
            else:
                with printing_to(log):
                    answer = answer_of(order, lambda: carry_out_order(order, folder))
            answer = answer if answer.lost else finish(order, folder, log)
        if answer.lost:
            shutil.rmtree(folder, ignore_errors=True)
        return answer

    def _fork(self, order: RunOrder, folder: Path, log: BinaryIO) -> RunAnswer:
        """Carry out a run in a child; if that dies of a unit, another child tells of it in the folder."""
        began = time.monotonic()
        end, heartbeat = self._in_child(lambda: answer_of(order, lambda: carry_out_order(order, folder)), folder, log)
        if heartbeat.status is not None:
            return _answer(order, heartbeat, "")
        death = Death(heartbeat, end, time.monotonic() - began)
        if death.was_killed or end.signal in supervisor.ORDERS:
            return RunAnswer(name=order.name, lost=death.told)
        left, failure, spent = death.folder, death.failure, Spent(time.monotonic() - began, end.cpu)
        if left is None and failure is None:
            return RunAnswer(name=order.name, lost=death.told)

        def tell() -> None:
            if left is not None:
                death.complete(left)
            elif failure is not None:
                refuse_order(order, folder, failure, spent)

        end, heartbeat = self._in_child(lambda: answer_of(order, tell), folder, log)
        return _answer(order, heartbeat, "" if heartbeat.status == 0 else death.told)

    def _in_child(self, work: Callable[[], RunAnswer], folder: Path, log: BinaryIO) -> tuple[ChildEnd, Heartbeat]:
        heartbeat = supervisor.renew_heartbeat()

        def begin() -> NoReturn:
            supervisor.begin_child()
            os.close(self._orders.fileno())  # answers stay open: by their end the worker knows that runs have ended too
            for number in (1, 2):
                os.dup2(log.fileno(), number)
            answer = work()
            if answer.lost:
                heartbeat.tell(loss={"lost": answer.lost, "no_room": answer.no_room})
            supervisor.leave(1 if answer.lost else 0)

        child = ForkedChild(begin, heartbeat)
        end = child.wait(self._orders.fileno())
        if end is None:  # no order comes before the answer: the worker is gone
            child.kill()
            for scratch in heartbeat.facts.get("scratch", []):
                shutil.rmtree(scratch, ignore_errors=True)
            shutil.rmtree(folder, ignore_errors=True)
            sys.exit()
        return end, heartbeat


def _answer(order: RunOrder, heartbeat: Heartbeat, otherwise: str) -> RunAnswer:
    """Answer as the child has told that the run is lost, or otherwise."""
    loss: Mapping[str, str] = heartbeat.facts.get("loss", {"lost": otherwise})
    return RunAnswer(name=order.name, **loss)


def main() -> None:
    """Serve on the standard streams, which runs do not see."""
    orders, answers = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    with open(os.devnull, "rb") as nothing:
        os.dup2(nothing.fileno(), 0)
    os.dup2(2, 1)
    RunServer(orders, answers).serve()


if __name__ == "__main__":
    main()
