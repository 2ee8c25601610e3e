"""Runs an experiment once: all is checked, then the folder is made, then it runs, then its results are written."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from handover.cosim.exceptions import InitializationError, UnitFailure, WiringError, first_faults
from handover.cosim.master.checkpoint import Checkpointer, check_states, remove_checkpoint
from handover.cosim.master.live_control import ControlledPacer, LiveControl
from handover.cosim.master.master import Master
from handover.cosim.plan.memory import note_crashes
from handover.cosim.record.recorder import Recorder
from handover.cosim.stepping.options import MasterOptions
from handover.cosim.system.recorded_variables import record_variables
from handover.cosim.system.signals import ObserveAfter, Observer, Signals
from handover.cosim.system.system import System
from handover.scenarios.experiment.experiment import Evaluator, Experiment, Metric, Outcome
from handover.scenarios.experiment.live_inputs import let_push
from handover.scenarios.runs.execution.errors import UsageError
from handover.scenarios.runs.execution.exit_status import status_of_run
from handover.scenarios.runs.execution.file_experiment import FileExperiment
from handover.scenarios.runs.execution.input_sources import give_inputs
from handover.scenarios.runs.execution.interruption import Interruption
from handover.scenarios.runs.execution.resumption import Resumption, pack
from handover.scenarios.runs.execution.supervisor import heartbeat_of_run, is_supervised
from handover.scenarios.runs.execution.unit_values import built_system, settings_behind
from handover.scenarios.runs.results.output_faults import (
    NotFiniteData,
    OutOfRangeData,
    outputs_not_finite,
    outputs_out_of_range,
)
from handover.scenarios.runs.results.pictures import write_picture_files
from handover.scenarios.runs.results.run_facts import record_of
from handover.scenarios.runs.results.run_folder import disk_errors_reported
from handover.scenarios.runs.results.summary import (
    ElapsedTime,
    RunResult,
    begun_run,
    crash_facts,
    failure_reason,
    finished_summary,
)
from handover.scenarios.runs.results.task import Task
from handover.scenarios.runs.results.tolerated_faults import GuardedEvaluator, ToleratedFaults, scenario_code

Progress = Callable[[float, float], None]
"""Is called with the simulated seconds until now, and those of the whole run at most."""

Concluded = Callable[[RunResult], AbstractContextManager[None]]
"""Is called with the result of a run that has its verdict; what it returns is entered while figures are drawn."""


def _say_nothing(_result: RunResult) -> AbstractContextManager[None]:
    return nullcontext()


def experiment_system(
    experiment: Experiment[Any], parameters: Any, seed: int, fmus: Mapping[str, Path], unit_values: Mapping[str, str],
    options: MasterOptions,
) -> System:  # fmt: skip
    """Return a scenario's system; its units have the scenario's step where the algorithm steps all in parallel.

    Raises:
        InvalidFmu, InvalidParameter, ScenarioFailed: see `built_system`.
    """
    system = built_system(experiment, parameters, seed, fmus, unit_values)
    step = experiment.step_in_parallel(parameters)
    if options.algorithm.coupling.traits.parallel and step is not None:
        system.set_step(step)
    return system


def run_task(
    task: Task, progress: Progress, interruption: Interruption, resumption: Resumption | None = None,
    control: LiveControl | None = None, observer: Observer | None = None, concluded: Concluded = _say_nothing,
) -> RunResult:  # fmt: skip
    """Run a scenario to its end, its failure or its interruption and write its folder; or resume a run.

    Where there is a `control`, another process may change its pace, pause it, and end it after its step; an `observer`
    sees each communication point, too, as for a page that shows pictures. `concluded` is given the result as soon as
    its verdict is written; what it returns is entered while pictures, figures and report are made.

    Raises:
        WiringError, ScheduleError, InvalidFmu, InitializationError, StateNotSaved, InvalidRunFolder,
            InvalidCheckpoint, ScenarioFailed, UsageError: before anything was written.
        UnitHung, UnitCrashed: a unit does not return, or an isolated one ends its process, as it is loaded or
            initialised; nothing was written.
        KeyboardInterrupt: it was aborted; what was recorded stays.
        RecordNotWritten: there is no room for what it leaves; what was recorded stays.
    """
    experiment, parameters = task.experiment, task.parameters
    spent = ElapsedTime() if resumption is None else resumption.spent
    clock = spent.clock()
    with scenario_code(experiment):
        evaluator = GuardedEvaluator(
            experiment.bound_evaluator(parameters)
            if resumption is None
            else resumption.evaluator(experiment, parameters)
        )
        if task.every is not None:
            evaluator.packed()
        experiment.stop_time(parameters)
        experiment.cycle()
        experiment.parameter_files(parameters)
    system = experiment_system(experiment, parameters, task.seed, task.fmus, task.unit_values, task.options)
    if task.pushed:
        let_push(system, experiment.pushes(parameters))
    give_inputs(system, task.sources)
    try:
        record_variables(system, task.recorded)
    except WiringError as e:
        raise UsageError(f"--record: {'; '.join(first_faults(e.faults))}") from e
    evaluator.note_units(system.units)
    failure: UnitFailure | None = None
    if task.every is not None:
        check_states(system)
    master = Master(system, replace(task.options, cpu_times=True), heartbeat_of_run(), task.stop_time)
    if is_supervised():
        note_crashes(master.heartbeat)
    if control is not None:
        master.pacer = ControlledPacer(control)
    if resumption is None:
        master.heartbeat.record_scratch_folder(str(task.folder.path))  # if it crashes before the folder is begun
    began, recorded = False, dict[str, Metric]()
    not_finite, out_of_range = list[NotFiniteData](), list[OutOfRangeData]()
    try:
        with master:
            if resumption is not None:
                master.call_units(lambda: resumption.checkpoint.restore(master))
            interruption.begin()
            began = True
            _begin_folder(task, master, resumption)
            around = _Surroundings(progress, interruption, clock, control, observer)
            failure = _run(task, master, evaluator, resumption, around)
            with disk_errors_reported(task.folder.signals):  # before units end: one may hang as its library is unloaded
                not_finite = outputs_not_finite(task.folder.signals, master.system)
                out_of_range = outputs_out_of_range(task.folder.signals, master.system)
                recorded = experiment.recorded_metrics(task.folder.signals)
    except InitializationError as e:
        with scenario_code(experiment):
            reason = settings_behind(e.failure.unit, experiment, parameters, task.seed, task.fmus)
        raise InitializationError(e.failure, reason) from e
    except UnitFailure as e:  # as units were loaded, terminated or freed
        if not began:
            raise
        failure = failure or e
    ended = _Ended(failure, interruption.asked, not_finite, out_of_range, recorded, clock())
    return _conclude(task, master, evaluator, ended, concluded)


@dataclass(frozen=True)
class _Surroundings:
    """What surrounds a run in the command: where progress goes, what interrupts, controls, sees it, its clock."""

    progress: Progress
    interruption: Interruption
    clock: Callable[[], ElapsedTime]
    control: LiveControl | None
    observer: Observer | None

    def take_in_stop(self) -> bool:
        """Take a stop by the controls for a signal; return whether the run is to end after its step."""
        if self.control is not None and self.control.stop:
            self.interruption.asked = True
        return self.interruption.asked


def _begin_folder(task: Task, master: Master, resumption: Resumption | None) -> None:
    """Make the run's folder, and leave in the heartbeat what has to be known of the run if this process crashes."""
    if resumption is None:
        task.folder.make()
    else:
        task.folder.remove_presentation()
    task.folder.begin(begun_run(task, master))
    if not task.presented:
        task.folder.figures.rmdir()
    places = {"folder": str(task.folder.path), "shown": str(task.folder.shown)}
    scratch = [folder for folder in master.heartbeat.facts.get("scratch", []) if folder != places["folder"]]
    master.heartbeat.record_facts(**places, scratch=scratch, presented=task.presented, **crash_facts(task, master))


