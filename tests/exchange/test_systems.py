"""Small systems in foreign hosts are the same as in our own master: of each host one in the slow tier.

The others are for `make hosts`, as are single units in these hosts, the rows of docs/hosts.md.
"""

import importlib.util
import itertools
from collections.abc import Callable, Iterable, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from support.exchange import systems
from support.exchange.container import outputs_of, put_into_container
from support.exchange.ecos_command import Ecos
from support.exchange.fmpy_rows import record_in_fmpy
from support.exchange.libcosim_job import Job, known, needs_libcosim, without_enumerations
from support.exchange.own_master import Placed, run_in_our_own
from support.exchange.reference import expect_same

from handover.cosim.master.master import Master
from handover.cosim.ssp.ssp_file import SspFile
from handover.cosim.stepping.options import Algorithm, MasterOptions
from handover.cosim.system.signals import Signals
from handover.fmus import interpreter
from handover.fmus.build import cached
from handover.scenarios.cli.command import main

needs_ecos = pytest.mark.skipif(
    importlib.util.find_spec("ecospy") is None or not interpreter.library(),
    reason="ecospy has wheels for few platforms, and Ecos loads only a Python with a shared library",
)

STEPS = 40
LOOPS = [systems.free_flyer, systems.grasp, systems.vsl]
WITH_ARRAYS = [systems.free_flyer, systems.grasp, systems.eyes]

SCENARIO = "flyer_impedance"
"""Its units have FMI 2 forms, steps of one length, and no enumerations that would have to be set."""
STEP, EXPORTED_STEPS = Fraction(2, 125), 100


