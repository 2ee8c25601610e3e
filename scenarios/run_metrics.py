"""Figures of every run, whatever the scenario: what it cost in CPU time, memory and iterations."""

import statistics
import sys
from typing import Any

import numpy as np

from handover.cosim.master.master import Master
from handover.cosim.stepping.iteration import IterationCount
from handover.scenarios.experiment.experiment import Experiment, Metric


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
