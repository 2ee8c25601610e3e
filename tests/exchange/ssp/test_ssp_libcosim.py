"""A scenario that was exported as an SSP, in libcosim and in our own master."""

from pathlib import Path

import numpy as np
import pytest
from libcosim_job import Job, known, needs_libcosim
from own_master import Placed
from ssp_rows import STEP, STEPS, exported, own_rows

from handover.cosim.ssp.ssp_file import SspFile


@needs_libcosim
@pytest.mark.slow
def test_an_exported_scenario_in_libcosim_is_the_same_as_in_our_own_master(tmp_path: Path):
    file = exported(tmp_path)
    with SspFile(file, STEP) as ssp:
        wanted = own_rows(ssp)
        units = {name: Placed(unit.description.path) for name, unit in ssp.system.units.items()}
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
