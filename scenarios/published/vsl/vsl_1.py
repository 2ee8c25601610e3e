"""Experiment 1 of [Gandarias2020], sec. V-A and fig. 5: arms of soft and of rigid links go by rigid kinematics."""

from collections.abc import Mapping, Sequence
from itertools import pairwise, product
from pathlib import Path
from typing import ClassVar

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.cosim.exceptions import counted
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.paper import paper_values
from handover.scenarios.experiment.plotting import COLOURS
from handover.scenarios.published.figures import Mark, Panel, drawn
from handover.scenarios.published.published_experiment import Claim, ComparisonTable, PublishedExperiment
from handover.scenarios.published.runs import Point
from handover.scenarios.published.tables import table_of
from handover.scenarios.published.verdicts import without_verdict
from handover.scenarios.published.vsl.path_traces import (
    EQUAL,
    PathBand,
    Repetitions,
    desired_path,
    has_completed_path,
    traces_of,
)
from handover.scenarios.published.vsl.separation import Comparison, in_mm, separation_claim, spread_in_mm
from handover.scenarios.robots.vsl.parameters import BAR
from handover.scenarios.robots.vsl.path_experiments import VslModelBased
from handover.scenarios.runs.campaign.plan import CampaignPlan
from handover.scenarios.runs.campaign.table import CampaignTable

_PUBLISHED = paper_values("vsl", "published")
_SEED = 2020
"""Of the campaign; no parameter of the arm was chosen by its runs."""

PATHS = {"linear": "5(a), linear", "curve": "5(b), curve", "square": "5(c), square"}
"""Rows of fig. 5."""
LOADS: Mapping[str, Point] = {f"{1000 * load:g} g": {"load": f"{load:g}"} for load in _PUBLISHED["loads"]}
"""Columns of fig. 5."""
RIGID = "rigid"
SOFT: Mapping[str, Point] = {
    f"{pressure / BAR:g} bar": {"links": "vsl", "pressure": f"{pressure:g}"} for pressure in _PUBLISHED["pressures"]
}
ARMS: Mapping[str, Point] = {RIGID: {"links": "rigid"}, **SOFT}
"""The plots of fig. 5, besides that of the servos."""

_WHERE = "sec. V-C, fig. 5"
_NOT_PRINTED = "The paper draws these as paths and prints no numbers."
_SERVOS = "servos"
_COLOURS = {name: COLOURS[k] for name, k in zip((_SERVOS, *ARMS), (0, 1, 2, 3, 4, 8), strict=True)}
"""As in the paper: servos blue, rigid links red, then green, purple, yellow, and brown for its orange."""

_BY_SPRINGS = (
    "An arm of springs sags the more the more it carries, whatever its stiffness, so agreement proves nothing."
)
_BY_LEVER = "Weight and load bend an arm of springs the more the farther it reaches out, so agreement proves nothing."
_BY_CHOICE = "How much stiffer pressure makes a link was chosen by fig. 5, so agreement proves nothing."
_RIGID_BY_CHOICE = (
    "The stiffness of rigid links and of joints was chosen for errors as in fig. 5, so agreement proves nothing."
)
_SERVO_BY_CHOICE = "How far a servo yields under load was chosen by fig. 5, so agreement proves nothing."


def cell(path: str, load: str, arm: str) -> Point:
    """Return the parameters of a path with a load on an arm."""
    return {"path": path, **LOADS[load], **ARMS[arm]}


