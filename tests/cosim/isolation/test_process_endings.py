"""A unit that ends its own process, in whatever call: it is named, and the others are terminated and freed in order.

`tests/faults/test_fault_table.py` has more ways to end, by the command.
"""

import os
import signal
import subprocess
import sys
import threading
from fractions import Fraction
from pathlib import Path

import pytest
from support.cosim.call_log import CallLog, fed_by
from support.cosim.native_units import native_fmu
from support.faults.faulty_units import faulty_fmu
from support.processes import lives, until, with_path

from handover.cosim.exceptions import InitializationError, UnitFailure
from handover.cosim.fmu.failures import UnitCrashed, UnitFatal, UnitHung
from handover.cosim.master.master import Master
from handover.cosim.record.reader import Record
from handover.cosim.record.recorder import Recorder
from handover.cosim.stepping.options import Algorithm, MasterOptions

HOW = {
    "crashes": ("segmentation fault",),
    "exits": ("it ended its process with status 0",),
    "aborts": ("aborted",),
    "overruns": ("segmentation fault", "aborted"),
}
CALLS = {
    "instantiate": ("fmi2Instantiate", "fmi3InstantiateCoSimulation"),
    "initialize": ("fmi2EnterInitializationMode", "fmi3EnterInitializationMode"),
    "set": ("fmi2SetReal", "fmi3SetFloat64"),
    "step": ("fmi2DoStep", "fmi3DoStep"),
    "get": ("fmi2GetReal", "fmi3GetFloat64"),
    "terminate": ("fmi2Terminate", "fmi3Terminate"),
    "free": ("fmi2FreeInstance", "fmi3FreeInstance"),
}
TIMES = {"set": 0.3, "step": 0.3, "get": 0.3, "terminate": 1.0, "free": 1.0}
"""Simulated time of the failure, the last that is recorded but where it is in the outputs of the step before."""
LIMIT = 0.2  # s
CASES = [
    *((phase, "crashes", 3, True) for phase in CALLS),
    *((phase, "hangs", 2 + i % 2, True) for i, phase in enumerate(CALLS)),
    *((phase, fault, 3, False) for phase, fault in (("set", "exits"), ("step", "crashes"), ("get", "hangs"))),
    *(("step", fault, 2, True) for fault in HOW),
    ("instantiate", "exits", 2, True),
]


def ended(unit: str, fmi: int, record: Path, options: MasterOptions) -> tuple[UnitFailure, CallLog]:
    call_log, system = CallLog(), fed_by(native_fmu(unit, fmi), fmi)
    with (
        pytest.raises((UnitFailure, InitializationError)) as caught,
        Master(system, options, call_log) as master,
        Recorder(record) as recorder,
    ):
        master.run(Fraction(1), [recorder])
    failure = caught.value
    return failure.failure if isinstance(failure, InitializationError) else failure, call_log


@pytest.mark.parametrize(("phase", "fault", "fmi", "compiled"), CASES)
def test_a_unit_that_ends_its_process(phase: str, fault: str, fmi: int, compiled: bool, tmp_path: Path):
    limit = LIMIT if fault == "hangs" else None
    options = MasterOptions(isolated=("bad",), compiled=compiled, call_limit=limit)
    failure, call_log = ended(f"{fault}_in_{phase}", fmi, tmp_path / "r.parquet", options)
    assert type(failure) is (UnitHung if fault == "hangs" else UnitCrashed)
    assert (failure.unit, failure.call) == ("bad", CALLS[phase][fmi - 2])
    assert any("about to" in line for line in failure.log)
    if fault in HOW:
        assert failure.status in HOW[fault]
    if phase in TIMES:
        assert failure.t == pytest.approx(TIMES[phase])
        recorded = TIMES[phase] - (0.1 if phase == "get" else 0.0)
        assert Record(tmp_path / "r.parquet").time[-1] == pytest.approx(recorded)
    ends = [(unit, call) for unit, call in call_log.calls if call.endswith(("Terminate", "FreeInstance"))]
    for unit in {"source", "reader"} & {unit for unit, _ in call_log.calls}:
        begun = ["Terminate"] if phase in TIMES else []
        assert [c for u, c in ends if u == unit] == [f"fmi{fmi}{name}" for name in (*begun, "FreeInstance")]


def test_a_unit_s_process_that_somebody_killed_is_reported_as_that():
    master = Master(fed_by(native_fmu("gain"), 3), MasterOptions(isolated=("bad",)))

    def kill(_t: float, _signals: object) -> None:
        process = master.ensemble.instances["bad"]._process.own  # type: ignore
        assert process is not None
        os.kill(process._process.pid, signal.SIGKILL)  # type: ignore

    with pytest.raises(UnitCrashed) as caught, master:
        master.run(Fraction(1), [kill])
    assert (caught.value.unit, caught.value.call, caught.value.t) == ("bad", "fmi3DoStep", 0.0)
    assert caught.value.status == "killed, by someone or by the system for want of memory"


