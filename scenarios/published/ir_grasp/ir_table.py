"""Tables I and II of Luberto et al.: grasps by infrared reflex, blind, and by going forward without sensing."""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import ClassVar, NamedTuple

import numpy as np

from handover.controllers.ir_grasp.ir_reflex import Stop
from handover.cosim.blocks.ports import Floats
from handover.cosim.exceptions import counted
from handover.plants.ir_grasp.objects import SOLIDS, Thing
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.paper import paper_values
from handover.scenarios.experiment.plotting import COLOURS
from handover.scenarios.published.claims import Statement
from handover.scenarios.published.figures import Mark, Panel, drawn
from handover.scenarios.published.published_experiment import Claim, ComparisonTable, PublishedExperiment
from handover.scenarios.published.runs import Count, Point, Row, Runs
from handover.scenarios.published.tables import number, span, table_of, with_interval
from handover.scenarios.published.verdicts import (
    format_median,
    format_p_value,
    format_rate,
    format_share,
    majority_claim,
    no_worse_claim,
    order_claim,
    rare_claim,
    rate_claim,
    without_verdict,
)
from handover.scenarios.robots.ir_grasp.ir_grasp import IrGrasp
from handover.scenarios.robots.ir_grasp.plots import FINGER_COLOURS, FINGER_NAMES
from handover.scenarios.runs.campaign.plan import CampaignPlan
from handover.scenarios.runs.campaign.statistics import (
    LEVEL,
    paired_test,
    success_interval,
    time_interval,
    two_proportions,
)
from handover.scenarios.runs.campaign.table import CampaignTable

POSES: Mapping[bool, str] = {False: "nominal", True: "perturbed"}
"""By whether the object is moved after vision saw it."""
_TITLES = {
    Thing.CYLINDER: "cylinder",
    Thing.BABY_CUP_A: "baby cup, pose (a)",
    Thing.BABY_CUP_B: "baby cup, pose (b)",
    Thing.PAPER_BOX_A: "paper box, pose (a)",
    Thing.PAPER_BOX_B: "paper box, pose (b)",
}
OBJECTS: Mapping[str, tuple[Thing, ...]] = {
    "cylinder": (Thing.CYLINDER,),
    "baby_cup": (Thing.BABY_CUP_A, Thing.BABY_CUP_B),
    "paper_box": (Thing.PAPER_BOX_A, Thing.PAPER_BOX_B),
}
"""Rows of table II, which does not distinguish the poses (a) and (b)."""


class Arm(NamedTuple):
    """A way to grasp: what it is called, what makes it, and its columns in table I, nominal and perturbed, if any."""

    title: str
    parameters: Point
    column: tuple[int, int] | None = None


REFLEX = Arm("IR-guided", {"strategy": "reflex"}, (0, 2))
BLIND = Arm("blind", {"strategy": "blind"}, (1, 3))
FORWARD_35 = Arm("forward 35 mm", {"strategy": "forward", "forward": "0.035"})
FORWARD_55 = Arm("forward 55 mm", {"strategy": "forward", "forward": "0.055"})
ARMS = (REFLEX, BLIND, FORWARD_35, FORWARD_55)

Way = tuple[Arm, bool]
"""An arm, and whether poses are perturbed."""

_PUBLISHED = paper_values(IrGrasp.name, "published")
_REPETITIONS, _QUICK = 16, 3
"""Runs of a cell: with 80 of a pose and an arm an interval is at most 23 points wide; the paper has three."""
_SEED = 2016
"""Of the campaign; the runs' seeds follow from it, apart from 1000 to 1007, with which the scenario was tuned."""
_PUSHED = 0.001
"""How far an object must have moved before the hand closed to count as touched, m."""
_IN_COST = ("thumb", "ring")
_SPAN_OF_MOST_RUNS = (2.5, 97.5)
"""Percentiles of our runs between which a published figure passes for that of one run."""
_MIN_RUNS = 10
"""Runs of an object below which such percentiles say nothing."""

