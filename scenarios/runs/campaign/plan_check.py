"""Checks all of a campaign's plan before any of its runs begins."""

from collections.abc import Callable, Generator, Iterable, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NoReturn

from handover.cosim.master.master import Master
from handover.cosim.ssp.archive import ssp_root
from handover.cosim.system.recorded_variables import record_variables
from handover.cosim.system.system import System
from handover.fmus.build import cached
from handover.scenarios.experiment.experiment import Experiment
from handover.scenarios.experiment.parameters import InvalidParameter, idle_fault, idle_parameters, text_of
from handover.scenarios.runs.campaign.plan import MAX_REPETITIONS, MAX_RUNS, CampaignPlan, unit_key
from handover.scenarios.runs.execution.errors import UsageError
from handover.scenarios.runs.execution.file_experiment import settable_of
from handover.scenarios.runs.execution.selection import replacements, select_fmus
from handover.scenarios.runs.execution.unit_values import (
    built_system,
    check_value,
    is_unit_value,
    set_values,
    split_parameters,
)
from handover.scenarios.runs.results.tolerated_faults import scenario_code


@dataclass(frozen=True)
class PreparedPlan:
    """A plan whose runs can begin, as `prepared` gives it.

    Attributes:
        plan: the plan as it was checked.
        fmus: the FMU of each unit.
    """

    plan: CampaignPlan
    fmus: Mapping[str, Path]


def prepared(plan: CampaignPlan, before_units: Callable[[CampaignPlan], None] = lambda _plan: None) -> PreparedPlan:
    """Check a plan and its units, which may have to be built.

    Args:
        plan: what is to be run.
        before_units: raises what can be found without units, which take a while to build; it gets the checked plan.

    Raises:
        As `checked_plan`, `before_units`, `unit_fmus` and `check_units`.
    """
    plan = checked_plan(plan)
    before_units(plan)
    fmus = unit_fmus(plan)
    check_units(plan, fmus)
    return PreparedPlan(plan, fmus)


def checked_plan(plan: CampaignPlan) -> CampaignPlan:
    """Return the plan with each value in its canonical text, which is the same in all plans with that value.

    Raises:
        UsageError: there is no such scenario.
        InvalidParameter: it has too many runs or none, values that are invalid by themselves or together, or parameters
            of which nothing comes at any point.
    """
    experiment = plan.kind
    _check_size(plan)
    faults: dict[str, None] = {}
    usual = {v.name: text_of(v, v.start) for v in experiment.parameters()}
    fixed: dict[str, str] = {}
    points: list[dict[str, str]] = []
    idle: dict[str, str] = {}
    at_work: set[str] = set()
    for number, point in enumerate(plan.points):
        try:
            chosen = {unit: point[unit] for unit in plan.varied_units if unit in point}
            parameters, of_units = split_parameters(experiment, plan.texts(number))
            _check_together(experiment, parameters, point)
            texts = {v.name: text_of(v, getattr(parameters, v.name)) for v in experiment.parameters()}
            texts |= {**of_units, **chosen}
            points.append({name: texts[name] for name in point})
            idle_here = idle_parameters(experiment, parameters)
            idle = {**idle_here, **idle}
            at_work |= {n for n, text in texts.items() if n not in idle_here and text != usual.get(n)}
            fixed = {name: texts[name] for name in plan.fixed}
        except InvalidParameter as e:
            faults.update(dict.fromkeys(e.faults))
    faults.update({idle_fault(name, needed): None for name, needed in idle.items() if name not in at_work})
    if faults:
        raise InvalidParameter(tuple(faults))
    return replace(plan, points=points, fixed=fixed)


def unit_fmus(plan: CampaignPlan) -> dict[str, Path]:
    """Return the FMU of each unit: that of the plan, or the catalog's. Of units that are varied, all by `unit_key`.

    Of a campaign of a file it is the file, by its name.

    Raises:
        UsageError: the plan names a unit that the scenario does not have, the catalog's unit cannot be built, or an FMU
            or SSP is unpacked: a campaign keeps copies of files.
    """
    if plan.file is not None:
        _check_packed([plan.file])
        return {plan.file.stem: plan.file}
    experiment = plan.kind
    others = replacements(experiment, [f"{name}={other}" for name, other in plan.units.items()])
    fmus: dict[str, Path] = {}
    for chosen in dict.fromkeys(_chosen_units(plan, point) for point in plan.points):
        varied = {unit: other for unit, other in zip(plan.varied_units, chosen, strict=True) if other}
        found = select_fmus(experiment, {**others, **varied}, lambda unit: cached(unit, 3))
        fmus |= {unit_key(name, varied[name]) if name in varied else name: path for name, path in found.items()}
    _check_packed(fmus.values())
    return fmus