class Vsl1(PublishedExperiment):
    """Three paths with five loads on links that are rigid or have 0.5 to 2 bar, five times each, by rigid kinematics.

    What differs from repetition to repetition is noise: of the tracker, by which errors are measured, and of the
    encoders, which decide nothing here. The quick plan goes once along each path, with the least and the greatest load
    and pressure and on rigid links.
    """

    name: ClassVar[str] = "vsl-1"
    title: ClassVar[str] = "an arm of soft links follows paths by rigid kinematics ([Gandarias2020] fig. 5)"
    scenario: ClassVar[str] = VslModelBased.name

    def plan(self, quick: bool) -> CampaignPlan:
        """Return paths x loads x links, five times each; if quick, the extremes once."""
        loads, soft = ([*names] for names in (LOADS, SOFT))
        loads, soft = (names[:: len(names) - 1] if quick else names for names in (loads, soft))
        points = [cell(*which) for which in product(PATHS, loads, (RIGID, *soft))]
        return self.campaign(points, repetitions=1 if quick else _PUBLISHED["repetitions"], seed=_SEED)

    def claims(self, table: CampaignTable) -> Sequence[Claim]:
        """Judge what sec. V-C says of load, pressure, rigid links, reach and servos, in every cell."""
        runs = Vsl1Runs(table)
        soft, every = runs.soft, [*product(PATHS, runs.loads)]
        servo = [
            Comparison(f"{path}, {load}, {arm}", runs.of("servo_error", path, load, arm), rigid)
            for path, load in every
            for rigid in [runs.of("mean_error", path, load, RIGID)]
            for arm in runs.arms
        ]
        farther = "The farther the tip is from the base, the larger its error: on the"
        return [
            without_verdict(separation_claim(sentence, where, published, comparisons), why)
            for sentence, where, published, comparisons, why in (
                *(
                    (sentence, _WHERE, "increases", runs.by_load(arms), _BY_SPRINGS)
                    for sentence, arms in (
                        ("On soft links the tip's error grows with the load.", soft),
                        ("On rigid links it does, too: the arm yields a little.", (RIGID,)),
                    )
                ),
                ("The lower the pressure, the larger the tip's error.", _WHERE, "increases", runs.by_pressure(),
                 _BY_CHOICE),
                ("The tip's error is larger on soft links than on rigid.", _WHERE, "larger",
                 [runs.compared(f"{p}, {w}, {a}", (p, w, RIGID), (p, w, a)) for p, w in every for a in soft],
                 _RIGID_BY_CHOICE),
                (f"{farther} square.", "sec. V-C, fig. 5(c)", "higher", runs.by_reach("square"), _BY_LEVER),
                ("The path by the servos' encoders is similar to the desired one: nearer than the rigid arm's tip.",
                 _WHERE, "similar", servo, _SERVO_BY_CHOICE),
            )
        ] + [separation_claim(f"{farther} curve, too.", "", "", runs.by_reach("curve"))]  # fmt: skip

    def tables(self, table: CampaignTable) -> Sequence[ComparisonTable]:
        """Return mean errors cell by cell, path by path, and errors near the base and far from it."""
        runs = Vsl1Runs(table)
        note = (
            "Mean distance of the tip from the desired points, by the tracker. Servos: the same of where encoders and "
            "rigid links put the tip, over the runs of all links. ± is the standard deviation between runs. "
            f"{_NOT_PRINTED}{runs.unfinished}"
        )

        def errors(path: str, load: str) -> dict[str, str]:
            servos = np.concatenate([runs.of("servo_error", path, load, arm) for arm in runs.arms])
            tips = {arm: spread_in_mm(runs.of("mean_error", path, load, arm)) for arm in runs.arms}
            return {"load": load, _SERVOS: spread_in_mm(servos), **tips}

        def reach(path: str, load: str, arm: str) -> str:
            near, far = (in_mm(runs.of(f"error_{where}", path, load, arm)) for where in ("near", "far"))
            return f"{near} to {far}" if near else ""

        return [
            *(
                table_of(f"Fig. {title}: mean error (mm)", [errors(path, load) for load in runs.loads], note)
                for path, title in PATHS.items()
            ),
            table_of(
                "Near the base and far from it: mean error (mm)",
                [
                    {"path, load": f"{path}, {load}", **{arm: reach(path, load, arm) for arm in runs.arms}}
                    for path, load in product(("square", "curve"), runs.loads)
                ],
                "Of the third of the points that are nearest to the base, and of the third that are farthest from it. "
                f"The line stays at one distance. {_NOT_PRINTED}",
            ),
        ]

    def draw(self, table: CampaignTable, runs: Path, folder: Path) -> Sequence[Figure]:
        """Draw the paths like fig. 5, the errors along them, and errors by load."""
        found = Vsl1Runs(table)
        curves = {(path, load): _curves(found, path, load, runs) for path, load in product(PATHS, found.loads)}
        each = [curve for of_cell in curves.values() for curve in of_cell.values()]
        columns, repeated = len(found.loads), any(len(curve.errors) > 1 for curve in each)
        highest = 1050 * max((float(np.max(curve.errors)) for curve in each), default=0.0)
        paths: list[Panel] = []
        along: list[Panel] = []
        for (path, load), of_cell in curves.items():
            titled = {"title": f"{path}, {load}" if load == found.loads[0] else load}
            plane = {"xlabel": "x in W (mm)", "ylabel": "z in W (mm)"}
            marks = [PathBand(curve, _COLOURS[name], name) for name, curve in of_cell.items()]
            desired = [desired_path(curve.desired) for curve in [*of_cell.values()][:1]]
            paths.append(Panel([*desired, *marks], {**titled, **plane, **EQUAL}))
            errors = [_error(curve, name) for name, curve in of_cell.items()]
            limits = {"xlabel": "along the path (mm)", "ylabel": "error (mm)", "ylim": (0.0, highest)}
            along.append(Panel(errors, {**titled, **limits}))
        by_load = [_by_load(found, path) for path in PATHS]
        bands = ", means of the runs with bands of their standard deviation" if repeated else ""
        of = f"of the place where encoders and rigid links put it (servos), and of the tip by the tracker{bands}"
        width = 1.2 + 2.3 * columns
        return [
            *drawn(folder / "paths", f"Paths like [Gandarias2020] fig. 5, by load: {of}. Equal scales.",
                   paths if each else [], columns, size=(width, 9.0)),
            *drawn(folder / "errors_along", f"Distance from the desired point along the path, by load: {of}.",
                   along if each else [], columns, size=(width, 7.0)),
            *drawn(folder / "errors_by_load", "Mean distance of the tip from the desired points by load, on rigid "
                   "links and on soft ones by pressure.", by_load if len(found.done) and columns > 1 else [], 3,
                   size=(9.0, 3.6), same_height=True),
        ]  # fmt: skip


