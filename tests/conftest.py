"""For all tests: no property is tested by the clock, Ctrl-C is heard, and what tests cost is printed at the end.

Costs are CPU time of the tests' process and of the processes that it has waited for. What tests share is counted with
the first that needs it.
"""

import os
import resource
import signal
import sys
from collections import defaultdict
from collections.abc import Generator
from itertools import chain
from typing import Any

import pytest
from hypothesis import settings
from support.commands import cpu_of_commands
from support.wording import wording as wording
from support.wording import write_golden

# Else each process rewrites and compiles all tests and the package anew, which takes longer than most of them.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
os.environ.pop("COLUMNS", None)  # of a terminal: what commands print into pipes would be as wide
sys.dont_write_bytecode = False

# Where other processes have the cores, BLAS spins: small matrices in two threads take twenty times the CPU time.
for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")

settings.register_profile("without deadline", deadline=None)
settings.load_profile("without deadline")

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # as of a shell's job in the background
    signal.signal(signal.SIGINT, signal.default_int_handler)

_CPU = "CPU seconds"
_BEGAN = pytest.StashKey[float]()
_COSTLIEST = 10
_deselected: set[str] = set()


def _cpu() -> float:
    used = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(u.ru_utime + u.ru_stime for u in used) + cpu_of_commands()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, object, object]:
    item.stash[_BEGAN] = _cpu()
    return (yield)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    report = yield
    report.sections.append((_CPU, str(_cpu() - item.stash[_BEGAN])))
    return report


@pytest.hookimpl(tryfirst=True)  # before the tier is chosen
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if "browser" in getattr(item, "fixturenames", ()) and item.get_closest_marker("real_time") is None:
            item.add_marker(pytest.mark.slow)


def pytest_deselected(items: list[pytest.Item]) -> None:
    _deselected.update(item.nodeid for item in items)


def pytest_sessionfinish(session: pytest.Session) -> None:
    write_golden({item.nodeid for item in session.items}, _deselected)


def pytest_terminal_summary(terminalreporter: Any) -> None:
    costs, folders = defaultdict[str, float](float), defaultdict[str, float](float)
    for report in chain.from_iterable(terminalreporter.stats.values()):
        for name, value in getattr(report, "sections", ()):
            if name == _CPU:
                costs[report.nodeid] = max(costs[report.nodeid], float(value))
    for test, seconds in costs.items():
        folders[test.partition("::")[0].rpartition("/")[0]] += seconds
    terminalreporter.section(f"CPU seconds: {sum(costs.values()):.0f}")
    for counted in (costs, folders):
        for name in sorted(counted, key=counted.__getitem__, reverse=True)[:_COSTLIEST]:
            terminalreporter.line(f"{counted[name]:7.1f}  {name}")
        terminalreporter.line("")
