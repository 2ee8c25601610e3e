"""Small systems inside containers of fmu-manipulation-toolbox are the same as in our own master.

One is tried in the slow tier; the others are for `make hosts`, as are single units, the rows of docs/hosts.md.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from support.exchange import systems
from support.exchange.container import outputs_of, put_into_container
from support.exchange.fmpy_rows import record_in_fmpy
from support.exchange.own_master import Placed, run_in_our_own
from support.exchange.reference import expect_same

STEPS = 40


@pytest.mark.parametrize(
    ("loop", "fmi", "options"),
    [
        pytest.param(systems.free_flyer, 2, ("-mt",), marks=pytest.mark.slow),
        pytest.param(systems.free_flyer, 3, (), marks=pytest.mark.hosts),
        pytest.param(systems.grasp, 2, (), marks=pytest.mark.hosts),
        pytest.param(systems.grasp, 3, ("-mt",), marks=pytest.mark.hosts),
    ],
)
def test_a_closed_loop_in_a_container(loop: Any, options: Sequence[str], fmi: int, tmp_path: Path):
    """The container's library loads the units' libraries; it has one thread, or with `-mt` one for each."""
    wired: systems.Wired = loop(fmi, scalar=fmi == 3)
    container = put_into_container(wired, fmi, tmp_path, options)
    wanted = run_in_our_own(wired.units, wired.connections, wired.step, STEPS)
    together = {"one": Placed(container), **wired.units, "two": Placed(container)}
    in_our_own = run_in_our_own(together, wired.connections, wired.step, STEPS)
    nothing: dict[str, float] = {}
    in_fmpy = record_in_fmpy(container, tmp_path / "unpacked", float(wired.step), [nothing] * STEPS).rows
    for name, record in wanted.items():
        assert record.rows[1] != record.rows[-1]
        expect_same(in_our_own[name].rows, record)
        expect_same(outputs_of(name, in_our_own["one"].rows), record)
        expect_same(outputs_of(name, in_our_own["two"].rows), record)
        expect_same(outputs_of(name, in_fmpy), record)


@pytest.mark.hosts
@pytest.mark.parametrize("wire", [systems.free_flyer, systems.grasp, systems.eyes])
def test_arrays_and_pictures_in_a_container(wire: Any, tmp_path: Path):
    wired: systems.Wired = wire(3)
    container = put_into_container(wired, 3, tmp_path)
    wanted = run_in_our_own(wired.units, wired.connections, wired.step, 6)
    found = run_in_our_own({"container": Placed(container)}, [], wired.step, 6)["container"].rows
    for name, record in wanted.items():
        assert record.rows[1] != record.rows[-1] or not record.rows[0]
        expect_same(outputs_of(name, found), record)