class Vsl1Runs:
    """Our results cell by cell, of what the campaign tries; a quick one leaves some out."""

    def __init__(self, table: CampaignTable) -> None:
        tried = Vsl1().runs(table, keep=lambda _: True)
        self.done = tried.where(has_completed_path)
        self.loads = [name for name, load in LOADS.items() if len(tried.matching(load))]
        self.soft = [name for name, links in SOFT.items() if len(tried.matching(links))]
        self.arms = [RIGID, *self.soft]
        left = len(tried) - len(self.done)
        self.unfinished = f" Not counted: {counted(left, 'run')} that did not complete the path." if left else ""

    def of(self, metric: str, path: str, load: str, arm: str) -> Floats:
        """Return a metric of a cell's runs that completed the path, however far off it they were."""
        return self.done.of(cell(path, load, arm)).metric(metric)

    def compared(self, label: str, less: tuple[str, str, str], more: tuple[str, str, str]) -> Comparison:
        """Compare the tip's error in two cells."""
        return Comparison(label, self.of("mean_error", *less), self.of("mean_error", *more))

    def by_load(self, arms: Sequence[str]) -> list[Comparison]:
        """Compare each load with the next, on each path and arm."""
        cells = product(PATHS, arms, pairwise(self.loads))
        return [self.compared(f"{p}, {arm}, {a} to {b}", (p, a, arm), (p, b, arm)) for p, arm, (a, b) in cells]

    def by_pressure(self) -> list[Comparison]:
        """Compare each pressure with the next, on each path with each load."""
        cells = product(PATHS, self.loads, pairwise(self.soft))
        return [self.compared(f"{p}, {load}, {a} to {b}", (p, load, b), (p, load, a)) for p, load, (a, b) in cells]

    def by_reach(self, path: str) -> list[Comparison]:
        """Compare the third of a path's points that is nearest to the base with the farthest, run by run."""
        return [
            Comparison(f"{path}, {load}, {arm}", *(self.of(f"error_{x}", path, load, arm) for x in ("near", "far")),
                       paired=True)
            for load, arm in product(self.loads, self.arms)
        ]  # fmt: skip


def _curves(runs: Vsl1Runs, path: str, load: str, folders: Path) -> Mapping[str, Repetitions]:
    """Return what a panel of fig. 5 shows: the servos' path, and that of the tip on each kind of links."""
    curves: dict[str, Repetitions] = {}
    for arm in runs.arms:
        if traces := traces_of(folders, runs.done.of(cell(path, load, arm)).names):
            curves |= {_SERVOS: Repetitions.of(traces, "servo")} if arm == RIGID else {}
            curves[arm] = Repetitions.of(traces, "tracked")
    return curves


def _error(curve: Repetitions, name: str) -> Mark:
    spread = curve.errors.std(axis=0, ddof=min(1, len(curve.errors) - 1))
    mean = curve.errors.mean(axis=0)
    return Mark(1000 * curve.along, 1000 * mean, "-", _COLOURS[name], name, band=1000 * spread)


def _by_load(runs: Vsl1Runs, path: str) -> Panel:
    marks: list[Mark] = []
    for arm in runs.arms:
        found = [(1000 * float(LOADS[x]["load"]), 1000 * runs.of("mean_error", path, x, arm)) for x in runs.loads]
        points = [(load, errors.mean()) for load, errors in found if len(errors)]
        marks += [Mark.through(points, "o-", _COLOURS[arm], arm)] if points else []
    axes = {"title": path, "xlabel": "load (g)", "ylabel": "mean error of the tip (mm)", "ylim": (0.0, None)}
    return Panel(marks, axes)
