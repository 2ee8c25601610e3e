"""Isolated units that do not wait for each other step at the same time; failures come in the order of one process."""

from fractions import Fraction
from pathlib import Path

import pytest
from both_paths import PLAIN
from native_units import native_fmu

from handover.cosim.exceptions import UnitFailure
from handover.cosim.fmu.failures import UnitError
from handover.cosim.master.master import Master
from handover.cosim.stepping.options import Algorithm, MasterOptions
from handover.cosim.system.system import System

COMPILED = pytest.mark.parametrize("compiled", [False, True], ids=["general", "plan"])
algorithms = pytest.mark.parametrize("algorithm", PLAIN)


@COMPILED
@algorithms
@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("isolated", [("all",), ("first",)])
def test_two_units_meet_in_their_steps(
    isolated: tuple[str, ...], fmi: int, algorithm: Algorithm, compiled: bool, tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
):  # fmt: skip
    """In one process neither would ever return; one of them may be in this process, while the other one steps."""
    monkeypatch.setenv("MEETING_FOLDER", str(tmp_path))
    s = System()
    first, second = s.add("first", native_fmu("meets", fmi), who=0), s.add("second", native_fmu("meets", fmi), who=1)
    third = s.add("third", native_fmu("hub", fmi))
    s.connect(first.y.y, third.u.u1)
    s.connect(second.y.y, third.u.u2)
    with Master(s, MasterOptions(algorithm=algorithm, compiled=compiled, isolated=isolated)) as master:
        master.run(Fraction(1, 2))
        assert [int(master.signals[f"{name}.n"]) for name in ("first", "second")] == [5, 5]


def test_with_events_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("MEETING_FOLDER", str(tmp_path))
    s = System()
    for who, name in enumerate(("first", "second")):
        s.add(name, native_fmu("meets"), who=who)
    with Master(s, MasterOptions(isolated=("all",), repeat_discarded=True)) as master:
        master.run(Fraction(1, 2))
        assert [int(master.signals[f"{name}.n"]) for name in ("first", "second")] == [5, 5]


@COMPILED
@algorithms
@pytest.mark.parametrize("isolated", [("all",), ("first",), ("second",), ("first", "third")])
def test_of_two_failures_that_of_one_process_is_raised(
    isolated: tuple[str, ...], algorithm: Algorithm, compiled: bool
):  # fmt: skip
    """Three units, of which the last two fail in the same step."""
    failures: list[UnitFailure] = []
    for which in ((), isolated):
        s = System()
        s.add("first", native_fmu("gain"))
        s.add("second", native_fmu("errs"))
        s.add("third", native_fmu("errs"))
        with (
            pytest.raises(UnitError) as caught,
            Master(s, MasterOptions(algorithm=algorithm, compiled=compiled, isolated=which)) as master,
        ):
            master.run(Fraction(1))
        failures.append(caught.value)
    assert failures[0].as_data() == failures[1].as_data()
    assert failures[0].unit == "second"
