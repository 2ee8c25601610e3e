"""Carries out one run of a scenario: everything is checked, then the folder is made, then it runs and is reported."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from handover.cosim.exceptions import UnitFailure
from handover.cosim.fmu.failures import UnitHung
from handover.cosim.master.checkpoint import Checkpointer, check_states, remove_checkpoint
from handover.cosim.master.master import Master
from handover.cosim.record.recorder import Recorder
from handover.cosim.system.signals import FromThenOn, Observer, Signals
from handover.scenarios.execution.interruption import Interruption
from handover.scenarios.execution.resumption import Resumption, pack
from handover.scenarios.execution.supervisor import heartbeat_of_run
from handover.scenarios.experiment.experiment import Outcome, Watch
from handover.scenarios.results.pictures import write_pictures
from handover.scenarios.results.run_facts import record_of
from handover.scenarios.results.run_folder import told_if_not_written
from handover.scenarios.results.summary import Spent, begun_run, crash_facts, failure_reason, finished_summary
from handover.scenarios.results.task import Ended, Task

Progress = Callable[[float, float], None]
"""Told the simulated time and the time at which the run ends at the latest, in seconds."""


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
    return _conclude(task, master, watch, failure, interruption.asked, clock())


@dataclass(frozen=True)
class _Surroundings:
    progress: Progress
    interruption: Interruption
    clock: Callable[[], Spent]


def _begin_folder(task: Task, master: Master, resumption: Resumption | None) -> None:
    """Make the run's folder, and tell what has to be known of the run if this process dies."""
    if resumption is None:
        task.folder.make()
    else:
        task.folder.remove_presentation()
    task.folder.write_run(begun_run(task, master))
    if not task.presented:
        task.folder.figures.rmdir()
    master.heartbeat.tell(folder=str(task.folder.path), **crash_facts(task, master))


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
            observers = [FromThenOn(resumption.checkpoint.time, observe) for observe in observers]
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


def _checkpoints(
    task: Task, master: Master, recorder: Recorder, watch: Watch, clock: Callable[[], Spent]
) -> list[Checkpointer]:
    if task.every is None:
        return []

    def keep() -> bytes:
        return pack(watch, task.parameters, task.options, clock())

    return [Checkpointer(task.folder.checkpoint, task.every, master, recorder, keep)]


def _conclude(
    task: Task, master: Master, watch: Watch, failure: UnitFailure | None, interrupted: bool, spent: Spent
) -> Ended:
    """Write what is known of a run at its end, and its report."""
    outcome = _outcome(watch, failure, interrupted)
    complete = failure is None and (watch.over or not interrupted)
    summary = finished_summary(task, outcome, master, spent, failure, complete)
    task.folder.write_summary(summary)
    if failure is not None:
        task.folder.add_to_run(failure=summary["failure"])
    write_pictures(task.folder.pictures, watch.pictures())
    if complete:
        remove_checkpoint(task.folder.checkpoint)
    if task.presented:
        with told_if_not_written(task.folder.path):
            _present(task, watch)
    return Ended(outcome=outcome, summary=summary, failure=failure)


def _outcome(watch: Watch, failure: UnitFailure | None, interrupted: bool) -> Outcome:
    seen = watch.outcome()
    if failure is not None:
        return Outcome(success=False, reason=failure_reason(failure), metrics=seen.metrics)
    if interrupted and not watch.over:
        return Outcome(success=False, reason=f"interrupted: {seen.reason}", metrics=seen.metrics)
    return seen


def _present(task: Task, watch: Watch) -> None:
    from handover.scenarios.cli.run_figures import draw_figures  # plots take long to load
    from handover.scenarios.reporting.run_page import write_run_page

    record = record_of(task.folder)
    if record is not None and len(record.time) > 1:  # of one instant there is nothing to see over time
        draw_figures(task.experiment, task.parameters, watch, record, task.folder.figures)
    write_run_page(task.folder)