def _run(
    task: Task, master: Master, evaluator: GuardedEvaluator[Evaluator], resumption: Resumption | None,
    around: _Surroundings,
) -> UnitFailure | None:  # fmt: skip
    """Step until the end, and record; return the failure that it ended with, if any."""
    start, stop, interruption = task.experiment.start, task.stop_time, around.interruption
    rows = 0 if resumption is None else resumption.checkpoint.rows
    with Recorder(task.folder.signals, task.formats, after=rows) as recorder:
        checkpoints = _checkpoints(task, master, recorder, evaluator, around.clock)

        def report_progress(t: float, _signals: Signals) -> None:
            around.progress(t - float(start), float(stop - start))

        def write_due_checkpoints(t: float, signals: Signals) -> None:
            for checkpointer in checkpoints:
                if not evaluator.fault:  # else what is resumed from it would be judged by a part of the run
                    checkpointer(t, signals)

        observers: list[Observer] = [recorder, evaluator, write_due_checkpoints]
        if resumption is not None:
            observers = [ObserveAfter(resumption.checkpoint.time, observe) for observe in observers]
        if around.observer is not None:
            observers.append(around.observer)
        try:
            master.run(stop, [*observers, report_progress], until=lambda: evaluator.over or around.take_in_stop())
            if master.ended is not None:
                evaluator.note_end(master.ended.unit, master.ended.reached)
            elif interruption.asked and not evaluator.over and not evaluator.fault:
                for checkpointer in checkpoints:
                    master.call_units(checkpointer.write)
            evaluator.finish(master.signals)
        except UnitFailure as e:
            interruption.check()
            return e
    return None


