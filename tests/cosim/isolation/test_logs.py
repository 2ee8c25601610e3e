"""What an isolated unit logs is what it logs in one process, however much it is."""

from fractions import Fraction

import pytest
from native_units import native_fmu

from handover.cosim.fmu.heartbeat import Heartbeat
from handover.cosim.master.master import Master
from handover.cosim.stepping.options import MasterOptions
from handover.cosim.system.system import System


class Listener(Heartbeat):
    """Keeps all lines."""

    def __init__(self) -> None:
        super().__init__()
        self.lines: list[str] = []

    def log(self, unit: str, message: str) -> None:
        self.lines.append(f"{unit}: {message}")


def heard(fmi: int, lines: int, *isolated: str) -> list[str]:
    s, listener = System(), Listener()
    s.add("talks", native_fmu("talks", fmi), lines=lines)
    with Master(s, MasterOptions(isolated=isolated), listener) as master:
        master.run(Fraction(1, 2))
    return listener.lines


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("lines", [1, 5000])
def test_every_line_is_heard(lines: int, fmi: int):
    """5,000 lines are more than the memory for the log holds."""
    all_lines = heard(fmi, lines, "talks")
    assert all_lines == heard(fmi, lines)
    assert len(all_lines) == 5 * lines
    assert all_lines[-1] == f"talks: [Warning] line {lines} of {lines} of the step from t = 0.4 s"
