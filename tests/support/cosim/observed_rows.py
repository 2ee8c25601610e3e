"""Rows of signals that an observer of a run sees."""

from fractions import Fraction

from handover.cosim.master.master import Master
from handover.cosim.stepping.options import MasterOptions
from handover.cosim.system.signals import Signals
from handover.cosim.system.system import System

Rows = dict[float, tuple[float, ...]]


def observed_rows(system: System, stop: Fraction, *names: str, options: MasterOptions | None = None) -> Rows:
    """Run a system; return the values of signals by time, which must increase."""
    rows: Rows = {}

    def observe(t: float, y: Signals) -> None:
        assert not rows or t > max(rows)
        rows[t] = tuple(float(y[n]) for n in names)

    with Master(system, options or MasterOptions()) as master:
        master.run(stop, [observe])
    return rows


def grid(n: int, stop: int = 1) -> list[float]:
    """The times k / n up to `stop`."""
    return [k / n for k in range(stop * n + 1)]