_BLIND_SELECTED = (
    "How far the hand is before it closes and objects were moved was chosen so that the blind hand fails about as in "
    "table I, so agreement is not evidence."
)
_FAILURE_SELECTED = (
    "The blind hand fails by choice of gap and shift, and to do better is not evidence that sensing is needed: "
    "`handover paper ir-limits` asks where it is."
)
_EASIER = (
    "More successes than published indicate an easier task, no better hand: here it is planar, five simple shapes "
    "slide on a table, and nothing tips over."
)
_TARGET_TAKEN = "The distance to which thumb and ring are brought, 10 mm, was taken from these figures."
_ONE_TARGET = "Both fingers have one target distance by construction: that they are alike shows that correction ends."
_TOO_FEW = f"There are fewer than {_MIN_RUNS} runs of an object that came to their end."
_IN_SPACE = "The index is stiffer than the other fingers by assumption, so that it lags behind as in space."


class IrTable(PublishedExperiment):
    """Five things in nominal and perturbed poses, grasped in four ways in the same scenes.

    Besides the paper's two ways, IR-guided (`reflex`) and blind, a control arm goes forward from the pre-grasp pose
    without sensing, and closes. It goes 35 mm, about as far as the reflex in nominal poses, or 55 mm. With these it did
    as well as the reflex in the scenes that the scenario was tuned in. Grasps in which it succeeds need no sensing.

    The ways share their scenes, so that they are compared run by run; things and repetitions do not, so that they are
    counted together.
    """

    name: ClassVar[str] = "ir-table"
    title: ClassVar[str] = "grasps by infrared reflex and blind: Luberto et al., tables I and II"
    scenario: ClassVar[str] = IrGrasp.name

    def plan(self, quick: bool) -> CampaignPlan:
        """Return 16 runs of a cell, three as in the paper if `quick`."""
        points = [cell(arm, perturbed, thing) for perturbed, thing, arm in product(POSES, SOLIDS, ARMS)]
        repetitions = _QUICK if quick else _REPETITIONS
        return self.campaign(points, repetitions=repetitions, seed=_SEED, paired=True, scenes=("thing",))

    def claims(self, table: CampaignTable) -> Sequence[Claim]:
        """Return the claims of tables I and II and of sec. V-D, and those of the control arm beyond the paper."""
        runs = IrTableRuns(table)
        more = "In {} poses the IR-guided hand succeeds more often than the blind one."
        fewer = "The {} hand succeeds less often in perturbed poses than in nominal ones."
        no_worse = "In {} poses a hand that goes {} mm forward without looking does no worse than the IR-guided one."
        return [
            *(_rate(runs, arm, perturbed) for perturbed, arm in product(POSES, (REFLEX, BLIND))),
            *(
                without_verdict(_order(runs, more.format(pose), (REFLEX, p), (BLIND, p)), _FAILURE_SELECTED)
                for p, pose in POSES.items()
            ),
            _order(runs, fewer.format(REFLEX.title), (REFLEX, False), (REFLEX, True)),
            without_verdict(
                _order(runs, fewer.format(BLIND.title), (BLIND, False), (BLIND, True)), _BLIND_SELECTED
            ),
            _from_afar(runs),
            _untouched(runs),
            *distance_claims(runs),
            *(
                no_worse_claim(no_worse.format(POSES[p], far), *runs.pairs((arm, p), (REFLEX, p)))
                for arm, far, p in ((FORWARD_55, 55, False), (FORWARD_55, 55, True), (FORWARD_35, 35, False))
            ),
            order_claim(
                "In perturbed poses the IR-guided hand succeeds more often than one that goes 35 mm forward without "
                "looking.", "", "", *runs.pairs((REFLEX, True), (FORWARD_35, True)), beyond=True,
            ),
        ]  # fmt: skip

    def tables(self, table: CampaignTable) -> Sequence[ComparisonTable]:
        """Return successes by pose, exact tests, how grasps came to close, and distances."""
        runs = IrTableRuns(table)
        compared = [((REFLEX, p), (arm, p)) for p, arm in product(POSES, ARMS[1:])]
        compared += [((arm, False), (arm, True)) for arm in ARMS]
        return [
            *(_successes(runs, p) for p in POSES),
            table_of(
                "Runs in the same scenes",
                [_tested(runs, *ways) for ways in compared],
                "McNemar's exact test, two-sided. The same scene: object, shift and turn, errors of vision, and noise. "
                "Between nominal and perturbed poses all but shift and turn are the same.",
            ),
            table_of(
                "How the hand came to close",
                [_closed(runs, arm, p) for p, arm in product(POSES, ARMS)],
                "Medians with bootstrapped intervals, 95 %: Gauss-Newton steps, and time until closing, from the first "
                "look at the sensors or, of a hand that does not look, from the pre-grasp pose. Displaced: how far the "
                "object was pushed before the hand closed.",
            ),
            *(
                table_of(
                    f"Table II, {pose} poses: distances at the last step (mm)",
                    [_distances(runs, name, p) for name in OBJECTS],
                    "Ours: medians of the IR-guided runs in which the finger sees the object, with bootstrapped "
                    "intervals, 95 %, as the sensors measure them, and in how many more it does not. True: median "
                    f"along the beam. Thumb and ring enter the cost. {_nearer_than_measured(runs, p)}",
                )
                for p, pose in POSES.items()
            ),
        ]

    def draw(self, table: CampaignTable, runs: Path, folder: Path) -> Sequence[Figure]:  # noqa: ARG002
        """Draw rates of success and distances."""
        found = IrTableRuns(table)
        return [
            *drawn(folder / "success_rates", "Successful grasps of all objects by arm and pose, with intervals by "
                   "Clopper and Pearson (95 %), beside the totals of [Luberto] table I. The forward arms, which go a "
                   "stated way without looking and close, are a control that the paper does not have.",
                   [_panel_of_rates(found, p) for p in POSES], 2, size=(8.0, 3.8)),
            *drawn(folder / "final_distances", "Distances between fingertips and object at the last step of the "
                   "IR-guided grasp. Points are our runs, as the sensors measure them (none where a finger sees "
                   "nothing); squares are the values of [Luberto] table II. Thumb and ring enter the cost.",
                   [_panel_of_distances(found, p) for p in POSES], 2, size=(8.0, 4.0)),
        ]  # fmt: skip


