"""Records the calls that a master makes to its units, in order."""

from pathlib import Path

from handover.cosim.fmu.heartbeat import Heartbeat
from handover.cosim.fmu.loading import UNLOADING
from handover.cosim.system.system import System
from support.cosim.native_units import native_fmu


class CallLog(Heartbeat):
    """A heartbeat that keeps every call as (instance, call)."""

    def __init__(self) -> None:
        super().__init__()
        self.calls: list[tuple[str, str]] = []

    def begin(self, code: int, t: float) -> None:
        super().begin(code, t)
        under_way = self.under_way
        assert under_way is not None
        if under_way.call != UNLOADING:  # which is not a call of the unit's
            self.calls.append(under_way[:2])

    def after(self, unit: str, call: str, last: str) -> list[str]:
        """Return what was called of a unit after the last `call` of the unit `last`."""
        at = len(self.calls) - self.calls[::-1].index((last, call))
        return [name for which, name in self.calls[at:] if which == unit]


def fed_by(bad: Path, fmi: int) -> System:
    """Return a system of a sine, a unit `bad` that gets it, and an integrator that gets what `bad` gives."""
    s = System()
    source, unit = s.add("source", native_fmu("sine", fmi)), s.add("bad", bad)
    reader = s.add("reader", native_fmu("integrator", fmi))
    s.connect(source.y.y, unit.u.u)
    s.connect(unit.y.y, reader.u.u)
    return s
