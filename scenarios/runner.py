"""Carries out one run of a scenario: everything is checked, then the folder is made, then it runs and is reported."""

import math
import statistics
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from cosim.checkpoint import check_states, remove_checkpoint
from cosim.checkpointer import Checkpointer, from_then_on
from cosim.exceptions import UnitFailure
from cosim.failures import UnitHung
from cosim.iterating.iteration_count import IterationCount
from cosim.master import Master, Observer
from cosim.master_options import MasterOptions
from cosim.record.recorder import Recorder
from cosim.signals import Signals
from scenarios.conversions import conversions_of
from scenarios.experiment import Experiment, Metric, Outcome, Watch
from scenarios.interruption import Interruption
from scenarios.record import Record
from scenarios.report import UnitRow, write_report
from scenarios.resumption import Resumption, Spent, pack
from scenarios.run_folder import RunFolder, told_if_not_written
from scenarios.supervisor import heartbeat_of_run

Progress = Callable[[float, float], None]
"""Told the simulated time and the time at which the run ends at the latest, in seconds."""


@dataclass(frozen=True, kw_only=True)
class Task:
    """What to run.

    Attributes:
        experiment, parameters, seed: the scenario and what was chosen of it.
        fmus: the FMU of each unit.
        folder: for what it leaves.
        formats: further forms of the record, see `RECORD_FORMATS`.
        every: simulated seconds from checkpoint to checkpoint, if there are to be any.
        source: what `resume` needs to find the experiment again, if it is not one of the catalog.
        options: how its units are run.
    """

    experiment: Experiment[Any]
    parameters: Any
    seed: int
    fmus: Mapping[str, Path]
    folder: RunFolder
    formats: Sequence[str] = ()
    every: Fraction | None = None
    source: Mapping[str, Any] = field(default_factory=dict[str, Any])
    options: MasterOptions = field(default_factory=MasterOptions)


@dataclass(frozen=True, kw_only=True)
class Ended:
    """How a run ended. `failure` is set when a unit failed; the record then ends there."""

    outcome: Outcome
    summary: Mapping[str, Any]
    failure: UnitFailure | None = None


def carry_out(
    task: Task, progress: Progress, interruption: Interruption, resumption: Resumption | None = None
) -> Ended:
    """Run a scenario to its end, its failure or its interruption and write its folder; or go on with a run.

    Raises:
        WiringError, ScheduleError, InvalidFmu, UnitRefused, StateNotSaved, BadRunFolder: before anything was written.
        UnitHung: a unit does not return as it is loaded or initialised; nothing was written.
        KeyboardInterrupt: it was aborted; what was recorded stays.
        RecordNotWritten: there is no room for what it leaves; what was recorded stays.
    """
    experiment, parameters = task.experiment, task.parameters
    spent = Spent() if resumption is None else resumption.spent
    watch = experiment.watch(parameters) if resumption is None else resumption.watch
    failure: UnitFailure | None = None
    clock = spent.clock()
    system = experiment.build(parameters, task.seed, lambda unit: task.fmus[unit])
    if task.every is not None:
        check_states(system)
    master = Master(system, replace(task.options, cpu_times=True), heartbeat_of_run())
    began = False
    try:
        with master:
            if resumption is not None:
                master.carry_out(lambda: resumption.checkpoint.restore(master))
            interruption.begin()
            began = True
            _begin_folder(task, master, resumption)
            failure = _run(task, master, watch, resumption, _Surroundings(progress, interruption, clock))
    except UnitHung as e:  # as units were loaded, or terminated
        if not began:
            raise
        failure = failure or e
    spent = clock()
    outcome = _outcome(watch, failure, interruption.asked)
    metrics = {**outcome.metrics, **_speed(experiment, master)}
    complete = failure is None and (watch.over or not interruption.asked)
    summary = {**_summary(task, outcome, metrics, master, spent, complete), **_trouble(failure, master)}
    task.folder.write_summary(summary)
    if failure is not None:
        task.folder.add_to_run(failure=failure.as_data())
    if complete:
        remove_checkpoint(task.folder.checkpoint)
    with told_if_not_written(task.folder.path):
        _present(task, watch, summary, system_rows(master))
    return Ended(outcome=outcome, summary=summary, failure=failure)


@dataclass(frozen=True)
class _Surroundings:
    progress: Progress
    interruption: Interruption
    clock: Callable[[], Spent]


def _begin_folder(task: Task, master: Master, resumption: Resumption | None) -> None:
    """Make the run's folder, and tell what has to be known of the run if this process dies."""
    if resumption is None:
        task.folder.make()
    fmus = {n: u.description.path for n, u in master.system.units.items()}
    configuration = {**_configuration(task), **_options(task), "conversions": conversions_of(master.system)}
    task.folder.write_run(configuration, fmus)
    master.heartbeat.tell(
        folder=str(task.folder.path),
        configuration=_configuration(task),
        title=task.experiment.title,
        parameters=_parameter_rows(task),
        units=[(*row[:3], None, None) for row in system_rows(master)],
    )