def cell(arm: Arm, perturbed: bool, thing: Thing) -> Point:
    """Return the parameters of an arm in a pose of a thing."""
    return {"thing": thing.name.lower(), "perturbed": str(perturbed).lower(), **arm.parameters}


class IrTableRuns:
    """Our results, cell by cell, and the published ones. Runs that did not come to their end do not count."""

    def __init__(self, table: CampaignTable) -> None:
        self._runs = IrTable().runs(table)
        left = len(table.rows) - len(self._runs)
        self.unfinished = f" Not counted: {counted(left, 'run')} that did not come to an end." if left else ""

    def of(self, arm: Arm, perturbed: bool, things: Sequence[Thing] = tuple(SOLIDS)) -> Runs:
        """Return the runs of an arm in a pose that came to their end."""
        return self._runs.of(*(cell(arm, perturbed, thing) for thing in things))

    def published(self, arm: Arm, perturbed: bool, thing: Thing | None = None) -> Count | None:
        """Return a cell of table I, or its total; None if the paper has not tried the arm."""
        if arm.column is None:
            return None
        k = _PUBLISHED["total" if thing is None else thing.name.lower()][arm.column[perturbed]]
        return int(k), _PUBLISHED["trials"] * (len(SOLIDS) if thing is None else 1)

    def published_distances(self, name: str, perturbed: bool) -> dict[str, float]:
        """Return a row of table II, in m by finger."""
        values = _PUBLISHED[f"final_distance_{POSES[perturbed]}_{name}"]
        return dict(zip(_PUBLISHED["fingers"], values, strict=True))

    def count(self, arm: Arm, perturbed: bool, thing: Thing | None = None) -> Count:
        """Return successes and trials of an arm in a pose, of one thing or of all."""
        return self.of(arm, perturbed, tuple(SOLIDS) if thing is None else (thing,)).count

    def pairs(self, first: Way, second: Way) -> tuple[list[bool], list[bool]]:
        """Return successes of two arms, each in a pose, in the same scenes and the same order."""
        a, b = ({(row["thing"], row["seed"]): bool(row["success"]) for row in self.of(*way)} for way in (first, second))
        scenes = sorted(a.keys() & b.keys())
        return [a[scene] for scene in scenes], [b[scene] for scene in scenes]

    def distance(self, finger: str, perturbed: bool, name: str) -> Floats:
        """Return the reflex's distances at the last step of an object, m, of the runs in which the finger sees it."""
        return self.of(REFLEX, perturbed, OBJECTS[name]).metric(f"final_distance_{finger}")

    def together(self, fingers: Sequence[str], perturbed: bool) -> Floats:
        """Return such distances of the same runs, shape (fingers, runs), NaN where a run has none."""
        rows = self.of(REFLEX, perturbed).rows
        return np.array([[_value(row, f"final_distance_{f}") for row in rows] for f in fingers], dtype=np.float64)


