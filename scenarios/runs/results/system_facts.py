"""Facts on a run's system, whatever the scenario: units and connections, CPU times, memory, iterations.

`run.json` keeps the system's units and connections for the report's graph (`describe_system`); `run_metrics` are the
metrics that every run has.
"""

import base64
import re
import statistics
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from handover.cosim.fmu.file.archive import FmuArchive
from handover.cosim.fmu.file.icon import read_icon
from handover.cosim.master.master import Master
from handover.cosim.stepping.iteration import IterationCount
from handover.cosim.system.system import Connection, PlacedUnit, System
from handover.fmus.contents.icons import catalog_icon
from handover.scenarios.experiment.experiment import Experiment, Metric

_MAX_ICON = 200_000
"""Bytes of an icon that is kept: each run of a campaign keeps its own."""


def describe_system(system: System, *, adaptive: bool) -> dict[str, Any]:
    """Return the units and connections of a checked system, as JSON can hold them; for `adaptive` see `own_period`.

    A unit has the icon in its FMU, as the FMU may be gone or changed when a report is made of the folder; not that
    which the catalog has for its name anyway. Of an icon whose SVG has more than 200 kB the PNG is kept, if it
    has not.

    Raises:
        InvalidFmu: an FMU is damaged.
    """
    units = [
        {
            "name": name,
            "model": unit.description.name,
            "fmi": str(unit.description.fmi),
            "period": own_period(unit, adaptive=adaptive),
            "sampled": unit.sampled,
            **_own_icon(unit),
        }
        for name, unit in system.units.items()
    ]
    return {"units": units, "connections": [_describe_connection(system, c) for c in system.connections]}


def _own_icon(unit: PlacedUnit) -> dict[str, dict[str, str]]:
    icon = read_icon(FmuArchive(unit.description.path))
    drawing = catalog_icon(unit.description.name)
    of_catalog = (drawing.read_bytes(), drawing.with_suffix(".png").read_bytes())
    mime, content = (icon if len(icon.svg) <= _MAX_ICON else replace(icon, svg=b"")).best
    if not content or len(content) > _MAX_ICON or content in of_catalog:
        return {}
    return {"icon": {"type": mime, "base64": base64.b64encode(content).decode()}}


def own_period(unit: PlacedUnit, *, adaptive: bool) -> float | None:
    """Return a unit's step, s; None where it varies: with adaptive steps, only sampled units keep their own."""
    return None if adaptive and not unit.sampled else float(unit.period)


def _describe_connection(system: System, c: Connection) -> dict[str, Any]:
    port = system.units[c.source.unit].description.outputs.get(c.source.port)
    if port is None:
        kind, unit, size = "clock", "", 1
    else:
        kind, unit, size = port.kind.value, port.unit.symbol, port.size
    return {"source": str(c.source), "target": str(c.target), "unit": unit, "size": size, "kind": kind}


def run_metrics(experiment: Experiment[Any], master: Master) -> dict[str, Metric]:
    """Return the metrics that every run has, by name: memory, CPU times, and iterations if steps were iterated."""
    medians = [statistics.median(master.cpu[u]) for u in experiment.cycle() if master.cpu[u]]
    peak = peak_memory()
    units = " + ".join(experiment.cycle())
    metrics: dict[str, Metric] = {}
    if peak is not None:
        metrics["peak_memory"] = Metric(peak, "B", "largest resident memory of the process")
    if medians:
        metrics["cpu_per_cycle"] = Metric(sum(medians), "s", f"median CPU time of a control cycle ({units})")
    for name, spent in master.cpu.items():
        total = float(np.sum(spent))
        metrics[f"cpu_{name}"] = Metric(total, "s", f"CPU time of {name} in all")
        period = own_period(master.system.units[name], adaptive=master.steps is not None)
        simulated = master.time if period is None else len(spent) * period
        metrics[f"pace_{name}"] = Metric(simulated / total if total else 0.0, "1", f"simulated s per CPU s of {name}")
    return {**metrics, **_iterations(master.iterations)}


def peak_memory() -> float | None:
    """Return the process's peak resident memory in bytes, None where the system does not report it (Windows).

    Linux's `getrusage` also counts the peak of the process that started this one; `VmHWM` is of this program alone.
    """
    status = Path("/proc/self/status")
    if status.is_file():
        kilobytes = re.search(r"^VmHWM:\s+(\d+) kB", status.read_text(), re.MULTILINE)
        if kilobytes:
            return float(kilobytes[1]) * 1024
    try:
        import resource
    except ImportError:
        return None
    return float(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss) * (1 if sys.platform == "darwin" else 1024)


def _iterations(count: IterationCount) -> dict[str, Metric]:
    if not count.steps:
        return {}
    text = f"mean number of iterations of a step that was iterated, {count.most} at most"
    return {
        "iterations": Metric(count.iterations / count.steps, "1", text),
        "rollbacks": Metric(count.rollbacks, "1", "how often units were rolled back to the start of a step"),
    }