def _check_packed(files: Iterable[Path]) -> None:
    if unpacked := [str(file) for file in files if ssp_root(file).is_dir()]:
        how = "a campaign keeps copies of files: zip what is in the folder to a file that ends with .fmu or .ssp"
        raise UsageError(f"{', '.join(unpacked)}: {how}")


def _chosen_units(plan: CampaignPlan, point: Mapping[str, str]) -> tuple[str, ...]:
    """Return what a point puts in the place of each unit that is varied, "" where nothing."""
    return tuple(point.get(unit, "") for unit in plan.varied_units)


def check_units(plan: CampaignPlan, fmus: Mapping[str, Path]) -> None:
    """Check that the FMUs make up the scenario's system: one that takes a unit's place may have other ports.

    The system is that of the first point, or of the first with such units: parameters change what units do, not how
    they are wired. Of units' parameters, the values of all points are checked.

    Raises:
        InvalidFmu, WiringError, ScheduleError: they do not make it up. ScenarioFailed: the scenario's own code did.
        InvalidParameter: a unit does not take the value of a parameter.
    """
    instance = plan.kind()
    parameters, _ = split_parameters(type(instance), plan.texts(0))
    with scenario_code(instance):
        instance.evaluator(parameters)
        stop = instance.stop_time(parameters) if plan.stop is None else plan.stop
    first: dict[tuple[str, ...], int] = {}
    for number, point in enumerate(plan.points):
        first.setdefault(_chosen_units(plan, point), number)
    for chosen, number in first.items():
        system = built_system(instance, parameters, plan.seed, plan.fmus(number, fmus), {})
        _check_unit_values(instance, system, plan, [p for p in plan.points if _chosen_units(plan, p) == chosen])
        record_variables(system, plan.recorded)
        Master(system, plan.options, stop=stop)


def _check_unit_values(
    experiment: Experiment[Any], system: System, plan: CampaignPlan, points: Sequence[Mapping[str, str]]
) -> None:
    """Check the values of units' parameters at points with the system's units: each by itself, then as a run has them.

    Raises:
        InvalidParameter: with all values that are none, or with the first point of each fault of values together.
    """
    kind = type(experiment)
    at = [{n: v for n, v in {**plan.fixed, **point}.items() if is_unit_value(kind, n)} for point in points]
    wired, faults = system.units, dict[str, str]()
    for name, value in dict.fromkeys(item for values in at for item in values.items()):
        with _collected(faults, ""):
            check_value(experiment, system, name, value)
    if not faults and (settable := settable_of(kind)) is not None:  # all points have the same names
        faults = dict.fromkeys(settable.faults([f"{name}={value}" for name, value in at[0].items()]), "")
    elif not faults:
        for values, point in zip(at, points, strict=True):
            system.units = wired
            set_values(system, values)
            with _collected(faults, _place_of(point)), scenario_code(experiment):
                experiment.check_unit_values(system, tuple(values))
    system.units = wired
    if faults:
        raise InvalidParameter([f"{where}{fault}" for fault, where in faults.items()])


@contextmanager
def _collected(faults: dict[str, str], where: str) -> Generator[None]:
    """Add the faults of an `InvalidParameter`, with the place where each was found first."""
    try:
        yield
    except InvalidParameter as e:
        for fault in e.faults:
            faults.setdefault(fault, where)


def _place_of(point: Mapping[str, str]) -> str:
    return f"at {', '.join(f'{name}={value}' for name, value in point.items())}: " if point else ""


def _check_size(plan: CampaignPlan) -> None:
    if not plan.points or plan.repetitions < 1:
        raise InvalidParameter(["the campaign has no runs"])
    if plan.repetitions > MAX_REPETITIONS:
        raise InvalidParameter([f"{plan.repetitions:,} repetitions; at most {MAX_REPETITIONS:,} can be planned"])
    if plan.size > MAX_RUNS:
        text = f"{len(plan.points):,} points times {plan.repetitions:,} repetitions are {plan.size:,} runs"
        raise InvalidParameter([f"{text}; at most {MAX_RUNS:,} can be planned"])


class _ParametersAccepted(Exception):
    """The scenario has checked its parameters and asks for its first FMU."""


def _check_together(experiment: type[Experiment[Any]], parameters: Any, point: Mapping[str, str]) -> None:
    """Let a scenario check its parameters against each other, which it does before it asks for FMUs."""

    def stop(_unit: str) -> NoReturn:
        raise _ParametersAccepted

    instance = experiment()
    try:
        with scenario_code(instance), suppress(_ParametersAccepted):
            instance.build(parameters, 0, stop)
    except InvalidParameter as e:
        raise InvalidParameter([f"{_place_of(point)}{fault}" for fault in e.faults]) from e
