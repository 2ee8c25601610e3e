"""Every scenario succeeds where all units step in parallel: here, and exported in libcosim and in Ecos.

The hosts take the step that the SSP says. Our own master runs the SSP likewise, with the scenario's evaluator beside
it; in the hosts all signals must come to the same at the time of the verdict. CI has a smaller one in test_systems.py.
"""

import functools
import importlib.util
import xml.etree.ElementTree as ET
import zipfile
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from support.exchange.ecos_command import Ecos
from support.exchange.libcosim_job import Job, known, needs_libcosim
from support.exchange.own_master import Placed

from handover.cosim.master.master import Master
from handover.cosim.ssp.ssp_file import SspFile
from handover.cosim.stepping.options import Algorithm, MasterOptions
from handover.fmus import interpreter
from handover.scenarios.catalog import SCENARIOS
from handover.scenarios.cli.command import main

pytestmark = pytest.mark.hosts

in_ecos = pytest.mark.skipif(
    importlib.util.find_spec("ecospy") is None or not interpreter.library(),
    reason="ecospy has wheels for few platforms, and Ecos loads only a Python with a shared library",
)

SEED = 3
WITH_PICTURES = ("helix_handover", "helix_reflex_grasp", "helix_use_case")
"""No form of their units that exchange pictures is one that libcosim or Ecos loads, see the last tests."""
EXCHANGED = sorted(set(SCENARIOS) - set(WITH_PICTURES))


@dataclass(frozen=True)
class Verdict:
    """How a scenario ended in our own master: after how many steps, and with which values of its scalar signals."""

    step: Fraction
    steps: int
    values: dict[str, float]


@functools.cache
def exported(folder: Path, name: str) -> Path:
    file = folder / f"{name}.ssp"
    done = CliRunner().invoke(main, ["export", name, "--ssp", str(file), "--seed", str(SEED)])
    assert done.exit_code == 0, done.output
    return file


def base_step(file: Path) -> float:
    """Return the step that is written for other tools, as they find it."""
    with zipfile.ZipFile(file) as archive:
        root = ET.fromstring(archive.read("SystemStructure.ssd"))
    found = {e.get("stepSize") or e.get("baseStepSize") for e in root.iter()} - {None}
    assert len(found) == 1
    return float(str(found.pop()))


def own_verdict(file: Path, name: str) -> Verdict:
    """Run an exported scenario in parallel steps until its evaluator has seen enough; it must succeed."""
    experiment = SCENARIOS[name]()
    parameters = experiment.parameters_type()
    evaluator = experiment.evaluator(parameters)
    with SspFile(file) as ssp:
        if ssp.parallel_step is not None:
            ssp.system.set_step(ssp.parallel_step)
        (step,) = {u.period for u in ssp.system.units.values()}
        with Master(ssp.system, MasterOptions(algorithm=Algorithm.JACOBI)) as master:
            master.run(experiment.stop_time(parameters), [evaluator], lambda: evaluator.over)
            evaluator.finish(master.signals)
            values = {c.name: float(c.values[c.index]) for c in master.signals.columns()}
            steps = round(master.time / float(step))
    outcome = evaluator.outcome()
    assert outcome.success, outcome.reason
    return Verdict(step, steps, values)


@pytest.mark.parametrize("name", WITH_PICTURES)
def test_a_scenario_with_pictures_succeeds_under_jacobi(tmp_path: Path, name: str):
    out = str(tmp_path / "run")
    command = ["run", name, "--algorithm", "jacobi", "--seed", str(SEED), "--no-report", "--out", out]
    done = CliRunner().invoke(main, command)
    assert done.exit_code == 0, done.output


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("exported")


@functools.cache
def verdict_of(folder: Path, name: str) -> Verdict:
    return own_verdict(exported(folder, name), name)


@needs_libcosim
@pytest.mark.parametrize("name", EXCHANGED)
def test_an_exported_scenario_ends_in_libcosim_as_here(folder: Path, tmp_path: Path, name: str):
    file, wanted = exported(folder, name), verdict_of(folder, name)
    assert base_step(file) == float(wanted.step)
    with SspFile(file) as ssp:
        units = {n: Placed(unit.description.path) for n, unit in ssp.system.units.items()}
        job = Job(units, None, wanted.steps, ssp=file)
        found = job.run(tmp_path)
        assert sum(len(known(job.description(n).outputs)) for n in units) > 10
    last = {f"{unit}.{n}": x for unit, rows in found.items() for n, x in rows[-1].items()}
    assert len(last) > 10
    for n, x in last.items():
        np.testing.assert_allclose(x, wanted.values[n], rtol=1e-6, atol=1e-6, err_msg=n)


@in_ecos
@pytest.mark.parametrize("name", EXCHANGED)
def test_an_exported_scenario_ends_in_ecos_as_here(folder: Path, tmp_path: Path, name: str):
    """To the six decimals that Ecos writes."""
    file, wanted = exported(folder, name), verdict_of(folder, name)
    step = base_step(file)
    table = Ecos(tmp_path).simulate(tmp_path, file, step, (wanted.steps + 0.5) * step, "--parameterSet", name)
    row, compared = table[wanted.steps], 0
    for n, x in wanted.values.items():
        unit, _, port = n.partition(".")
        column = next((c for kind in ("REAL", "INT", "BOOL") if (c := f"{unit}::{port}[{kind}]") in row), None)
        if column is None:  # an enumeration
            continue
        np.testing.assert_allclose(float(row[column]), x, rtol=1e-6, atol=2e-6, err_msg=n)
        compared += 1
    assert compared > 10


@needs_libcosim
def test_libcosim_knows_no_connectors_of_pictures(folder: Path, tmp_path: Path):
    job = Job({}, None, 1, ssp=exported(folder, WITH_PICTURES[0]))
    with pytest.raises(AssertionError, match="A valid connector type was not found"):
        job.run(tmp_path)


@in_ecos
def test_ecos_takes_no_ssp_of_the_version_that_fmi_3_needs(folder: Path, tmp_path: Path):
    file = exported(folder, WITH_PICTURES[0])
    with pytest.raises(AssertionError, match=r"Unsupported SSP version: '2\.0'"):
        Ecos(tmp_path).simulate(tmp_path, file, base_step(file), 1.0, "--parameterSet", WITH_PICTURES[0])
