"""Makes a run's `summary.json` (how it went) and `run.json` (what was run), which `folder_data` declares.

However a run ends, its summary is made here: `finished_summary`, also where a unit failed; `crashed_summary`, where the
run's process ended; `unstarted_summary`, where it could not begin; and `unwritten_summary`, of a run that wrote none.
`describe_system` is what `run.json` keeps of the system for the report's graph, `_run_metrics` the metrics of every
run.
"""

import base64
import math
import platform
import re
import statistics
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from handover.cosim.exceptions import CosimError, InitializationError, UnitFailure, one_line
from handover.cosim.fmu.file.archive import FmuArchive
from handover.cosim.fmu.file.icon import read_icon
from handover.cosim.master.master import Master
from handover.cosim.stepping.iteration import IterationCount
from handover.cosim.system.system import Connection, PlacedUnit, System
from handover.fmus.contents.icons import catalog_icon
from handover.scenarios.experiment.display_unit import unit_symbol
from handover.scenarios.experiment.experiment import Experiment, Metric, Outcome
from handover.scenarios.runs.results.folder_data import Configuration, MetricData, UnitData
from handover.scenarios.runs.results.output_faults import NotFiniteData, OutOfRangeData
from handover.scenarios.runs.results.run_folder import hashes_of_files, sha256_of, versions
from handover.scenarios.runs.results.tables import conversions_of, format_value
from handover.scenarios.runs.results.task import Task

_MAX_ICON = 200_000
"""Bytes of an icon that is kept: each run of a campaign keeps its own."""


def describe_system(system: System, *, adaptive: bool) -> dict[str, Any]:
    """Return the units and connections of a checked system, as JSON can hold them; for `adaptive` see `_own_period`.

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
            "period": _own_period(unit, adaptive=adaptive),
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


def _own_period(unit: PlacedUnit, *, adaptive: bool) -> float | None:
    """Return a unit's step, s; None where it varies: with adaptive steps, only sampled units keep their own."""
    return None if adaptive and not unit.sampled else float(unit.period)


def _describe_connection(system: System, c: Connection) -> dict[str, Any]:
    port = system.units[c.source.unit].description.outputs.get(c.source.port)
    if port is None:
        kind, unit, size = "clock", "", 1
    else:
        kind, unit, size = port.kind.value, port.unit.symbol, port.size
    return {"source": str(c.source), "target": str(c.target), "unit": unit, "size": size, "kind": kind}


def _run_metrics(experiment: Experiment[Any], master: Master) -> dict[str, Metric]:
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
        period = _own_period(master.system.units[name], adaptive=master.steps is not None)
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


@dataclass(frozen=True, kw_only=True)
class RunResult:
    """A run after its end; where a unit failed, `failure` says how. For `left_out` see `Summary`."""

    outcome: Outcome
    summary: Mapping[str, Any]
    failure: UnitFailure | None = None
    left_out: tuple[str, ...] = ()


@dataclass(frozen=True)
class ElapsedTime:
    """Seconds that a run has taken until now, in all its processes."""

    wall: float = 0.0
    cpu: float = 0.0

    def clock(self) -> Callable[[], "ElapsedTime"]:
        """Return a function that gives the time elapsed until it is called, including these seconds."""
        wall, cpu = time.perf_counter() - self.wall, time.process_time() - self.cpu
        return lambda: ElapsedTime(time.perf_counter() - wall, time.process_time() - cpu)


def configuration(task: Task) -> dict[str, Any]:
    """Return what determines a run's signals."""
    given: dict[str, Any] = {"unit_values": dict(task.unit_values)} if task.unit_values else {}
    if task.stop is not None:
        given["stop"] = str(task.stop)
    if task.recorded:
        given["recorded"] = list(task.recorded)
    if task.sources is not None:
        given["inputs"] = dict(task.sources.origin)
    return dict[str, Any](
        **given,
        scenario=task.experiment.name,
        parameters={v.name: _plain(getattr(task.parameters, v.name)) for v in task.experiment.parameters()},
        seed=task.seed if task.experiment.is_seeded else None,
        master=task.options.as_data(),
    )


