"""A campaign from Python, on the same path as the command `handover sweep`."""

import contextlib
import sys
import types
from collections.abc import Generator, Mapping, Sequence
from pathlib import Path
from typing import Any, cast

import numpy as np

from handover.cosim.stepping.options import Algorithm, MasterOptions
from handover.scenarios.api.arguments import (
    InvalidInput,
    Seconds,
    errors_for_python,
    exact,
    exact_time,
    flag,
    master_options,
    merged,
    of_type,
    path_or_none,
    several_texts,
    text_of_value,
    texts_of,
    unit_texts,
    whole_number,
)
from handover.scenarios.api.campaign_result import Campaign
from handover.scenarios.api.progress import bar
from handover.scenarios.experiment.experiment import Experiment
from handover.scenarios.runs.campaign.campaign import run_campaign
from handover.scenarios.runs.campaign.folder import CampaignFolder, default_folder
from handover.scenarios.runs.campaign.grid import parse_grid, set_parameters, split_units, vary_units
from handover.scenarios.runs.campaign.plan import MAX_RUNS, CampaignPlan
from handover.scenarios.runs.campaign.plan_check import prepared
from handover.scenarios.runs.campaign.pools import LazyPool, PoolConfig
from handover.scenarios.runs.campaign.worker_pool import RunCounts
from handover.scenarios.runs.execution.errors import require_extra
from handover.scenarios.runs.execution.file_experiment import settable_of
from handover.scenarios.runs.execution.request import RunRequest, check_subject, experiment_type
from handover.scenarios.runs.execution.selection import path_of_class

_OF_COMMANDS = {
    "repeat": "seeds=2 runs each point with two seeds",
    "report": "a sweep from Python writes no page; its result's report() does",
}
"""Names of options that are no arguments of `sweep`, and what is right instead."""


def sweep(
    scenario: str | Path | type[Experiment[Any]],
    /,
    *,
    seeds: int = 1,
    seed: int = 0,
    paired: bool = True,
    units: Mapping[str, Path | str | Sequence[Path | str]] | None = None,
    out: Path | str | None = None,
    start: Seconds | None = None,
    stop: Seconds | None = None,
    step: Seconds | None = None,
    inputs: Path | str | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    record: str | Sequence[str] = (),
    algorithm: str | Algorithm | None = None,
    isolate: str | Sequence[str] = (),
    options: MasterOptions | None = None,
    progress: bool = True,
    parameters: Mapping[str, Any] | None = None,
    **named: Any,
) -> Campaign:
    """Run all combinations of parameters' values, each with so many seeds, on all cores; return the campaign.

    `sweep("ir_grasp", seeds=5, strategy=["reflex", "blind"])` makes ten runs. Lists are varied, single values set; of a
    parameter that is an array, a list of arrays is varied. Each run is a process of its own. The folder stays: `out`,
    or one of its own in `campaigns/`. However a campaign was ended, the same call resumes it and repeats nothing that
    is done.

    Args:
        scenario: its name, or its class in a module, from which each run's process imports it; or the path of an
            `.ssp` or `.fmu` file.
        seeds: runs of each combination.
        seed: of the campaign, from which those of the runs follow.
        paired: whether all combinations get the same seeds, so that they can be compared run by run.
        units: what takes the place of the scenario's units, by their names: files of FMUs, or blocks as `my_arm:MyArm`.
            A list varies the unit.
        out: the folder of the campaign.
        start: as of `handover.run`.
        stop: as of `handover.run`.
        step: as of `handover.run`.
        inputs: as of `handover.run`.
        workers: runs at the same time, by default one a core.
        scheduler: address of a Dask scheduler whose workers do the runs.
        record: as of `handover.run`; of a file they are metrics, too.
        algorithm: as of `handover.run`.
        isolate: as of `handover.run`.
        options: as of `handover.run`.
        progress: whether a bar is shown, where there is a notebook or a terminal.
        parameters: what is varied and set of parameters whose names are also those of options.
        **named: what is varied and set of the others.

    Raises:
        InvalidInput: something of it cannot be run, with all faults and what would be right, or the extra `campaigns`
            is not installed; nothing is written.
        KeyboardInterrupt: Ctrl-C; runs that have ended are kept.
        RecordNotWritten: the disk is full.
        ClusterLost: all workers were lost; runs that have ended are kept.
    """
    given = merged(parameters, named)
    with errors_for_python(named, sweep, _OF_COMMANDS):
        require_extra("campaigns", "campaigns")
        if workers is not None and scheduler is not None:
            raise InvalidInput("workers and scheduler: a scheduler has workers of its own; give one of them")
        if scheduler is not None:
            of_type("scheduler", scheduler, str, "an address such as 'tcp://10.0.0.5:8786'")
        pool = PoolConfig(None if workers is None else whole_number("workers", workers, 1), scheduler)
        name = _name_of(scenario)
        common = RunRequest(
            subject=name,
            seed=whole_number("seed", seed),
            units=unit_texts(units),
            start=exact_time("start", start),
            stop=exact_time("stop", stop),
            step=exact("step", step),
            inputs=path_or_none("inputs", inputs),
        )
        common.check_options()
        experiment = experiment_type(name, common.start, common.stop, common.step, common.inputs)
        declared = experiment.parameters() if (settable := settable_of(experiment)) is None else settable.ports.values()
        shapes = {v.name: v.shape for v in declared}
        _refuse_too_many(given)
        varied = {name: value for name, value in given.items() if _is_varied(value, shapes.get(name, ()))}
        texts = [f"{name}={_values_text(value, shapes.get(name, ()))}" for name, value in varied.items()]
        kept_units, choices = split_units(experiment, common.units)
        points = vary_units(parse_grid(experiment, texts), choices)
        fixed = texts_of({name: value for name, value in given.items() if name not in varied})
        plan = CampaignPlan(
            scenario=name,
            points=points,
            fixed=set_parameters(
                experiment, fixed, points, "{0} takes one value, and {1} are several; give a list to vary it"
            ),
            repetitions=whole_number("seeds", seeds, 1),
            seed=common.seed,
            paired=flag("paired", paired),
            units=kept_units,
            varied_units=tuple(choices),
            options=master_options(options, algorithm, isolate),
            start=common.start,
            stop=common.stop,
            step=common.step,
            inputs=common.inputs,
            recorded=several_texts("record", record),
        )
        return _carried_out(plan, path_or_none("out", out), pool, flag("progress", progress))