def _value(row: Row, name: str) -> float:
    return math.nan if row[name] is None else row[name]


def _rate(runs: IrTableRuns, arm: Arm, perturbed: bool) -> Claim:
    theirs, ours = runs.published(arm, perturbed) or (0, 0), runs.count(arm, perturbed)
    sentence = f"The {arm.title} hand holds {theirs[0]} of {theirs[1]} objects in {POSES[perturbed]} poses."
    claim = rate_claim(sentence, "table I, total", theirs, ours)
    if arm is BLIND:
        return without_verdict(claim, _BLIND_SELECTED)
    easier = ours[1] and ours[0] * theirs[1] > theirs[0] * ours[1]
    return replace(claim, reason=f"{claim.reason} {_EASIER}") if easier else claim


def _order(runs: IrTableRuns, sentence: str, first: Way, second: Way) -> Claim:
    """Return a claim of order, with a test of the paper's own counts, which are not paired."""
    theirs = [runs.published(*way) or (0, 0) for way in (first, second)]
    printed = f"{format_rate(*theirs[0])} against {format_rate(*theirs[1])}"
    note = f"The paper's own counts give p = {format_p_value(two_proportions(*theirs[0], *theirs[1]))} (Fisher)."
    return order_claim(sentence, "table I, sec. V-D", printed, *runs.pairs(first, second), note=note)


def _from_afar(runs: IrTableRuns) -> Claim:
    low, high = (f"{100 * d:.0f}" for d in _PUBLISHED["closing_distance"])
    return majority_claim(
        f"Most grasps succeed that are closed without sensing from {low} to {high} cm.",
        "sec. V-D",
        "most",
        runs.count(FORWARD_35, False),
        "The paper does not say from which part of the hand it measures; here it is the palm, which in nominal poses "
        "is 35 mm off after 35 mm forward.",
    )


def _untouched(runs: IrTableRuns) -> Claim:
    touched, displaced = (
        np.concatenate([runs.of(REFLEX, p).metric(name) for p in POSES]) for name in ("touched", "displacement")
    )
    pushed = format_rate(int(np.sum(displaced >= _PUSHED)), len(displaced)) if len(displaced) else "none"
    return rare_claim(
        "The IR-guided hand does not touch the object before it closes.",
        "sec. I",
        "no premature contact",
        (int(np.sum(touched > 0.0)), len(touched)),
        f"The object was moved by {1000 * _PUSHED:g} mm or more in {pushed}.",
    )


def distance_claims(runs: IrTableRuns) -> list[Claim]:
    """Return the claims of table II."""
    return [
        _of_fingers(runs, _IN_COST, False, _TARGET_TAKEN),
        _of_fingers(runs, _IN_COST, True),
        _centred(runs),
        *(_of_fingers(runs, ("index",), perturbed, _IN_SPACE) for perturbed in POSES),
        _index_further(runs),
    ]


def _of_fingers(runs: IrTableRuns, fingers: Sequence[str], perturbed: bool, why_open: str = "") -> Claim:
    """Judge fingers' distances, of which the paper gives neither number nor spread; without a verdict if so said."""
    cells = [*product(OBJECTS, fingers)]
    theirs = [runs.published_distances(name, perturbed)[finger] for name, finger in cells]
    ours = [runs.distance(finger, perturbed, name) for name, finger in cells]
    who = f"the {fingers[0]} ends" if len(fingers) == 1 else f"{' and '.join(fingers)} end"
    sentence = f"In {POSES[perturbed]} poses {who} {_in_mm(theirs)} from the object."
    says, medians = Statement(sentence, "table II", _in_mm(theirs)), [float(np.median(x)) for x in ours if len(x)]
    measured = f"{_in_mm(medians)} (medians by object)" if medians else ""
    if why_open:
        return says.not_comparable(measured, why_open)
    if min(map(len, ours)) < _MIN_RUNS:
        return says.unknown(_TOO_FEW)
    spans = [np.percentile(x, _SPAN_OF_MOST_RUNS) for x in ours]
    inside = [bool(low <= x <= high) for x, (low, high) in zip(theirs, spans, strict=True)]
    low, high = _SPAN_OF_MOST_RUNS
    return says.judged(
        measured,
        all(inside),
        f"each of the six lies between the {low:g}th and {high:g}th percentile of our runs, so that it could be a "
        f"run's: {sum(inside)} of {len(inside)} do",
        "The paper says neither of how many runs its figures are nor how they spread.",
    )


