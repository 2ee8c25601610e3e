"""A scenario that was exported as an SSP, in libcosim and in our own master."""

from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from libcosim_job import Job, known
from own_master import Placed

from cosim.master import Master
from cosim.master_options import Algorithm, MasterOptions
from cosim.signals import Signals
from cosim.ssp.ssp_file import SspFile
from scenarios.command import main

STEP, STEPS = Fraction(2, 125), 100


@pytest.mark.slow
def test_an_exported_scenario_in_libcosim_is_the_same_as_in_our_own_master(tmp_path: Path):
    file = tmp_path / "flyer.ssp"
    done = CliRunner().invoke(main, ["export", "flyer_impedance", "--ssp", str(file), "--seed", "3"])
    assert done.exit_code == 0, done.output
    wanted: list[dict[str, float]] = []

    def observe(t: float, signals: Signals) -> None:  # noqa: ARG001
        wanted.append({c.name: float(c.values[c.index]) for c in signals.columns()})

    with SspFile(file, STEP) as ssp:
        units = {name: Placed(unit.description.path) for name, unit in ssp.system.units.items()}
        with Master(ssp.system, MasterOptions(algorithm=Algorithm.JACOBI)) as master:
            master.run(STEPS * STEP, [observe])
        job = Job(units, STEP, STEPS, ssp=file)
        found = job.run(tmp_path)
        names = [f"{unit}.{port.name}" for unit in units for port in known(job.description(unit).outputs)]
    assert len(names) > 10
    rows = [{f"{u}.{n}": x for u in units for n, x in found[u][k].items()} for k in range(STEPS)]
    assert {n.partition("[")[0] for n in rows[0]} == set(names)
    moved = 0
    for name in rows[0]:
        theirs, ours = [row[name] for row in rows], [row[name] for row in wanted[1:]]
        np.testing.assert_allclose(theirs, ours, rtol=0, atol=1e-9, err_msg=name)
        moved += len(set(ours)) > STEPS // 2
    assert moved > 10
