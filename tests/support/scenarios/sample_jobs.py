"""Jobs for worker pools: short grasps, also with units that fail."""

from dataclasses import replace
from fractions import Fraction
from pathlib import Path

from handover.cosim.stepping.options import MasterOptions
from handover.fmus.build import build_block, cached
from handover.scenarios.catalog import SCENARIOS
from handover.scenarios.runs.campaign.worker_pool import RunJob
from support.cosim.native_units import native_fmu


def job(runs: Path, name: str = "run", *parameters: str, scenario: str = "ir_grasp", seed: int = 3) -> RunJob:
    """Return the job of a run that succeeds."""
    runs.mkdir(exist_ok=True)
    fmus = {unit: str(cached(block, 3)) for unit, block in SCENARIOS[scenario].units.items()}
    options = MasterOptions()
    return RunJob(
        name=name, scenario=scenario, parameters=parameters, seed=seed, fmus=fmus, runs=str(runs), options=options
    )


def quick_job(runs: Path, name: str = "run", seed: int = 3) -> RunJob:
    """Return the job of a run of a native unit that computes next to nothing."""
    runs.mkdir(exist_ok=True)
    return RunJob(
        name=name, scenario=str(native_fmu("mass")), parameters=(), seed=seed, fmus={}, runs=str(runs),
        options=MasterOptions(), stop=Fraction(1),
    )  # fmt: skip


def bad_job(runs: Path, reflex: str, built: Path, name: str = "bad", call_limit: float | None = None) -> RunJob:
    """Return the job of a run with a reflex of `failing_reflex`, whose FMU is built into a folder."""
    good = job(runs, name)
    fmu = built / f"{reflex}.fmu"
    if not fmu.exists():
        fmu = build_block(f"support.scenarios.failing_reflex:{reflex}", 3, built, step=Fraction(3, 200))
    options = good.options if call_limit is None else replace(good.options, call_limit=call_limit)
    return replace(good, fmus={**good.fmus, "reflex": str(fmu)}, options=options)
