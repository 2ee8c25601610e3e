"""A run from Python, on the path of the command `handover run`; and a scenario as an environment of Gymnasium."""

import contextlib
import threading
from collections.abc import Callable, Generator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from handover.cosim.stepping.options import Algorithm, MasterOptions
from handover.cosim.system.system import System
from handover.scenarios.api.arguments import (
    InvalidInput,
    Seconds,
    errors_for_python,
    exact,
    exact_time,
    flag,
    formats_of,
    master_options,
    merged,
    path_of,
    path_or_none,
    several_texts,
    single_texts,
    unit_texts,
    whole_number,
)
from handover.scenarios.api.progress import bar
from handover.scenarios.api.run_result import Run
from handover.scenarios.experiment.experiment import Experiment
from handover.scenarios.runs.execution.errors import require_extra
from handover.scenarios.runs.execution.input_sources import played_back
from handover.scenarios.runs.execution.interruption import Interruption
from handover.scenarios.runs.execution.request import RunRequest, check_subject
from handover.scenarios.runs.execution.runner import run_task

if TYPE_CHECKING:
    from handover.scenarios.api.environment import ScenarioEnvironment
    from handover.scenarios.api.session import Session


def run(
    subject: str | Path | System | type[Experiment[Any]],
    /,
    *,
    seed: int = 0,
    units: Mapping[str, Path | str] | None = None,
    out: Path | str | None = None,
    start: Seconds | None = None,
    stop: Seconds | None = None,
    step: Seconds | None = None,
    inputs: Path | str | None = None,
    inputs_from: Path | str | None = None,
    formats: Sequence[str] = (),
    record: str | Sequence[str] = (),
    checkpoint: Seconds | None = None,
    algorithm: str | Algorithm | None = None,
    isolate: str | Sequence[str] = (),
    options: MasterOptions | None = None,
    report: bool = False,
    progress: bool = True,
    parameters: Mapping[str, Any] | None = None,
    **named: Any,
) -> Run:
    """Run a scenario, a system, an SSP or an FMU once, and return the result: `run("ir_grasp", strategy="blind")`.

    All is checked before anything starts. The results are in a folder that stays: `out`, or one of its own in `runs/`
    of the working directory, as of the command; `handover.load` reads it again. A unit that fails ends the run, which
    is then a result without success. The units live in this process; one that crashes ends it, unless `isolate` gives
    it a process of its own. Python's logger `handover` has the master's progress, `handover.units` what units log.

    Args:
        subject: name of a scenario, path of an `.ssp` or `.fmu` file, a `System`, or a scenario's class.
        seed: of all random numbers of a scenario.
        units: what takes the place of a scenario's units, by their names: files of FMUs, or blocks as `my_arm:MyArm`.
        out: the folder for the results, new or empty.
        start: of a system, an SSP or an FMU: when it starts, s; by default as its file says, or at 0 s.
        stop: when it ends, s, if its evaluation does not end it before; only a system has no stop time of its own.
        step: of an SSP or FMU: the communication step of all units, s.
        inputs: of an FMU: a CSV file of its inputs over time.
        inputs_from: folder of a run whose inputs from outside, such as a hand's, are played back.
        formats: of the record besides Parquet: `csv`, `mat`.
        record: local variables and parameters of units to record, too: `UNIT.NAME`, with `*` and `?` as wildcards.
        checkpoint: simulated seconds between checkpoints, from which `handover resume` continues.
        algorithm: an `Algorithm`, or its value, such as `newton`.
        isolate: units in processes of their own: names, `foreign` or `all`.
        options: all options of the master; by default a call of a unit may take 60 s.
        report: whether figures and the report page are made at once; `Run.report` makes them later.
        progress: whether a bar is shown, where there is a notebook or a terminal.
        parameters: parameters whose names are also those of options, or no names in Python: `{"servo.gain": 0.5}` is of
            a unit.
        **named: the scenario's or the FMU's other parameters, in SI units or the FMU's; enumerations by name.

    Raises:
        InvalidInput: something of it cannot be run, with all faults and what would be right; nothing is written.
        UnitFailure: a unit failed before the run began; nothing is written.
        KeyboardInterrupt: Ctrl-C, after the step under way; what was recorded until then is in the folder.
        RecordNotWritten: the disk is full.
    """
    with errors_for_python(named, run), contextlib.ExitStack() as opened:
        shown = flag("progress", progress)
        if flag("report", report):
            require_extra("reports", "reports", "report=False")
        request = RunRequest(
            subject=str(subject) if isinstance(subject, Path) else subject,
            parameters=single_texts(str(subject) if isinstance(subject, Path) else subject, merged(parameters, named)),
            seed=whole_number("seed", seed),
            units=unit_texts(units),
            out=path_or_none("out", out),
            start=exact_time("start", start),
            stop=exact_time("stop", stop),
            step=exact("step", step),
            inputs=path_or_none("inputs", inputs),
            sources=None if inputs_from is None else played_back(path_of("inputs_from", inputs_from)),
            formats=formats_of(formats),
            recorded=several_texts("record", record),
            every=exact("checkpoint", checkpoint),
            options=master_options(options, algorithm, isolate),
            presented=bool(report),
        )
        with interruption_in_python() as interruption:
            task = request.task(opened)
            with bar(shown) as move:
                run_task(task, lambda t, end: move(t, end, f"{t:.1f} of at most {end:.0f} s simulated"), interruption)
        if interruption.asked:
            raise KeyboardInterrupt(f"the run was interrupted; what was recorded is in {task.folder.shown}")
    return Run(task.folder.shown, task.experiment if isinstance(subject, type) else None)