def _centred(runs: IrTableRuns) -> Claim:
    rows = [runs.published_distances(name, p) for p, name in product(POSES, OBJECTS)]
    printed = [abs(row["thumb"] - row["ring"]) for row in rows]
    unlike = np.concatenate([np.abs(np.subtract(*runs.together(_IN_COST, p))) for p in POSES])
    unlike = unlike[np.isfinite(unlike)]  # of the runs in which both see the object
    says = Statement(
        "Thumb and ring are well centred with respect to the object.", "table II, sec. V-D", f"{_in_mm(printed)} apart"
    )
    interval = time_interval(unlike)
    if interval is None:
        return says.unknown(_TOO_FEW)
    return says.not_comparable(f"{1000 * float(np.median(unlike)):.1f} mm apart (median)", _ONE_TARGET, interval, "m")


def _index_further(runs: IrTableRuns) -> Claim:
    further: list[bool] = []
    for perturbed in POSES:
        index, *others = runs.together(("index", *_IN_COST), perturbed)
        farthest = np.maximum(*others)
        seen = np.isfinite(farthest)  # an index that sees nothing is further than fingers that see the object
        further += (np.isnan(index[seen]) | (index[seen] > farthest[seen])).tolist()
    says = Statement(
        "The index is always further from the object than thumb and ring, in most of the tasks.",
        "table II, sec. V-D",
        "in all rows",
    )
    count = sum(further), len(further)
    measured = f"{format_rate(*count)} of the runs" if further else ""
    return says.not_comparable(measured, _IN_SPACE, success_interval(*count) if further else None)


def _in_mm(values: Sequence[float]) -> str:
    return f"{span(1000 * np.asarray(values), '.0f')} mm"


def _successes(runs: IrTableRuns, perturbed: bool) -> ComparisonTable:
    def cells(thing: Thing | None) -> dict[str, str]:
        found: dict[str, str] = {}
        for arm in ARMS:
            ours, theirs = runs.count(arm, perturbed, thing), runs.published(arm, perturbed, thing)
            shown = with_interval if thing is None else _format_count
            apart = theirs is not None and ours[1] and two_proportions(*ours, *theirs) < LEVEL
            found |= {} if theirs is None else {f"{arm.title}, published": shown(theirs)}
            found[f"{arm.title}, ours"] = shown(ours) + (" *" if apart else "")
        return found

    rows = [
        *({"object": title, **cells(thing)} for thing, title in _TITLES.items()),
        {"object": "total", **cells(None)},
    ]
    stars = f" A star: Fisher's exact test rejects equality at {format_share(LEVEL)}, of each cell by itself."
    ours, theirs = runs.count(REFLEX, perturbed), runs.published(REFLEX, perturbed) or (0, 0)
    easier = ours[0] * theirs[1] > theirs[0] * ours[1]
    return table_of(
        f"Table I, {POSES[perturbed]} poses: successful grasps",
        rows,
        "Intervals by Clopper and Pearson, 95 %; all runs of an arm count in the total."
        + (stars if any(text.endswith("*") for row in rows for text in row.values()) else "")
        + " The forward arms are a control that the paper does not have."
        + (" That our IR-guided hand succeeds more often indicates an easier task." if easier else "")
        + runs.unfinished,
    )


def _format_count(count: Count) -> str:
    return f"{count[0]}/{count[1]}" if count[1] else ""


def _tested(runs: IrTableRuns, first: Way, second: Way) -> dict[str, str]:
    pairs = runs.pairs(first, second)
    test = paired_test(*pairs)
    names = [f"{arm.title}, {POSES[perturbed]}" for arm, perturbed in (first, second)]
    return {
        "first": names[0],
        "second": names[1],
        "pairs": str(len(pairs[0])),
        "only the first held": str(test.only_first),
        "only the second held": str(test.only_second),
        "p": format_p_value(test.p),
    }


def _closed(runs: IrTableRuns, arm: Arm, perturbed: bool) -> dict[str, str]:
    found = runs.of(arm, perturbed)
    stops = Counter(Stop(int(s)).name.lower().replace("_", " ") for s in found.metric("stop"))
    displaced = 1000 * found.metric("displacement")
    most = f"{np.median(displaced):.1f}, {np.max(displaced):.1f}" if len(displaced) else ""
    return {
        "arm": f"{arm.title}, {POSES[perturbed]}",
        "why it closed": ", ".join(f"{n} {stop}" for stop, n in stops.most_common()),
        "steps": format_median(found.metric("steps"), 0),
        "time (s)": format_median(found.metric("refinement_time"), 1),
        "object displaced: median, most (mm)": most,
    }


