"""Carries out one run of a scenario: everything is checked, then the folder is made, then it runs and is reported."""

import math
import statistics
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cosim.exceptions import UnitFailure
from cosim.master import Master
from cosim.master_options import MasterOptions
from cosim.recorder import Recorder
from cosim.signals import Signals
from scenarios.experiment import Experiment, Metric, Outcome, Watch
from scenarios.interruption import Interruption
from scenarios.record import Record
from scenarios.report import write_report
from scenarios.run_folder import RunFolder

Progress = Callable[[float, float], None]
"""Told the simulated time and the time at which the run ends at the latest, in seconds."""


@dataclass(frozen=True, kw_only=True)
class Task:
    """What to run: scenario, parameters, seed, the FMU of each unit, the folder for what it leaves."""

    experiment: Experiment[Any]
    parameters: Any
    seed: int
    fmus: Mapping[str, Path]
    folder: RunFolder


@dataclass(frozen=True, kw_only=True)
class Ended:
    """How a run ended. `failure` is set when a unit failed; the record then ends there."""

    outcome: Outcome
    summary: Mapping[str, Any]
    failure: UnitFailure | None = None


def carry_out(task: Task, progress: Progress, interruption: Interruption) -> Ended:
    """Run a scenario to its end, its failure or its interruption and write its folder.

    Raises:
        WiringError, ScheduleError, InvalidFmu, UnitRefused, BadRunFolder: before anything was written.
        KeyboardInterrupt: it was aborted; what was recorded stays.
    """
    experiment, parameters = task.experiment, task.parameters
    stop = experiment.stop_time(parameters)
    watch = experiment.watch(parameters)
    failure: UnitFailure | None = None
    began, cpu_began = time.perf_counter(), time.process_time()
    system = experiment.build(parameters, task.seed, lambda unit: task.fmus[unit])
    with Master(system, MasterOptions(cpu_times=True)) as master:
        interruption.begin()
        task.folder.make()
        with Recorder(task.folder.signals) as recorder:

            def tell(t: float, _signals: Signals) -> None:
                progress(t, float(stop))

            try:
                master.run(stop, [recorder, watch, tell], until=lambda: watch.over or interruption.asked)
                watch.finish(master.signals)
            except UnitFailure as e:
                interruption.check()
                failure = e
    spent = {"wall": time.perf_counter() - began, "cpu": time.process_time() - cpu_began}
    outcome = _outcome(watch, failure, interruption.asked)
    metrics = {**outcome.metrics, **_speed(experiment, master)}
    summary = _summary(task, outcome, metrics, master, spent)
    task.folder.write_summary(summary)
    task.folder.write_run(_configuration(task), {n: u.description.path for n, u in system.units.items()})
    _present(task, watch, summary, system_rows(master))
    return Ended(outcome=outcome, summary=summary, failure=failure)


def system_rows(master: Master) -> list[tuple[str, str, str, int, float]]:
    """Return name, FMU, period, steps and CPU seconds of each unit."""
    rows: list[tuple[str, str, str, int, float]] = []
    for name, unit in master.system.units.items():
        d = unit.description
        period = f"{float(unit.period) * 1000:.4g} ms"
        rows.append((name, f"{d.name} (FMI {d.fmi})", period, len(master.cpu[name]), sum(master.cpu[name])))
    return rows


def _outcome(watch: Watch, failure: UnitFailure | None, interrupted: bool) -> Outcome:
    seen = watch.outcome()
    if failure is not None:
        return Outcome(success=False, reason=f"a unit failed: {failure.cause}", metrics=seen.metrics)
    if interrupted and not watch.over:
        return Outcome(success=False, reason=f"interrupted: {seen.reason}", metrics=seen.metrics)
    return seen


def _speed(experiment: Experiment[Any], master: Master) -> dict[str, Metric]:
    cycle = [statistics.median(master.cpu[u]) for u in experiment.cycle() if master.cpu[u]]
    peak = _peak_memory()
    units = " + ".join(experiment.cycle())
    metrics: dict[str, Metric] = {}
    if peak is not None:
        metrics["peak_memory"] = Metric(peak, "B", "largest resident memory of the process")
    if cycle:
        metrics["cpu_per_cycle"] = Metric(sum(cycle), "s", f"median CPU time of a control cycle ({units})")
    for name, spent in master.cpu.items():
        total = float(np.sum(spent))
        metrics[f"cpu_{name}"] = Metric(total, "s", f"CPU time of {name} in all")
        simulated = len(spent) * float(master.system.units[name].period)
        metrics[f"pace_{name}"] = Metric(simulated / total if total else 0.0, "1", f"simulated s per CPU s of {name}")
    return metrics


def _peak_memory() -> float | None:
    """Return the process's largest resident memory in bytes, None where the system does not tell (Windows)."""
    try:
        import resource
    except ImportError:
        return None
    return float(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss) * (1 if sys.platform == "darwin" else 1024)


def _configuration(task: Task) -> dict[str, Any]:
    values = {v.name: _plain(getattr(task.parameters, v.name)) for v in task.experiment.parameters()}
    return {"scenario": task.experiment.name, "parameters": values, "seed": task.seed}


def _summary(
    task: Task, outcome: Outcome, metrics: Mapping[str, Metric], master: Master, spent: Mapping[str, float]
) -> dict[str, Any]:
    return {
        **_configuration(task),
        "success": outcome.success,
        "reason": outcome.reason,
        "metrics": {k: _metric(m) for k, m in metrics.items()},
        "simulated_seconds": master.time,
        "wall_seconds": spent["wall"],
        "cpu_seconds": spent["cpu"],
    }


def _metric(m: Metric) -> dict[str, Any]:
    """Return a metric as JSON, which knows no infinity: what is not finite is null."""
    return {"value": m.value if math.isfinite(m.value) else None, "unit": m.unit, "description": m.description}


def _present(
    task: Task, watch: Watch, summary: Mapping[str, Any], units: Sequence[tuple[str, str, str, int, float]]
) -> None:
    figures = []
    if task.folder.signals.exists():
        record = Record(task.folder.signals)
        figures = task.experiment.draw(task.parameters, watch, record, task.folder.figures)
    write_report(task.folder, task.experiment, summary, _parameter_rows(task), units, figures)


def _parameter_rows(task: Task) -> list[tuple[str, str, str]]:
    rows: list[tuple[str, str, str]] = []
    for v in task.experiment.parameters():
        value = _plain(getattr(task.parameters, v.name))
        told = (
            f"{value:g}" if isinstance(value, float) else str(value).lower() if isinstance(value, bool) else str(value)
        )
        unit = "" if v.unit.symbol == "1" else f" {v.unit.symbol}"
        rows.append((v.name, told + unit, v.description))
    return rows


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.tolist()
    name = getattr(value, "name", None)
    return value if name is None else name.lower()
