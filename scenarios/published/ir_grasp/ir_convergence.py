"""Figures 12 and 13 of Luberto et al.: distances of the fingers over the steps of the grasp's refinement."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import ClassVar

import numpy as np

from handover.controllers.ir_grasp.ir_reflex import Phase
from handover.controllers.ir_grasp.parameters import Params as ReflexParams
from handover.cosim.blocks.ports import Floats
from handover.cosim.exceptions import counted
from handover.cosim.record.reader import Record
from handover.plants.ir_grasp.objects import SOLIDS
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.published.claims import Statement
from handover.scenarios.published.figures import Mark, Panel, drawn
from handover.scenarios.published.ir_grasp.grasp_drawings import draw_cases, draw_poses, draw_sequences
from handover.scenarios.published.ir_grasp.ir_table import OBJECTS, POSES, REFLEX, IrTableRuns, distance_claims
from handover.scenarios.published.published_experiment import Claim, ComparisonTable, PublishedExperiment
from handover.scenarios.published.runs import Runs
from handover.scenarios.published.tables import table_of
from handover.scenarios.published.verdicts import FEW, format_median, format_rate, format_share, min_trials_for
from handover.scenarios.robots.ir_grasp.evaluation import IN_COST
from handover.scenarios.robots.ir_grasp.ir_grasp import IrGrasp
from handover.scenarios.robots.ir_grasp.plots import FINGER_COLOURS, FINGER_NAMES
from handover.scenarios.runs.campaign.plan import CampaignPlan
from handover.scenarios.runs.campaign.statistics import success_interval
from handover.scenarios.runs.campaign.table import CampaignTable

_REPETITIONS = 16
_NUMBERS = {False: "12", True: "13"}
_NORM = "#7a1f5c"


class IrConvergence(PublishedExperiment):
    """The table's five things, nominal and perturbed, 16 times each, grasped by the paper's algorithm.

    Figures 12 and 13 show single runs; here all runs are shown, beside the distances of table II, at which the paper's
    ended. The page has drawings after figures 5, 9 and 11, too.
    """

    name: ClassVar[str] = "ir-convergence"
    title: ClassVar[str] = "distances over the steps of infrared grasps: Luberto et al., figs. 5, 9, 11 to 13, table II"
    scenario: ClassVar[str] = IrGrasp.name

    def plan(self, quick: bool) -> CampaignPlan:
        """Return 16 runs of each thing and pose; one if quick."""
        return self.campaign(
            [{"thing": thing.name.lower(), "perturbed": p} for p, thing in product(("false", "true"), SOLIDS)],
            fixed={**REFLEX.parameters, "correction": "paper"},
            repetitions=1 if quick else _REPETITIONS,
            seed=1312,
            paired=True,
            scenes=("thing",),
        )

    def claims(self, table: CampaignTable) -> Sequence[Claim]:
        """Return the claims of table II on the distances at the last step."""
        return distance_claims(IrTableRuns(table))

    def record_claims(self, table: CampaignTable, runs: Path) -> Sequence[Claim]:
        """Judge that the residual's norm falls."""
        return [judge_descents(descents_of(IrTableRuns(table).of(REFLEX, p), runs), p) for p in POSES]

    def tables(self, table: CampaignTable) -> Sequence[ComparisonTable]:
        """Return steps and distances at the last step beside the published."""
        runs = IrTableRuns(table)
        note = (
            "After the last step, or after the recoveries that may follow it, or at the best pose of all: curves may "
            "end elsewhere. Medians of the runs in which the finger sees the object; not seen: by half of the runs or "
            "more. Both poses of an object are taken together. The norm is that of thumb and ring."
        )
        return [
            table_of("As the hand closes (mm)", [_last_step(runs, *cell) for cell in product(POSES, OBJECTS)], note)
        ]

    def draw(self, table: CampaignTable, runs: Path, folder: Path) -> Sequence[Figure]:
        """Draw distances and norm over steps, poses, two grasps in moments, and the recovering actions."""
        found = IrTableRuns(table)
        rows = [row for p in POSES for row in found.of(REFLEX, p)]
        others = (draw_poses(rows, runs, folder), draw_sequences(rows, runs, folder), draw_cases(folder))
        descents = [_draw_descents(found, p, runs, folder) for p in POSES]
        return [*(f for of_pose in descents for f in of_pose), *(f for f in others if f is not None)]


@dataclass(frozen=True, eq=False)
class Descent:
    """One run's distances at the beginning of its first step, and after each step.

    Attributes:
        distance: by the controller's curve, of thumb, index and ring, shape (steps + 1, 3), m; NaN where a finger sees
            nothing.
    """

    distance: Floats

    @property
    def norm(self) -> Floats:
        """The residual's Euclidean norm, sqrt(d_thumb^2 + d_ring^2), m: the paper's residual is the distance itself."""
        return np.sqrt(np.sum(self.distance[:, IN_COST] ** 2, axis=1))

    @property
    def ends(self) -> tuple[float, float] | None:
        """The norm before the first step and after the last one; None without steps, or where a finger loses sight."""
        first, last = float(self.norm[0]), float(self.norm[-1])
        return (first, last) if len(self.norm) > 1 and np.isfinite([first, last]).all() else None

    @classmethod
    def of(cls, record: Record) -> "Descent | None":
        """Read a run; None if it made no step.

        A step is over at the control period in which it is counted: the hand then stands where it led.
        """
        steps, phase = record["reflex.steps"].astype(int), record["reflex.phase"]
        if not steps.max():
            return None
        first = int(np.argmax(phase == Phase.STEP))
        index = [first, *(int(np.argmax(steps == n)) for n in range(1, int(steps.max()) + 1))]
        seen = record["reflex.distance"][index]
        return cls(np.where(seen < ReflexParams().distance_max, seen, np.nan))