def _name_of(scenario: object) -> str:
    """Return the name by which the processes of runs find a scenario.

    Raises:
        UsageError: it is none.
        InvalidInput: it is a class that they cannot find.
    """
    if isinstance(scenario, Path):
        return str(scenario)
    check_subject(scenario)
    if isinstance(scenario, type):
        path = path_of_class(cast(type[Experiment[Any]], scenario))
        if path is None or path.startswith("__main__:"):
            where = "a module in the working directory, or an installed package"
            raise InvalidInput(
                f"{scenario.__name__}: each run of a sweep imports its scenario, so it must be in {where}"
            )
        return path
    if not isinstance(scenario, str):
        raise InvalidInput("a system has no parameters that could be swept; a scenario, an SSP or an FMU has")
    return scenario


def _carried_out(plan: CampaignPlan, out: Path | None, workers: PoolConfig, shown: bool) -> Campaign:
    ready = prepared(plan, lambda _checked: workers.check())
    with contextlib.ExitStack() as opened, bar(shown) as move, _main_module_hidden():
        folder = CampaignFolder(out) if out else default_folder(ready.plan, ready.fmus, opened)
        folder.check(ready.plan, ready.fmus)

        def tell(counts: RunCounts) -> None:
            ended = counts.ended + counts.lost
            move(ended, counts.total, f"{ended} of {counts.total} runs")

        run_campaign(ready, folder, LazyPool(workers.start, opened), tell)
    return Campaign(folder.path)


def _refuse_too_many(given: Mapping[str, Any]) -> None:
    """Refuse lists of more values than runs can be planned, before they are spelled out: a range may be a typing error.

    Raises:
        InvalidInput: there are some.
    """
    lists = {n: v for n, v in given.items() if isinstance(v, (Sequence, np.ndarray)) and not isinstance(v, str)}
    many = [n for n, v in lists.items() if getattr(v, "ndim", 1) and len(v[: MAX_RUNS + 1]) > MAX_RUNS]
    if many:
        raise InvalidInput(f"{', '.join(many)}: too many values; at most {MAX_RUNS:,} runs can be planned")


def _is_varied(value: Any, shape: tuple[int, ...]) -> bool:
    """Return whether a value is a list of values of a parameter of this shape, and not one value."""
    if isinstance(value, str) or not isinstance(value, (Sequence, np.ndarray)):
        return False
    return np.ndim(cast(Any, value)) > len(shape) or not np.size(cast(Any, value))


def _values_text(values: Any, shape: tuple[int, ...]) -> str:
    texts = [text_of_value(value) for value in values]
    return (";" if shape or any("," in text for text in texts) else ",").join(texts)


@contextlib.contextmanager
def _main_module_hidden() -> Generator[None, None, None]:
    """Keep worker processes from running the program again that starts them.

    Python imports the main program in processes that it starts, for the sake of what is defined there; workers need
    nothing of it, and a program without `if __name__ == "__main__"` would start workers of workers.
    """
    main = sys.modules.get("__main__")
    sys.modules["__main__"] = types.ModuleType("__main__")
    try:
        yield
    finally:
        if main is not None:
            sys.modules["__main__"] = main