def first_is_slow(cases: Iterable[tuple[Any, ...]]) -> list[Any]:
    return [pytest.param(*c, marks=pytest.mark.hosts if i else pytest.mark.slow) for i, c in enumerate(cases)]


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the SSP of the scenario."""
    file = tmp_path_factory.mktemp("exported") / f"{SCENARIO}.ssp"
    done = CliRunner().invoke(main, ["export", SCENARIO, "--ssp", str(file), "--seed", "3"])
    assert done.exit_code == 0, done.output
    return file


def own_rows(ssp: SspFile) -> list[dict[str, float]]:
    """Return all scalar signals at every communication point, all units stepped in parallel."""
    rows: list[dict[str, float]] = []

    def observe(t: float, signals: Signals) -> None:  # noqa: ARG001
        rows.append({c.name: float(c.values[c.index]) for c in signals.columns()})

    with Master(ssp.system, MasterOptions(algorithm=Algorithm.JACOBI)) as master:
        master.run(EXPORTED_STEPS * STEP, [observe])
    return rows


@needs_libcosim
@pytest.mark.slow
@pytest.mark.machine
def test_an_exported_scenario_in_libcosim(exported: Path, tmp_path: Path):
    with SspFile(exported, STEP) as ssp:
        wanted = own_rows(ssp)
        units = {name: Placed(unit.description.path) for name, unit in ssp.system.units.items()}
        job = Job(units, STEP, EXPORTED_STEPS, ssp=exported)
        found = job.run(tmp_path)
        names = [f"{unit}.{port.name}" for unit in units for port in known(job.description(unit).outputs)]
    assert len(names) > 10
    rows = [{f"{u}.{n}": x for u in units for n, x in found[u][k].items()} for k in range(EXPORTED_STEPS)]
    assert {n.partition("[")[0] for n in rows[0]} == set(names)
    moved = 0
    for name in rows[0]:
        theirs, ours = [row[name] for row in rows], [row[name] for row in wanted[1:]]
        np.testing.assert_allclose(theirs, ours, rtol=0, atol=1e-9, err_msg=name)
        moved += len(set(ours)) > EXPORTED_STEPS // 2
    assert moved > 10


@needs_ecos
@pytest.mark.slow
def test_an_exported_scenario_in_ecos(exported: Path, tmp_path: Path):
    """To the six decimals that Ecos writes. It applies the parameter sets of the name that it is given."""
    with SspFile(exported, STEP) as ssp:
        wanted = own_rows(ssp)
    stop = float((EXPORTED_STEPS + 0.5) * STEP)
    table = Ecos(tmp_path).simulate(tmp_path, exported, float(STEP), stop, "--parameterSet", SCENARIO)
    assert len(table) > EXPORTED_STEPS
    compared = 0
    for name in wanted[0]:
        unit, _, port = name.partition(".")
        column = next((c for t in ("REAL", "INT", "BOOL") if (c := f"{unit}::{port}[{t}]") in table[0]), None)
        if column is None:  # an enumeration
            continue
        theirs, ours = [float(row[column]) for row in table[: EXPORTED_STEPS + 1]], [row[name] for row in wanted]
        np.testing.assert_allclose(theirs, ours, rtol=0, atol=1e-6, err_msg=name)
        compared += len(set(ours)) > EXPORTED_STEPS // 2
    assert compared > 10


@needs_libcosim
@pytest.mark.hosts
@pytest.mark.parametrize("wire", LOOPS)
def test_a_closed_loop_in_libcosim(wire: Callable[[int], systems.Wired], tmp_path: Path):
    units, connections, step = wire(2)
    job = Job(units, step, STEPS, connections)
    found, wanted = job.run(tmp_path), run_in_our_own(units, connections, step, STEPS)
    for name in units:
        assert wanted[name].rows[1] != wanted[name].rows[-1]
        expect_same(found[name], without_enumerations(wanted[name], job.description(name)), first=1)


@pytest.mark.parametrize(("loop", "fmi", "options"), first_is_slow(itertools.product(LOOPS, (2, 3), (("-mt",), ()))))
def test_a_closed_loop_in_a_container(loop: Any, options: Sequence[str], fmi: int, tmp_path: Path):
    """The container's library loads the units' libraries; it has one thread, or with `-mt` one for each."""
    wired: systems.Wired = loop(fmi, scalar=fmi == 3)
    container = put_into_container(wired, fmi, tmp_path, options)
    wanted = run_in_our_own(wired.units, wired.connections, wired.step, STEPS)
    in_our_own = run_in_our_own({"container": Placed(container)}, [], wired.step, STEPS)["container"].rows
    nothing: dict[str, float] = {}
    in_fmpy = record_in_fmpy(container, tmp_path / "unpacked", float(wired.step), [nothing] * STEPS).rows
    for name, record in wanted.items():
        assert record.rows[1] != record.rows[-1]
        expect_same(outputs_of(name, in_our_own), record)
        expect_same(outputs_of(name, in_fmpy), record)


@pytest.mark.hosts
@pytest.mark.parametrize("wire", WITH_ARRAYS)
def test_arrays_and_pictures_in_a_container(wire: Callable[[int], systems.Wired], tmp_path: Path):
    wired = wire(3)
    container = put_into_container(wired, 3, tmp_path)
    wanted = run_in_our_own(wired.units, wired.connections, wired.step, 6)
    found = run_in_our_own({"container": Placed(container)}, [], wired.step, 6)["container"].rows
    for name, record in wanted.items():
        assert record.rows[1] != record.rows[-1] or not record.rows[0]
        expect_same(outputs_of(name, found), record)


@pytest.mark.hosts
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


@pytest.mark.hosts
@needs_ecos
def test_arrays_shift_what_ecos_reads(tmp_path: Path):
    """This is why there is a scalar form; if it fails, Ecos has learnt arrays and the README may say so."""
    ecos = Ecos(tmp_path)
    fmus = cached("Thrusters", 3), cached("Thrusters", 3, scalar=True)
    last = [ecos.simulate(tmp_path, fmu, 0.016, 0.5)[-1] for fmu in fmus]
    assert all(float(cells["time"]) > 0.4 for cells in last)
    whole, scalar = (float(cells["instance::time[REAL]"]) for cells in last)
    assert scalar == float(last[1]["time"])
    assert whole != float(last[0]["time"])
