"""Every scenario as an SSP, all units stepped in parallel, comes to the same in libcosim and in Ecos as here.

The hosts take the step that the SSP says. By `make hosts` a scenario runs until its evaluator has seen enough, and must
succeed; in the slow tier one runs for a few steps.
"""

import functools
import importlib.util
import xml.etree.ElementTree as ET
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from support.exchange.ecos_command import Ecos
from support.exchange.libcosim_job import Job, needs_libcosim
from support.exchange.own_master import Placed

from handover.cosim.master.master import Master
from handover.cosim.ssp.ssp_file import SspFile
from handover.cosim.stepping.options import Algorithm, MasterOptions
from handover.cosim.system.signals import Signals
from handover.fmus import interpreter
from handover.scenarios.catalog import SCENARIOS
from handover.scenarios.cli.command import main

needs_ecos = pytest.mark.skipif(
    importlib.util.find_spec("ecospy") is None or not interpreter.library(),
    reason="ecospy has wheels for few platforms, and Ecos loads only a Python with a shared library",
)

SEED = 3
WITH_PICTURES = ("helix_handover", "helix_reflex_grasp", "helix_use_case")
"""No form of their units that exchange pictures is one that libcosim or Ecos loads, see the last tests."""
FEW = 40


@dataclass(frozen=True)
class Ending:
    """How a scenario ended in our own master: after how many steps, and with which values of its scalar signals."""

    step: Fraction
    steps: int
    values: dict[str, float]
    moved: set[str]
    """Signals that had many values."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("exported")


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
    (found,) = {e.get("stepSize") or e.get("baseStepSize") for e in root.iter()} - {None}
    return float(str(found))


@functools.cache
def ending(folder: Path, name: str, few: bool) -> Ending:
    experiment = SCENARIOS[name]()
    parameters = experiment.parameters_type()
    evaluator = experiment.evaluator(parameters)
    seen: dict[str, set[float]] = {}

    def look(t: float, signals: Signals) -> None:
        evaluator(t, signals)
        for c in signals.columns():
            seen.setdefault(c.name, set()).add(float(c.values[c.index]))

    with SspFile(exported(folder, name)) as ssp:
        if ssp.parallel_step is not None:
            ssp.system.set_step(ssp.parallel_step)
        (step,) = {u.period for u in ssp.system.units.values()}
        with Master(ssp.system, MasterOptions(algorithm=Algorithm.JACOBI)) as master:
            stop = FEW * step if few else experiment.stop_time(parameters)
            master.run(stop, [look], lambda: evaluator.over)
            evaluator.finish(master.signals)
            values = {c.name: float(c.values[c.index]) for c in master.signals.columns()}
            steps = round(master.time / float(step))
    outcome = evaluator.outcome()
    assert few or outcome.success, outcome.reason
    return Ending(step, steps, values, {name for name, values in seen.items() if len(values) > FEW // 2})


def in_libcosim(file: Path, wanted: Ending, name: str, folder: Path) -> dict[str, float]:  # noqa: ARG001
    with SspFile(file) as ssp:
        units = {n: Placed(unit.description.path) for n, unit in ssp.system.units.items()}
        found = Job(units, None, wanted.steps, ssp=file).run(folder)
    return {f"{unit}.{n}": x for unit, rows in found.items() for n, x in rows[-1].items()}


def in_ecos(file: Path, wanted: Ending, name: str, folder: Path) -> dict[str, float]:
    """Return to the six decimals that Ecos writes; it applies the parameter sets of the name that it is given."""
    step = base_step(file)
    row = Ecos(folder).simulate(folder, file, step, (wanted.steps + 0.5) * step, "--parameterSet", name)[wanted.steps]
    columns = {n: f"{n.partition('.')[0]}::{n.partition('.')[2]}" for n in wanted.values}
    found = {n: row.get(f"{c}[REAL]", row.get(f"{c}[INT]", row.get(f"{c}[BOOL]"))) for n, c in columns.items()}
    return {n: float(x) for n, x in found.items() if x is not None}  # enumerations are missing


HOSTS: dict[str, tuple[Callable[..., dict[str, float]], Any]] = {
    "libcosim": (in_libcosim, needs_libcosim),
    "Ecos": (in_ecos, needs_ecos),
}
SLOW = {"libcosim": [pytest.mark.slow, pytest.mark.machine], "Ecos": [pytest.mark.slow]}
IN_FULL = sorted(set(SCENARIOS) - set(WITH_PICTURES))
"""`flyer_impedance` runs for a few steps, too: its units have FMI 2 forms, steps of one length and no enumerations."""
CASES = [
    *(pytest.param("flyer_impedance", h, True, 1e-9, marks=[skip, *SLOW[h]]) for h, (_, skip) in HOSTS.items()),
    *(
        pytest.param(name, h, False, 1e-6, marks=[skip, pytest.mark.hosts])
        for h, (_, skip) in HOSTS.items()
        for name in IN_FULL
    ),
]


@pytest.mark.parametrize(("name", "host", "few", "tolerance"), CASES)
def test_an_exported_scenario_ends_as_here(
    folder: Path, tmp_path: Path, name: str, host: str, few: bool, tolerance: float
):
    file, wanted = exported(folder, name), ending(folder, name, few)
    assert base_step(file) == float(wanted.step)
    found = HOSTS[host][0](file, wanted, name, tmp_path)
    off = max(tolerance, 2e-6 if host == "Ecos" else 0.0)
    for n, x in found.items():
        np.testing.assert_allclose(x, wanted.values[n], rtol=tolerance, atol=off, err_msg=n)
    assert len(wanted.moved & found.keys()) > 10


@pytest.mark.hosts
@pytest.mark.parametrize("name", WITH_PICTURES)
def test_a_scenario_with_pictures_succeeds_under_jacobi(tmp_path: Path, name: str):
    out = str(tmp_path / "run")
    command = ["run", name, "--algorithm", "jacobi", "--seed", str(SEED), "--no-report", "--out", out]
    done = CliRunner().invoke(main, command)
    assert done.exit_code == 0, done.output


@needs_libcosim
@pytest.mark.hosts
def test_libcosim_knows_no_connectors_of_pictures(folder: Path, tmp_path: Path):
    job = Job({}, None, 1, ssp=exported(folder, WITH_PICTURES[0]))
    with pytest.raises(AssertionError, match="A valid connector type was not found"):
        job.run(tmp_path)


@needs_ecos
@pytest.mark.hosts
def test_ecos_takes_no_ssp_of_the_version_that_fmi_3_needs(folder: Path, tmp_path: Path):
    file = exported(folder, WITH_PICTURES[0])
    with pytest.raises(AssertionError, match=r"Unsupported SSP version: '2\.0'"):
        Ecos(tmp_path).simulate(tmp_path, file, base_step(file), 1.0, "--parameterSet", WITH_PICTURES[0])