def _distances(runs: IrTableRuns, name: str, perturbed: bool) -> dict[str, str]:
    row, found = {"object": name.replace("_", " ")}, runs.of(REFLEX, perturbed, OBJECTS[name])
    for finger, printed in runs.published_distances(name, perturbed).items():
        ours = 1000 * runs.distance(finger, perturbed, name)
        unseen = f"not seen in {len(found) - len(ours)}" if len(found) > len(ours) else ""
        row[f"{finger}, published"] = f"{1000 * printed:.0f}"
        row[f"{finger}, ours"] = "; ".join(text for text in (format_median(ours, 1), unseen) if text)
        row[f"{finger}, true"] = number(1000 * found.metric(f"true_distance_{finger}"))
    return row


def _nearer_than_measured(runs: IrTableRuns, perturbed: bool) -> str:
    """Say in how many runs a finger is so near that its reading falls again, and so is taken for a larger distance."""
    nearest = _PUBLISHED["sensor_range"][0]
    found = runs.of(REFLEX, perturbed).where(lambda row: row["stop"] == Stop.THRESHOLD)
    true = [[row.get(f"true_distance_{finger}") for finger in _IN_COST] for row in found]
    nearer = sum(any(d is not None and d < nearest for d in distances) for distances in true)
    return (
        f"In {nearer} of {counted(len(found), 'run')} that ended by the threshold, thumb or ring is truly nearer than "
        f"{1000 * nearest:g} mm, where readings fall again."
    )


def _panel_of_rates(runs: IrTableRuns, perturbed: bool) -> Panel:
    marks: list[Mark] = []
    for n, arm in enumerate(ARMS):
        theirs = runs.published(arm, perturbed)
        shift = 0.0 if theirs is None else 0.13
        for count, x, form, colour, label in (
            (runs.count(arm, perturbed), n - shift, "o", COLOURS[0], "ours"),
            (theirs or (0, 0), n + shift, "s", COLOURS[1], "published"),
        ):
            if count[1]:
                interval, rate = success_interval(*count), 100 * count[0] / count[1]
                reach = [[rate - 100 * interval.low], [100 * interval.high - rate]]
                marks.append(Mark([x], [rate], form, colour, label, bars=reach, style={"ms": 6}))
    ticks = {float(n): arm.title.replace("forward ", "forward\n") for n, arm in enumerate(ARMS)}
    axes = {"title": f"{POSES[perturbed]} poses", "ylabel": "successful grasps (%)", "ylim": (-3, 103)}
    return Panel(marks, {**axes, "xlim": (-0.5, len(ARMS) - 0.5)}, ticks)


def _panel_of_distances(runs: IrTableRuns, perturbed: bool) -> Panel:
    marks: list[Mark] = []
    hollow = {"ms": 7, "mfc": "none", "mew": 1.6}
    for (n, name), (i, finger) in product(enumerate(OBJECTS), enumerate(FINGER_NAMES)):
        x, ours = n + 0.27 * (i - 1), 1000 * runs.distance(finger, perturbed, name)
        across = x + 0.16 * (np.linspace(0.0, 1.0, len(ours)) - 0.5)
        marks.append(Mark(across, ours, ".", FINGER_COLOURS[i], style={"ms": 3, "alpha": 0.5}))
        printed = 1000 * runs.published_distances(name, perturbed)[finger]
        marks.append(Mark([x], [printed], "s", FINGER_COLOURS[i], style=hollow))
    marks += [Mark(form=".", colour=FINGER_COLOURS[i], label=f, style={"ms": 8}) for i, f in enumerate(FINGER_NAMES)]
    marks.append(Mark(form="s", label="published", style=hollow))
    ticks = {float(n): name.replace("_", " ") for n, name in enumerate(OBJECTS)}
    axes = {"title": f"{POSES[perturbed]} poses", "ylabel": "distance at the last step (mm)", "ylim": (0, 68)}
    return Panel(marks, {**axes, "xlim": (-0.5, len(OBJECTS) - 0.5)}, ticks)