def finished_summary(
    task: Task, outcome: Outcome, master: Master, spent: ElapsedTime, failure: UnitFailure | None, complete: bool,
    not_finite: Sequence[NotFiniteData] = (), out_of_range: Sequence[OutOfRangeData] = (),
) -> dict[str, Any]:  # fmt: skip
    """Return the summary of a run that came to its end, failed, or was interrupted."""
    metrics = {**outcome.metrics, **_run_metrics(task.experiment, master)}
    steps: dict[str, Any] = {} if master.steps is None else {"steps": asdict(master.steps)}
    summary = dict[str, Any](
        **configuration(task),
        complete=complete,
        success=outcome.success,
        reason=outcome.reason,
        metrics={name: metric_data(metric) for name, metric in metrics.items()},
        simulated_seconds=master.time - float(master.system.start),
        **steps,
        wall_seconds=spent.wall,
        cpu_seconds=spent.cpu,
        units=_units(master),
        failure=None if failure is None else failure.as_data(),
    )
    if master.pacer is not None:
        summary["pace"] = master.pacer.report.as_data()
    if master.ended is not None:
        summary["ended"] = master.ended.as_data()
    if warned := master.warnings:
        summary["warnings"] = [warnings.as_data(unit) for unit, warnings in warned.items()]
    if not_finite:
        summary["not_finite"] = list(not_finite)
    if out_of_range:
        summary["out_of_range"] = list(out_of_range)
    return summary


def crash_facts(task: Task, master: Master) -> dict[str, Any]:
    """Return what `crashed_summary` needs to know of a run, to be kept before its process may crash."""
    return {
        "configuration": configuration(task),
        "units": [(unit["name"], unit["model"], unit["step"]) for unit in _units(master)],
    }


def crashed_summary(
    configuration: Mapping[str, Any],
    units: Sequence[tuple[str, str, str]],
    reason: str,
    failure: dict[str, Any],
    simulated: float,
    spent: ElapsedTime,
) -> dict[str, Any]:
    """Return the summary of a run whose process crashed after so many simulated seconds."""
    return dict[str, Any](
        **configuration,
        complete=False,
        success=False,
        metrics={},
        simulated_seconds=simulated,
        cpu_seconds=spent.cpu,
        units=[UnitData(name=n, model=m, step=s, steps=None, cpu_seconds=None) for n, m, s in units],
        reason=reason,
        wall_seconds=spent.wall,
        failure=failure,
    )


def unstarted_summary(task: Task, refusal: CosimError, spent: ElapsedTime) -> dict[str, Any]:
    """Return the summary of a run that could not start."""
    reason = failure_reason(refusal) if isinstance(refusal, UnitFailure) else one_line(refusal)
    return dict[str, Any](
        **configuration(task),
        complete=False,
        success=False,
        reason=reason,
        metrics={},
        simulated_seconds=0.0,
        wall_seconds=spent.wall,
        cpu_seconds=spent.cpu,
        units=[],
        failure=_error_data(refusal),
    )


def unwritten_summary(run: Mapping[str, Any]) -> dict[str, Any]:
    """Return a summary, from `run.json`, of a run that has written none."""
    reason = "it has no summary: it was killed before its end, or the machine went down"
    kept = {name: run[name] for name in Configuration.__annotations__ if name in run}
    return {"success": False, "reason": reason, "metrics": dict[str, Any](), "complete": False, **kept}


def begun_run(task: Task, master: Master) -> dict[str, Any]:
    """Return the content of `run.json` for a run that starts."""
    system = describe_system(master.system, adaptive=master.steps is not None)
    fmus = {name: unit.description.path for name, unit in master.system.units.items()}
    of_this_run: dict[str, Any] = {"system": system, "conversions": conversions_of(master.system)}
    times = {"start": float(master.system.start), "stop": float(task.stop_time)}
    of_this_run["experiment"] = {**times, "tolerances": master.tolerances}
    faults = [f"{path.name}: {fault}" for path, fault in master.description_faults.items()]
    if warned := [*faults, *master.system.tolerated, *master.system.undefined_starts, *master.execution_tools]:
        of_this_run["warnings"] = warned
    if notes := [*master.system.notes, *master.isolations]:
        of_this_run["notes"] = notes
    if outside := [str(end) for end in master.system.externals]:
        of_this_run["external_inputs"] = outside
    return _run_data(task, fmus, of_this_run)


