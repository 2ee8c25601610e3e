"""A unit that fails in a compiled plan is reported as on the general path; the record ends with the last good step."""

from fractions import Fraction
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from support.cosim.both_paths import PLAIN, expect_alike
from support.cosim.fmu_of import FmuOf
from support.cosim.native_units import native_fmu
from support.wording import Wording

from handover.cosim.exceptions import RecordNotWritten, UnitFailure
from handover.cosim.fmu.failures import NotFinite, UnitDiscarded, UnitError, UnitFatal
from handover.cosim.master.master import Master
from handover.cosim.record.reader import Record
from handover.cosim.record.recorder import Recorder
from handover.cosim.record.stream import RecordStream
from handover.cosim.stepping.options import Algorithm
from handover.cosim.system.system import System


@pytest.mark.parametrize(
    ("unit", "failure", "algorithm", "fmi"),
    [
        ("errs", UnitError, Algorithm.JACOBI, 2),
        ("fatal", UnitFatal, Algorithm.GAUSS_SEIDEL, 3),
        ("gives_nan", NotFinite, Algorithm.GAUSS_SEIDEL, 2),
        ("gives_infinity", NotFinite, Algorithm.JACOBI, 3),
    ],
)
def test_failures_in_the_midst_of_a_run(
    unit: str, failure: type[UnitFailure], fmi: int, algorithm: Algorithm, tmp_path: Path
):
    def build() -> System:
        s = System()
        faulty = s.add("faulty", native_fmu(unit, fmi), at=4.05)
        reader = s.add("reader", native_fmu("integrator", 3))
        s.connect(faulty.y.y, reader.u.u)
        return s

    ran = expect_alike(build, Fraction(10), tmp_path, algorithm)
    assert isinstance(ran.failure, failure)
    file = tmp_path / f"{algorithm.value}-True-False.parquet"
    assert pq.read_table(file)["time"].to_pylist() == [k / 10 for k in range(41)]


def test_a_step_that_is_discarded_fails_and_numbers_that_nobody_reads_do_not(tmp_path: Path):
    s = System()
    s.add("faulty", native_fmu("gives_nan", 2))
    assert expect_alike(lambda: s, Fraction(1), tmp_path, Algorithm.JACOBI).failure is None
    s.add("short", native_fmu("discards", 3), period=Fraction(1), longest=0.5)
    assert isinstance(expect_alike(lambda: s, Fraction(10), tmp_path, Algorithm.JACOBI).failure, UnitDiscarded)


def test_an_exception_in_a_block_is_reported_with_its_log(fmu: FmuOf, tmp_path: Path):
    s = System()
    s.add("steady", fmu("Counter"), sampled=True)
    s.add("failing", fmu("Counter"), fails_at=5)
    failure = expect_alike(lambda: s, Fraction(1), tmp_path, Algorithm.GAUSS_SEIDEL).failure
    assert failure is not None
    assert failure.cause.startswith("failing: fmi3DoStep at t = 0.4 s: ")
    assert any("count 5 was asked to fail" in line for line in failure.log)


@pytest.mark.parametrize(
    ("factor", "port", "algorithm"), [(3, "small", PLAIN[0]), (-3, "small", PLAIN[1]), (-1, "whole", PLAIN[0])]
)
def test_a_number_that_has_no_place_in_its_reader(
    fmu: FmuOf, factor: int, port: str, algorithm: Algorithm, tmp_path: Path, wording: Wording
):
    s = System()
    a, b = s.add("a", fmu("Tally"), factor=factor), s.add("b", fmu("Tally"))
    s.connect(a.y.power, getattr(b.u, port))
    wording.check(expect_alike(lambda: s, Fraction(3), tmp_path, algorithm).failure)


def test_a_run_goes_on_where_the_disk_was_full(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    s = System()
    s.add("ramp", native_fmu("ramp"), period=Fraction(1, 1000))
    file = tmp_path / "r.parquet"
    with Master(s) as master, Recorder(file) as recorder:
        with monkeypatch.context() as patch:
            patch.setattr(RecordStream, "write", full)
            for _ in range(3):
                with pytest.raises(RecordNotWritten, match="No space left"):
                    master.run(Fraction(10), [recorder])
                assert recorder.rows == recorder.block.capacity
        master.run(Fraction(10), [recorder])
    assert Record(file).time[-1] == 10.0
