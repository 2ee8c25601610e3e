"""What a campaign is to run: points in the space of a scenario's parameters, each several times."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from cosim.master_options import MasterOptions


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
        scenario: its name.
        points: what is varied, a mapping of parameters' names to values, as texts, for each point.
        fixed: parameters that are the same in all runs, likewise.
        repetitions: runs of each point.
        seed: the campaign's; each run's is derived from it.
        paired: whether all points of a repetition share a seed, so that their runs can be compared one by one.
        units: files of FMUs that take the place of units, by the units' names.
        options: how units are run.
    """

    scenario: str
    points: Sequence[Mapping[str, str]]
    fixed: Mapping[str, str] = field(default_factory=dict[str, str])
    repetitions: int = 1
    seed: int = 0
    paired: bool = False
    units: Mapping[str, str] = field(default_factory=dict[str, str])
    options: MasterOptions = field(default_factory=MasterOptions)