def unstarted_run(task: Task, refusal: CosimError) -> dict[str, Any]:
    """Return the content of `run.json` for a run that could not start."""
    return _run_data(task, task.fmus, {"failure": _error_data(refusal)})


def failure_reason(failure: UnitFailure) -> str:
    """Return why a run in which a unit failed did not succeed."""
    return f"{failure.verdict}: {failure.cause}"


def metric_data(m: Metric) -> MetricData:
    """Return a metric as JSON can hold it."""
    return MetricData(value=m.value if math.isfinite(m.value) else None, unit=m.unit, description=m.description)


def metric_of(data: Mapping[str, Any]) -> Metric:
    """Return a metric from its JSON, NaN where it was not finite.

    Raises:
        KeyError, TypeError, ValueError: the data is damaged.
    """
    value = float("nan") if data["value"] is None else float(data["value"])
    return Metric(value=value, unit=str(data["unit"]), description=str(data["description"]))


def parameter_rows(task: Task) -> list[list[str]]:
    """Return name, value with unit, and description of each parameter."""
    rows: list[list[str]] = []
    for v in task.experiment.parameters():
        value = format_value(_plain(getattr(task.parameters, v.name)))
        rows.append([v.name, f"{value} {unit_symbol(v.unit.symbol)}".rstrip(), v.description])
    return rows


def _given_rows(task: Task) -> list[list[str]]:
    """Return the like of the start values that `Task.source` keeps as texts."""
    given: Sequence[str] = task.source.get("parameters", ())
    rows = [[*(part.strip() for part in text.split("=", 1)), "given start value"] for text in given]
    rows += [[name, text, "given value of the unit's parameter"] for name, text in task.unit_values.items()]
    if task.sources is not None:
        text = ", ".join(f"{name} {value}" for name, value in task.sources.origin.items())
        rows.append(["inputs", text, "where the inputs from outside came from"])
    return rows if task.stop is None else [*rows, ["stop", f"{float(task.stop):g} s", "given stop time of the run"]]


def _run_data(task: Task, fmus: Mapping[str, Path], of_this_run: dict[str, Any]) -> dict[str, Any]:
    hashes = {path: sha256_of(path) for path in dict.fromkeys(fmus.values())}
    if files := hashes_of_files(task.experiment.files_read(task.parameters, task.unit_values)):
        of_this_run = {**of_this_run, "parameter_files": files}
    return dict[str, Any](
        **configuration(task),
        source=dict(task.source),
        files={name: str(path.absolute()) for name, path in task.fmus.items()},
        formats=list(task.formats),
        checkpoint=None if task.every is None else str(task.every),
        title=task.experiment.title,
        headline=list(task.experiment.headline),
        told_parameters=[*parameter_rows(task), *_given_rows(task)],
        **of_this_run,
        units={name: {"fmu": path.name, "sha256": hashes[path]} for name, path in fmus.items()},
        versions={"platform": platform.platform(), **versions()},
    )


def _units(master: Master) -> list[UnitData]:
    units: list[UnitData] = []
    cpu = master.cpu
    for name, unit in master.system.units.items():
        model, spent = f"{unit.description.name} (FMI {unit.description.fmi})", cpu[name]
        period = _own_period(unit, adaptive=master.steps is not None)
        step = "varies" if period is None else f"{period * 1000:.4g} ms"
        units.append(UnitData(name=name, model=model, step=step, steps=len(spent), cpu_seconds=sum(spent)))
    return units


def _error_data(refusal: CosimError) -> dict[str, Any]:
    if isinstance(refusal, InitializationError):
        return refusal.failure.as_data()
    if isinstance(refusal, UnitFailure):
        return refusal.as_data()
    of_no_unit = {"instance": None, "call": None, "time": 0.0, "log": list[str]()}
    return {"kind": "refused", "status": one_line(refusal), **of_no_unit}


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.tolist()
    name = getattr(value, "name", None)
    return value if name is None else name.lower()