def environment(
    scenario: str | type[Experiment[Any]],
    /,
    place: str,
    *,
    actions: Sequence[str] | None = None,
    observations: Sequence[str] | None = None,
    reward: Callable[["Session"], float] | None = None,
    period: Seconds | None = None,
    units: Mapping[str, Path | str] | None = None,
    options: MasterOptions | None = None,
    parameters: Mapping[str, Any] | None = None,
    **named: Any,
) -> "ScenarioEnvironment":
    """Return a scenario as an environment of Gymnasium: `environment("ir_grasp", place="reflex")`.

    Args:
        scenario: its name or its class.
        place: the unit whose place the agent takes.
        actions: outputs of the unit that the agent sets, by default those that are wired. The others keep their
            values, and the evaluation does without those that it does not need; where it reads one of them, such as
            a phase, name it too.
        observations: inputs of the unit that the agent sees, by default those that are wired, without pictures.
        reward: of a step, by the running session; by default 1 for an episode that ends with success, else 0.
        period: time between two actions, s, by default the step of the unit.
        units: what takes the place of other units, by their names: files of FMUs, or blocks as `my_arm:MyArm`.
        options: of the master, as of `handover.open`.
        parameters: the scenario's parameters whose names are those of options here.
        **named: its other parameters.

    Raises:
        InvalidInput: something of it cannot be run, with what would be right.
        ImportError: Gymnasium is not installed.
    """
    from handover.scenarios.api.environment import ScenarioEnvironment  # needs Gymnasium, an extra

    if "seed" in named:
        raise InvalidInput("seed: an environment has none; an episode's is given by reset(seed=3)")
    with errors_for_python():
        check_subject(scenario)
        request = RunRequest(
            subject=scenario,
            parameters=single_texts(scenario, merged(parameters, named)),
            units=unit_texts(units),
            options=master_options(MasterOptions() if options is None else options, None),
        )
    return ScenarioEnvironment(request, place, actions, observations, reward, period)


@contextlib.contextmanager
def interruption_in_python() -> Generator[Interruption, None, None]:
    """Give what lets Ctrl-C end a run after its step, where this thread handles signals; others stay as they are.

    Raises:
        KeyboardInterrupt: the run was aborted.
    """
    interruption = Interruption(ending=())
    if threading.current_thread() is not threading.main_thread():
        yield interruption
        return
    try:
        with interruption:
            yield interruption
    except SystemExit:
        raise KeyboardInterrupt("aborted") from None
