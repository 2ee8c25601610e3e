"""What a run's folder says of it: what was chosen, what came out, and the rows of its report's tables.

Figures of every run, whatever the scenario: what it cost in CPU time, memory and iterations.

What a run's folder keeps of its system: the units, and which output feeds which input.
"""

import math
import statistics
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from handover.cosim.exceptions import UnitFailure
from handover.cosim.master.master import Master
from handover.cosim.stepping.iteration import IterationCount
from handover.cosim.system.system import Connection, System
from handover.scenarios.execution.resumption import Spent
from handover.scenarios.experiment.display_unit import unit_symbol
from handover.scenarios.experiment.experiment import Experiment, Metric, Outcome
from handover.scenarios.results.tables import conversions_of, told_value
from handover.scenarios.results.task import Task


def told_system(system: System, *, adaptive: bool) -> dict[str, Any]:
    """Return units and connections of a system without faults, as JSON can hold it.

    `adaptive` says that the master chooses its steps: then only sampled units have a period of their own.
    """
    units = [
        {
            "name": name,
            "model": unit.description.name,
            "fmi": str(unit.description.fmi),
            "period": None if adaptive and not unit.sampled else float(unit.period),
            "sampled": unit.sampled,
        }
        for name, unit in system.units.items()
    ]
    return {"units": units, "connections": [_told(system, c) for c in system.connections]}


def _told(system: System, c: Connection) -> dict[str, Any]:
    port = system.units[c.source.unit].description.outputs.get(c.source.port)
    if port is None:
        kind, unit, size = "clock", "", 1
    else:
        kind, unit, size = port.kind.value, port.unit.symbol, port.size
    return {"source": str(c.source), "target": str(c.target), "unit": unit, "size": size, "kind": kind}


UnitRow = tuple[str, str, str, int | None, float | None]
"""Name, FMU, step, number of steps and CPU seconds of a unit, the last two where they are known."""


def configuration(task: Task) -> dict[str, Any]:
    """Return what decides on a run's signals, as JSON can hold it."""
    values = {v.name: _plain(getattr(task.parameters, v.name)) for v in task.experiment.parameters()}
    seed = task.seed if task.experiment.is_seeded else None
    return {"scenario": task.experiment.name, "parameters": values, "seed": seed, "master": task.options.as_data()}


def files_and_forms(task: Task) -> dict[str, Any]:
    """Return what else a run needs to go on in another process, as JSON can hold it."""
    every = None if task.every is None else str(task.every)
    files = {name: str(path.absolute()) for name, path in task.fmus.items()}
    return {"source": task.source, "files": files, "formats": list(task.formats), "checkpoint": every}


def told_task(task: Task) -> dict[str, Any]:
    """Return what is told of a run that is known before its system is, as JSON can hold it."""
    return {
        "title": task.experiment.title,
        "headline": list(task.experiment.headline),
        "told_parameters": [list(row) for row in parameter_rows(task)],
    }


def presentation(task: Task, master: Master) -> dict[str, Any]:
    """Return what is needed to present a run by its folder alone, as JSON can hold it."""
    return {
        **told_task(task),
        "system": told_system(master.system, adaptive=master.steps is not None),
        "conversions": conversions_of(master.system),
    }


def summary_of(
    task: Task,
    outcome: Outcome,
    metrics: Mapping[str, Metric],
    master: Master,
    spent: Spent,
    failure: UnitFailure | None,
    complete: bool,
) -> dict[str, Any]:
    """Return a run's summary as JSON can hold it; a run that is not complete can go on."""
    return {
        **configuration(task),
        "complete": complete,
        "success": outcome.success,
        "reason": outcome.reason,
        "metrics": {k: metric_data(m) for k, m in metrics.items()},
        "simulated_seconds": master.time,
        **({} if master.steps is None else {"steps": asdict(master.steps)}),
        "wall_seconds": spent.wall,
        "cpu_seconds": spent.cpu,
        "units": unit_data(unit_rows(master)),
        "failure": None if failure is None else failure.as_data(),
        **({} if master.pacer is None else {"pace": master.pacer.report.as_data()}),
    }


def metric_data(m: Metric) -> dict[str, Any]:
    """Return a metric as JSON, which knows no infinity: what is not finite is null."""
    return {"value": m.value if math.isfinite(m.value) else None, "unit": m.unit, "description": m.description}


def parameter_rows(task: Task) -> list[tuple[str, str, str]]:
    """Return name, value with unit, and description of each parameter."""
    rows: list[tuple[str, str, str]] = []
    for v in task.experiment.parameters():
        value = _plain(getattr(task.parameters, v.name))
        unit = unit_symbol(v.unit.symbol)
        rows.append((v.name, f"{told_value(value)} {unit}".rstrip(), v.description))
    return rows


def unit_rows(master: Master) -> list[UnitRow]:
    """Return what is told of each unit."""
    rows: list[UnitRow] = []
    for name, unit in master.system.units.items():
        d = unit.description
        follows = master.steps is not None and not unit.sampled
        period = "varies" if follows else f"{float(unit.period) * 1000:.4g} ms"
        rows.append((name, f"{d.name} (FMI {d.fmi})", period, len(master.cpu[name]), sum(master.cpu[name])))
    return rows


def unit_data(rows: Sequence[UnitRow]) -> list[dict[str, Any]]:
    """Return rows of units as JSON can hold them."""
    return [dict(zip(("name", "model", "step", "steps", "cpu_seconds"), row, strict=True)) for row in rows]


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.tolist()
    name = getattr(value, "name", None)
    return value if name is None else name.lower()


def run_metrics(experiment: Experiment[Any], master: Master) -> dict[str, Metric]:
    """Return the figures of a run by name, those in seconds in CPU time."""
    cycle = [statistics.median(master.cpu[u]) for u in experiment.cycle() if master.cpu[u]]
    peak = peak_memory()
    units = " + ".join(experiment.cycle())
    metrics: dict[str, Metric] = {}
    if peak is not None:
        metrics["peak_memory"] = Metric(peak, "B", "largest resident memory of the process")
    if cycle:
        metrics["cpu_per_cycle"] = Metric(sum(cycle), "s", f"median CPU time of a control cycle ({units})")
    for name, spent in master.cpu.items():
        total = float(np.sum(spent))
        metrics[f"cpu_{name}"] = Metric(total, "s", f"CPU time of {name} in all")
        unit = master.system.units[name]  # its own period says nothing of steps that follow their error
        simulated = master.time if master.steps and not unit.sampled else len(spent) * float(unit.period)
        metrics[f"pace_{name}"] = Metric(simulated / total if total else 0.0, "1", f"simulated s per CPU s of {name}")
    return {**metrics, **_iterations(master.iterations)}


def peak_memory() -> float | None:
    """Return the process's largest resident memory in bytes, None where the system does not tell (Windows)."""
    try:
        import resource
    except ImportError:
        return None
    return float(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss) * (1 if sys.platform == "darwin" else 1024)


def _iterations(count: IterationCount) -> dict[str, Metric]:
    if not count.steps:
        return {}
    told = f"mean number of iterations of a step that was iterated, {count.most} at most"
    return {
        "iterations": Metric(count.iterations / count.steps, "1", told),
        "rollbacks": Metric(count.rollbacks, "1", "how often units went back to the begin of a step"),
    }