def _checkpoints(
    task: Task, master: Master, recorder: Recorder, evaluator: GuardedEvaluator[Evaluator],
    clock: Callable[[], ElapsedTime],
) -> list[Checkpointer]:  # fmt: skip
    if task.every is None:
        return []

    def packed() -> bytes:
        return pack(task, evaluator.packed(), clock())

    return [Checkpointer(task.folder.checkpoint, task.every, master, recorder, packed)]


@dataclass(frozen=True)
class _Ended:
    """How a run ended: its failure, whether Ctrl-C ended it, what was found in its record, and what it took."""

    failure: UnitFailure | None
    interrupted: bool
    not_finite: Sequence[NotFiniteData]
    out_of_range: Sequence[OutOfRangeData]
    recorded: Mapping[str, Metric]
    spent: ElapsedTime


def _conclude(
    task: Task, master: Master, evaluator: GuardedEvaluator[Evaluator], ended: _Ended, concluded: Concluded
) -> RunResult:
    """Write the summary of a run at its end, its pictures and its report."""
    failure, interrupted = ended.failure, ended.interrupted and master.ended is None
    outcome = _outcome(task, evaluator, failure, interrupted, master)
    outcome = replace(outcome, metrics={**outcome.metrics, **ended.recorded})
    complete = failure is None and (evaluator.over or not interrupted)
    found = ended.not_finite, ended.out_of_range
    summary = finished_summary(task, outcome, master, ended.spent, failure, complete, *found)
    task.folder.write_summary(summary)
    status = status_of_run(unit_failed=failure is not None, succeeded=outcome.success)
    master.heartbeat.record_facts(concluded=status)  # whatever crashes from here on, this is how it ended
    if failure is not None:
        task.folder.add_to_run(failure=summary["failure"])
    result, faults = RunResult(outcome=outcome, summary=summary, failure=failure), ToleratedFaults()
    with concluded(result):
        with faults.tolerated("the cameras' pictures could not be kept"):
            write_picture_files(task.folder.pictures, evaluator.pictures())
        if complete:
            remove_checkpoint(task.folder.checkpoint)
        if task.presented:
            with disk_errors_reported(task.folder.path):
                _present(task, evaluator, summary, faults)
    lines = list(dict.fromkeys(faults.lines))  # figures and page draw the same
    if lines:
        task.folder.write_summary({**summary, "left_out": lines})
    return replace(result, left_out=tuple(lines))


def _outcome(
    task: Task, evaluator: Evaluator, failure: UnitFailure | None, interrupted: bool, master: Master
) -> Outcome:
    """Return the verdict; a run that ended before its evaluation was over, on request, has not succeeded."""
    seen = evaluator.outcome()
    if failure is not None:
        return replace(seen, success=False, reason=failure_reason(failure))
    if interrupted and not evaluator.over:
        return replace(seen, success=False, reason=f"interrupted: {seen.reason}")
    if master.ended is not None:
        return replace(seen, reason=f"{seen.reason}; {master.ended.summary}")
    if task.is_cut_short and not evaluator.over and master.time >= float(task.stop_time):
        return replace(seen, success=False, reason=f"{seen.reason}; its stop time was reached")
    return seen


def _present(
    task: Task, evaluator: GuardedEvaluator[Evaluator], summary: Mapping[str, Any], faults: ToleratedFaults
) -> None:
    """Draw figures and write the page; what fails of them is left out, with a line in the page that says so."""
    from handover.scenarios.runs.reporting.run_figures import draw_figures  # plots take long to load
    from handover.scenarios.runs.reporting.run_page import write_run_page

    with faults.tolerated("the figures could not be drawn"):
        record = record_of(task.folder)
        if record is not None and len(record.time) > 1:  # of one instant there is nothing to see over time
            of_run = task.experiment, task.parameters, evaluator.evaluator, record
            draw_figures(*of_run, task.folder.figures, faults)
    if faults.lines:
        task.folder.write_summary({**summary, "left_out": faults.lines})
    with faults.tolerated("the report could not be written"):
        own = None if isinstance(task.experiment, FileExperiment) else task.experiment
        faults.lines += write_run_page(task.folder, experiment=own)