def descents_of(found: Runs, runs: Path) -> list[Descent]:
    """Return the descents of runs whose folders are in `runs`; of those that made a step."""
    descents = [Descent.of(Record(runs / name / "signals.parquet")) for name in found.names]
    return [descent for descent in descents if descent is not None]


def median_of(curves: Sequence[Floats]) -> Floats:
    """Return the median by step, over the curves that go as far and have a value there.

    It ends where fewer than half of the curves go on, and is NaN where fewer than half of those have a value: a few
    would stand for all.
    """
    length = max((len(c) for c in curves), default=0)
    columns = [np.array([c[k] for c in curves if len(c) > k]) for k in range(length)]
    kept = [column for column in columns if 2 * len(column) >= len(curves)]
    return np.array([np.median(c[np.isfinite(c)]) if 2 * np.isfinite(c).sum() >= len(c) else np.nan for c in kept])


def judge_descents(descents: Sequence[Descent], perturbed: bool) -> Claim:
    """Judge that the residual's norm falls, by descents in a pose."""
    says = Statement(
        f"In {POSES[perturbed]} poses the algorithm reduces the norm of the residual.",
        f"fig. {_NUMBERS[perturbed]}, sec. V-D",
        "it falls",
    )
    ends = [d.ends for d in descents if d.ends is not None]
    if not ends:
        return says.unknown()
    rose, n = sum(last >= first for first, last in ends), len(ends)
    first, last = (1e3 * np.median(v) for v in zip(*ends, strict=True))
    interval = success_interval(rose, n)
    return says.judged(
        f"from {first:.0f} to {last:.0f} mm (medians); it did not fall in {format_rate(rose, n)}",
        interval.high < FEW,
        f"the interval (Clopper-Pearson) of how often it does not fall lies below {format_share(FEW)}. Runs count "
        "that made a step and saw the object with thumb and ring at their end",
        f"Left out are {len(descents) - n} of {counted(len(descents), 'run')}.",
        runs=(n, min_trials_for(FEW)),
        interval=interval,
    )


def _last_step(runs: IrTableRuns, perturbed: bool, name: str) -> dict[str, str]:
    printed, found = runs.published_distances(name, perturbed), runs.of(REFLEX, perturbed, OBJECTS[name])
    ends = [(r["final_distance_thumb"], r["final_distance_ring"]) for r in found]
    norms = np.array([math.hypot(*end) for end in ends if None not in end])
    ours = {finger: runs.distance(finger, perturbed, name) for finger in FINGER_NAMES}
    ours["norm"], printed["norm"] = norms[np.isfinite(norms)], math.hypot(printed["thumb"], printed["ring"])
    row = {"object and pose": f"{name.replace('_', ' ')}, {POSES[perturbed]}", "runs": str(len(found))}
    row["steps"] = format_median(found.metric("steps"), 0)
    for what, values in ours.items():
        row[f"{what}, ours"] = f"{1e3 * np.median(values):.1f}" if 2 * len(values) > len(found) else "not seen"
        row[f"{what}, published"] = f"{1e3 * printed[what]:.0f}"
    return row


def _draw_descents(runs: IrTableRuns, perturbed: bool, folders: Path, folder: Path) -> list[Figure]:
    found = {name: descents_of(runs.of(REFLEX, perturbed, things), folders) for name, things in OBJECTS.items()}
    last = max((len(d.norm) - 1 for descents in found.values() for d in descents), default=1)
    above: list[Panel] = []
    below: list[Panel] = []
    for name, descents in found.items():
        printed = runs.published_distances(name, perturbed)
        fingers: list[Mark] = []
        for i, finger in enumerate(FINGER_NAMES):
            curves = [1e3 * d.distance[:, i] for d in descents]
            fingers += _curves(curves, FINGER_COLOURS[i], finger, last, 1e3 * printed[finger])
        norm = 1e3 * math.hypot(printed["thumb"], printed["ring"])
        number = counted(len(descents), "run")
        axes = {"xlabel": "Gauss-Newton step", "xlim": (-0.4, last + 1.2)}
        key = [
            Mark(label="a run", style={"lw": 0.6}),
            Mark(form="s", label="table II, at the last step", style={"mfc": "none", "mew": 1.5}),
        ]
        title = f"{name.replace('_', ' ')} ({number})"
        above.append(Panel(fingers, {"title": title, "ylabel": "distance (mm)", "ylim": (0, 68), **axes}))
        norms = _curves([1e3 * d.norm for d in descents], _NORM, "norm", last, norm)
        below.append(Panel([*norms, *key], {"ylabel": "norm, thumb and ring (mm)", "ylim": (0, 92), **axes}))
    caption = (
        f"Distances by the sensors and the norm of the residual in {POSES[perturbed]} poses, as in [Luberto] fig. "
        f"{_NUMBERS[perturbed]}. Each run is thin, the median thick, as far as half of the runs go. Nothing is drawn "
        "where a finger sees nothing. Squares: table II, where the paper's runs ended (the norm follows from it)."
    )
    return drawn(folder / f"convergence_{POSES[perturbed]}", caption, [*above, *below], 3, size=(10.0, 5.6))


def _curves(curves: Sequence[Floats], colour: str, label: str, last: int, published: float) -> list[Mark]:
    median = median_of(curves)
    square = {"mfc": "none", "mew": 1.5, "ms": 6, "clip_on": False}
    return [
        *(Mark(range(len(c)), c, "-", colour, style={"lw": 0.6, "alpha": 0.4}) for c in curves),
        Mark(range(len(median)), median, "-", colour, label, style={"lw": 2.4}),
        Mark([last + 0.6], [published], "s", colour, style=square),
    ]
