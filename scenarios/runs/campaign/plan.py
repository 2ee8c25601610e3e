"""The plan of a campaign: points in the space of a scenario's parameters, each run several times, with their seeds."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from handover.cosim.stepping.options import MasterOptions
from handover.scenarios.catalog import ScenarioSource
from handover.scenarios.experiment.experiment import Experiment
from handover.scenarios.runs.execution.request import experiment_type, is_file

MAX_RUNS = 100_000
"""Runs of a campaign: more of them are likelier a typing error than intended."""

MAX_REPETITIONS = 10_000
"""Runs of a point: up to here, names of runs sort in the order of their repetitions."""

_MAX_NAME_LENGTH = 80
_UNSAFE = re.compile(r"[^A-Za-z0-9.,=+_-]")


@dataclass(frozen=True, kw_only=True)
class PlannedRun:
    """One run of a campaign.

    Attributes:
        name: of its folder in the campaign's `runs/`, unique.
        point: number of its point, from 0.
        repetition: number of its repetition, from 0.
        parameters: name and value, as texts, of every parameter that is set.
        seed: of all its random numbers.
    """

    name: str
    point: int
    repetition: int
    parameters: Mapping[str, str]
    seed: int


@dataclass(frozen=True, kw_only=True)
class CampaignPlan:
    """Points times repetitions.

    Attributes:
        scenario: its name, or the path of an SSP or an FMU.
        points: what is varied, a mapping of parameters' names to values, as texts, for each point.
        fixed: parameters that are the same in all runs, likewise.
        repetitions: runs of each point.
        seed: the campaign's; each run's is derived from it.
        paired: whether all points of a repetition share a seed, so that their runs can be compared one by one.
        scenes: if paired, parameters whose values have seeds of their own: points that differ in them share no seeds,
            so that their runs can be counted together.
        units: what takes the place of units in all runs, by the units' names: files of FMUs, or paths of blocks.
        varied_units: units that points give other FMUs; a point names the file or the block by the unit's name, or
            leaves it as it is in the other runs.
        options: how units are run.
        start: when each run of an SSP or FMU starts, s; None: as the file says.
        stop: when each run ends, s; None: as the scenario or the file says.
        step: of all units of an SSP or FMU, s; None: as they propose.
        inputs: a file of inputs over time, of an FMU.
        recorded: as of `Task`.
        log_level: from which level on each run's log.txt has logs, see `logging_to_standard_error`.
        experiment: name of the published experiment that it belongs to; "" if to none.
    """

    scenario: str
    points: Sequence[Mapping[str, str]]
    fixed: Mapping[str, str] = field(default_factory=dict[str, str])
    repetitions: int = 1
    seed: int = 0
    paired: bool = False
    scenes: Sequence[str] = ()
    units: Mapping[str, str] = field(default_factory=dict[str, str])
    varied_units: Sequence[str] = ()
    options: MasterOptions = field(default_factory=MasterOptions)
    start: Fraction | None = None
    stop: Fraction | None = None
    step: Fraction | None = None
    inputs: Path | None = None
    recorded: Sequence[str] = ()
    log_level: str | None = None
    experiment: str = ""

    @property
    def kind(self) -> type[Experiment[Any]]:
        """The scenario, or the file as one.

        Raises:
            UsageError, CosimError: there is no such scenario, or the file cannot be run.
        """
        return experiment_type(self.scenario, self.start, self.stop, self.step, self.inputs)

    @property
    def file(self) -> Path | None:
        """The SSP or the FMU; None of a scenario."""
        return Path(self.scenario) if is_file(self.scenario) else None

    @property
    def source(self) -> ScenarioSource | None:
        """Where the scenario is found again; None of one of this package, and of a file."""
        return None if self.file else ScenarioSource.of(self.scenario)

    @property
    def size(self) -> int:
        """Number of runs."""
        return len(self.points) * self.repetitions

    def texts(self, point: int) -> list[str]:
        """Return the parameters of a point's runs, as texts `name=value`."""
        given = {**self.fixed, **self.points[point]}
        return [f"{name}={value}" for name, value in given.items() if name not in self.varied_units]

    def fmus(self, point: int, fmus: Mapping[str, Path]) -> dict[str, Path]:
        """Return the FMU of each unit at a point, out of a campaign's FMUs, in which varied units have `unit_key`."""
        given = self.points[point]
        own = {unit: fmus[unit_key(unit, given[unit])] for unit in self.varied_units if unit in given}
        return {name: path for name, path in fmus.items() if not self._is_varied(name)} | own

    def _is_varied(self, key: str) -> bool:
        unit, equals, _ = key.partition("=")
        return bool(equals) and unit in self.varied_units

    def runs(self) -> tuple[PlannedRun, ...]:
        """Return the runs, point by point.

        Names are those of a campaign's folder if `checked_plan` has returned the plan. A run's name and seed follow
        from its point and its repetition alone: they stay the same if there are more repetitions.
        """
        seed_points = self._seed_points()
        return tuple(
            PlannedRun(
                name=self._name(point, repetition),
                point=point,
                repetition=repetition,
                parameters={**self.fixed, **self.points[point]},
                seed=run_seed(self.seed, seed_points[point], repetition),
            )
            for point in range(len(self.points))
            for repetition in range(self.repetitions)
        )

    def _seed_points(self) -> Sequence[int | None]:
        """Return, for each point, the first point that shares its seeds, None if all do."""
        if not self.paired:
            return range(len(self.points))
        if not self.scenes:
            return [None] * len(self.points)
        first: dict[tuple[str | None, ...], int] = {}
        return [
            first.setdefault(tuple(point.get(name) for name in self.scenes), number)
            for number, point in enumerate(self.points)
        ]

    def _name(self, point: int, repetition: int) -> str:
        """Return a name such as `007_alpha=0.2_r0003`: point, varied values as far as there is room, repetition."""
        number = str(point).zfill(max(3, len(str(len(self.points) - 1))))
        values = "_".join(f"{name}={value}" for name, value in self.points[point].items())
        end = f"_r{repetition:04d}"
        begin = safe_name(f"{number}_{values}" if values else number)
        return begin[: _MAX_NAME_LENGTH - len(end)] + end


def safe_name(text: str) -> str:
    """Return a file's name that every system takes, like the text."""
    return _UNSAFE.sub("-", text)


def unit_key(unit: str, given: str) -> str:
    """Return the name of an FMU among a campaign's, of a unit that is varied."""
    return f"{unit}={given}"


def run_seed(campaign: int, point: int | None, repetition: int) -> int:
    """Return the seed of a run by its campaign's seed; `point` is None where all points of a repetition share it.

    It has 53 bits: any reader of JSON keeps them, and no two of 100,000 runs are likely to share a seed.
    """
    key = (repetition,) if point is None else (point, repetition)
    return int(np.random.SeedSequence(campaign, spawn_key=key).generate_state(1, np.uint64)[0] >> np.uint64(11))


def is_number(text: str) -> bool:
    """Return whether a value of a unit's parameter, given as text, is a number."""
    try:
        float(text)
    except ValueError:
        return False
    return True
