"""A catalogued unit goes on from a restored state as if it had never stopped, bit for bit, wherever that is."""

from collections.abc import Iterator
from multiprocessing.pool import Pool
from pathlib import Path

import pytest
from support.commands import forking
from support.fmus.fmpy_host import FmpyHost
from support.fmus.state_runs import STEPS, inputs_at, other_parameters, run, run_on

from handover.fmus.build import cached
from handover.fmus.catalog import UNITS

LIMIT = 120.0
"""Seconds that another process has for a run."""

IN_BOTH = ("FreeFlyer", "HandoverStateMachine")
"""Units whose FMI 2 form is tried too; what differs between the forms is not the unit's."""

OF_EACH_KIND = ("Push", "VslArm")
"""Units in the fast tier."""

IN_CI = (
    "TendonArm", "TendonArmFast", "StereoCamera", "HandoverVision", "LargeObjectAndHands", "HandAndObject",
    "GraspScene", "IrReflex",
)  # fmt: skip
"""Units in the slow tier: with pictures, solvers of others, or much of a state; of the rest the blocks are tested."""

FORMS = [(n, 2) for n in IN_BOTH] + [
    pytest.param(n, 3, marks=[] if n in OF_EACH_KIND else [pytest.mark.slow if n in IN_CI else pytest.mark.fuzz])
    for n in UNITS
]


@pytest.fixture(scope="module")
def other_process() -> Iterator[Pool]:
    """A Python that shares no unit with this one; it is ended after the module's last test, whatever it does."""
    with forking().Pool(1) as process:
        yield process


@pytest.mark.parametrize(("name", "fmi"), FORMS)
def test_a_unit_goes_on_from_a_restored_state_bit_for_bit(name: str, fmi: int, tmp_path: Path, other_process: Pool):
    fmu = cached(name, fmi)
    initialising, at_start, later = (tmp_path / n for n in ("initialising", "at start", "later"))
    with FmpyHost(fmu) as host:
        host.set(other_parameters(name))
        host.enter()
        host.set(inputs_at(name, 1))
        initialising.write_bytes(host.saved())
        host.leave()
        at_start.write_bytes(host.saved())
        before = [host.outputs(), *run(host, 0)]
        later.write_bytes(host.saved())
        kept = host.fmu.getFMUState()
        after = [host.outputs(), *run(host, STEPS)]

        host.fmu.setFMUState(kept)
        assert [host.outputs(), *run(host, STEPS)] == after
        host.fmu.freeFMUState(kept)

    assert before[1:] != after[1:]
    assert run_on(fmu, at_start, 0) == before

    def there(state: Path, first: int, *, initialising: bool = False) -> object:
        return other_process.apply_async(run_on, (fmu, state, first), {"initialising": initialising}).get(LIMIT)

    assert there(later, STEPS) == after
    assert there(initialising, 0, initialising=True) == before