def _run(
    task: Task, master: Master, watch: Watch, resumption: Resumption | None, around: _Surroundings
) -> UnitFailure | None:
    """Step until the end, and record; return the failure that it ended with, if any."""
    stop, interruption = task.experiment.stop_time(task.parameters), around.interruption
    rows = 0 if resumption is None else resumption.checkpoint.rows
    with Recorder(task.folder.signals, task.formats, after=rows) as recorder:
        checkpoints = _checkpoints(task, master, recorder, watch, around.clock)

        def tell(t: float, _signals: Signals) -> None:
            around.progress(t, float(stop))

        observers: list[Observer] = [recorder, watch, *checkpoints]
        if resumption is not None:
            observers = [from_then_on(resumption.checkpoint.time, observe) for observe in observers]
        try:
            master.run(stop, [*observers, tell], until=lambda: watch.over or interruption.asked)
            if interruption.asked and not watch.over:
                for checkpointer in checkpoints:
                    master.carry_out(checkpointer.write)
            watch.finish(master.signals)
        except UnitFailure as e:
            interruption.check()
            return e
    return None


def _trouble(failure: UnitFailure | None, master: Master) -> dict[str, Any]:
    """Return what a summary says of a failure and of missed deadlines."""
    paced = {} if master.pacer is None else {"pace": master.pacer.report.as_data()}
    return {"failure": None if failure is None else failure.as_data(), **paced}


def _checkpoints(
    task: Task, master: Master, recorder: Recorder, watch: Watch, clock: Callable[[], Spent]
) -> list[Checkpointer]:
    if task.every is None:
        return []

    def keep() -> bytes:
        return pack(watch, task.parameters, task.options, clock())

    return [Checkpointer(task.folder.checkpoint, task.every, master, recorder, keep)]


def system_rows(master: Master) -> list[UnitRow]:
    """Return what is told of each unit."""
    rows: list[UnitRow] = []
    for name, unit in master.system.units.items():
        d = unit.description
        follows = master.steps is not None and not unit.sampled
        period = "varies" if follows else f"{float(unit.period) * 1000:.4g} ms"
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
        unit = master.system.units[name]  # its own period says nothing of steps that follow their error
        simulated = master.time if master.steps and not unit.sampled else len(spent) * float(unit.period)
        metrics[f"pace_{name}"] = Metric(simulated / total if total else 0.0, "1", f"simulated s per CPU s of {name}")
    return {**metrics, **_iterations(master.iterations)}


def _iterations(count: IterationCount) -> dict[str, Metric]:
    if not count.steps:
        return {}
    told = f"mean number of iterations of a step that was iterated, {count.most} at most"
    return {
        "iterations": Metric(count.iterations / count.steps, "1", told),
        "rollbacks": Metric(count.rollbacks, "1", "how often units went back to the begin of a step"),
    }


def _peak_memory() -> float | None:
    """Return the process's largest resident memory in bytes, None where the system does not tell (Windows)."""
    try:
        import resource
    except ImportError:
        return None
    return float(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss) * (1 if sys.platform == "darwin" else 1024)


def _configuration(task: Task) -> dict[str, Any]:
    values = {v.name: _plain(getattr(task.parameters, v.name)) for v in task.experiment.parameters()}
    return {"scenario": task.experiment.name, "parameters": values, "seed": task.seed, "master": task.options.as_data()}


def _options(task: Task) -> dict[str, Any]:
    every = None if task.every is None else str(task.every)
    files = {name: str(path.absolute()) for name, path in task.fmus.items()}
    return {"source": task.source, "files": files, "formats": list(task.formats), "checkpoint": every}


def _summary(
    task: Task, outcome: Outcome, metrics: Mapping[str, Metric], master: Master, spent: Spent, complete: bool
) -> dict[str, Any]:
    return {
        **_configuration(task),
        "complete": complete,
        "success": outcome.success,
        "reason": outcome.reason,
        "metrics": {k: _metric(m) for k, m in metrics.items()},
        "simulated_seconds": master.time,
        **({} if master.steps is None else {"steps": asdict(master.steps)}),
        "wall_seconds": spent.wall,
        "cpu_seconds": spent.cpu,
    }


def _metric(m: Metric) -> dict[str, Any]:
    """Return a metric as JSON, which knows no infinity: what is not finite is null."""
    return {"value": m.value if math.isfinite(m.value) else None, "unit": m.unit, "description": m.description}


def _present(task: Task, watch: Watch, summary: Mapping[str, Any], units: Sequence[UnitRow]) -> None:
    figures = []
    if task.folder.signals.exists():
        record = Record(task.folder.signals)
        figures = task.experiment.draw(task.parameters, watch, record, task.folder.figures)
    write_report(
        task.folder, task.experiment.title, task.experiment.headline, summary, _parameter_rows(task), units, figures
    )


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