def test_fatal_in_a_process_of_its_own_leaves_other_instances_of_the_fmu_alone():
    system, call_log = fed_by(native_fmu("fatal", 3), 3), CallLog()
    system.add("sibling", native_fmu("fatal", 3), at=1e9)
    with pytest.raises(UnitFatal) as caught, Master(system, MasterOptions(isolated=("bad",)), call_log) as master:
        master.run(Fraction(1))
    assert (caught.value.unit, caught.value.call) == ("bad", "fmi3DoStep")
    ends = [call for unit, call in call_log.calls if unit == "sibling" and call.startswith("fmi")][-2:]
    assert ends == ["fmi3Terminate", "fmi3FreeInstance"]


def test_a_number_that_is_none_fails_as_in_one_process(tmp_path: Path):
    failures = [ended("gives_nan", 3, tmp_path / f"{i}", MasterOptions(isolated=i))[0] for i in ((), ("all",))]
    assert [type(f) for f in failures] == [type(failures[0])] * 2
    assert failures[0].as_data() == failures[1].as_data()


@pytest.mark.parametrize(
    ("fmi", "algorithm", "compiled"),
    [(2, Algorithm.GAUSS_SEIDEL, False), (3, Algorithm.JACOBI, True)],
)
def test_a_request_to_end_is_that_of_one_process(fmi: int, algorithm: Algorithm, compiled: bool, tmp_path: Path):
    outcomes: list[object] = []
    for isolated in ((), ("bad",), ("all",)):
        record = tmp_path / "-".join(("r", *isolated))
        options = MasterOptions(isolated=isolated, algorithm=algorithm, compiled=compiled)
        with Master(fed_by(native_fmu("ends", fmi), fmi), options) as master, Recorder(record) as recorder:
            master.run(Fraction(1), [recorder])
            assert master.ended is not None
            ended = master.ended.as_data()
        outcomes.append((ended, record.read_bytes()))
    assert outcomes[0] == outcomes[1] == outcomes[2]


_RUN = """
import sys
from fractions import Fraction
from support.cosim.native_units import native_fmu
from handover.cosim.master.master import Master
from handover.cosim.stepping.options import MasterOptions
from handover.cosim.system.system import System
s = System()
s.add("idle", native_fmu("gain"))
s.add("busy", native_fmu("hangs"))
with Master(s, MasterOptions(isolated=("all",))) as master:
    hosts = [i._process.own._process.pid for i in master.ensemble.instances.values()]
    print(*hosts, flush=True)
    master.run(Fraction(1))
"""


def test_no_process_is_left_when_the_master_is_killed():
    with subprocess.Popen([sys.executable, "-c", _RUN], env=with_path(), stdout=subprocess.PIPE) as run:
        assert run.stdout is not None
        hosts = [int(pid) for pid in run.stdout.readline().split()]
        assert [lives(pid) for pid in hosts] == [True, True]
        run.kill()
    until(lambda: not any(lives(pid) for pid in hosts))


@pytest.mark.parametrize(
    ("call", "isolated"), [("set", ()), *((call, ("all",)) for call in ("set", "get", "step", "terminate"))]
)
def test_a_status_that_no_standard_knows_fails_isolated_too(tmp_path: Path, call: str, isolated: tuple[str, ...]):
    """A set waits for the step and is made with it: its status must not be lost behind that of the step."""
    bad = faulty_fmu(f"negative_in_{call}", 2, tmp_path)
    with pytest.raises(UnitFailure) as caught, Master(fed_by(bad, 2), MasterOptions(isolated=isolated)) as master:
        master.run(Fraction(1))
    found = caught.value
    assert (found.unit, found.call, found.t) == ("bad", CALLS[call][0], pytest.approx(TIMES[call]))
    assert "answered -2" in str(found)


class Stuck(CallLog):
    """Holds the thread of the calls before one of them reaches the process of the unit."""

    def __init__(self) -> None:
        super().__init__()
        self.let_go = threading.Event()

    def begin(self, code: int, t: float) -> None:
        super().begin(code, t)
        if self.calls[-1] == ("bad", "fmi3DoStep"):
            self.let_go.wait(60)


def test_what_hangs_on_the_master_s_side_is_left_and_the_process_is_ended():
    stuck = Stuck()
    options = MasterOptions(isolated=("bad",), compiled=False, call_limit=LIMIT)
    master = Master(fed_by(native_fmu("gain"), 3), options, stuck)
    with pytest.raises(UnitHung) as caught, master:
        master.run(Fraction(1))
    assert (caught.value.unit, caught.value.call, caught.value.t) == ("bad", "fmi3DoStep", 0.0)
    for unit in ("source", "reader"):
        assert [c for u, c in stuck.calls if u == unit][-2:] == ["fmi3Terminate", "fmi3FreeInstance"]
    stuck.let_go.set()
