"""Our units inside one FMU that fmu-manipulation-toolbox makes, whose library loads theirs.

The other units in a container, and the same in other hosts, are the rows of docs/hosts.md (`make hosts`).
"""

from collections.abc import Sequence
from pathlib import Path

import drive
import pytest
import systems
from container import outputs_of, put_into_container
from fmpy_rows import record_in_fmpy
from own_master import Placed, run_in_our_own
from reference import References, description, expect_same

from handover.fmus.build import cached
from handover.fmus.catalog import UNITS

LIGHT = "Thrusters"
STEPS = 40

LOOPS = {"free flyer": systems.free_flyer, "grasp": systems.grasp, "VSL": systems.vsl}
WITH_ARRAYS = {"free flyer": systems.free_flyer, "grasp": systems.grasp, "eyes": systems.eyes}


@pytest.mark.parametrize("fmi", [2, 3])
def test_a_unit_in_a_container_is_the_same_as_without(fmi: int, references: References, tmp_path: Path):
    unit = LIGHT
    d, step = description(unit), UNITS[unit].step
    driven = [{f"unit_{n}": x for n, x in drive.inputs(d, k).items()} for k in range(drive.STEPS)]
    placed = Placed(cached(unit, fmi, scalar=fmi == 3), drive.parameters(d))
    container = put_into_container(systems.Wired({"unit": placed}, [], step), fmi, tmp_path)
    in_fmpy = record_in_fmpy(container, tmp_path / "unpacked", float(step), driven).rows
    expect_same(outputs_of("unit", in_fmpy), references.varying(unit, fmi))
    in_our_own = run_in_our_own({"container": Placed(container, driven[0])}, [], step, drive.STEPS)["container"]
    expect_same(outputs_of("unit", in_our_own.rows), references.held(unit, fmi))


@pytest.mark.slow
@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("options", [(), ("-mt",)], ids=["one thread", "many threads"])
@pytest.mark.parametrize("loop", LOOPS)
def test_a_closed_loop_in_a_container_is_the_same_as_without(
    loop: str, options: Sequence[str], fmi: int, tmp_path: Path
):
    wired = LOOPS[loop](fmi, scalar=fmi == 3)
    container = put_into_container(wired, fmi, tmp_path, options)
    wanted = run_in_our_own(wired.units, wired.connections, wired.step, STEPS)
    in_our_own = run_in_our_own({"container": Placed(container)}, [], wired.step, STEPS)["container"].rows
    nothing: dict[str, float] = {}
    in_fmpy = record_in_fmpy(container, tmp_path / "unpacked", float(wired.step), [nothing] * STEPS).rows
    for name, record in wanted.items():
        assert record.rows[1] != record.rows[-1]
        expect_same(outputs_of(name, in_our_own), record)
        expect_same(outputs_of(name, in_fmpy), record)


@pytest.mark.slow
@pytest.mark.parametrize("system", WITH_ARRAYS)
def test_arrays_and_pictures_in_a_container_are_the_same_as_without(system: str, tmp_path: Path):
    wired = WITH_ARRAYS[system](3)
    container = put_into_container(wired, 3, tmp_path)
    wanted = run_in_our_own(wired.units, wired.connections, wired.step, 6)
    found = run_in_our_own({"container": Placed(container)}, [], wired.step, 6)["container"].rows
    for name, record in wanted.items():
        assert record.rows[1] != record.rows[-1] or not record.rows[0]
        expect_same(outputs_of(name, found), record)


@pytest.mark.slow
def test_two_containers_and_the_units_themselves_run_beside_each_other(tmp_path: Path):
    wired = systems.free_flyer(2)
    container = Placed(put_into_container(wired, 2, tmp_path, ["-mt"]))
    alone = run_in_our_own(wired.units, wired.connections, wired.step, STEPS)
    together = {"one": container, **wired.units, "two": container}
    found = run_in_our_own(together, wired.connections, wired.step, STEPS)
    for name, record in alone.items():
        expect_same(found[name].rows, record)
        expect_same(outputs_of(name, found["one"].rows), record)
        expect_same(outputs_of(name, found["two"].rows), record)
