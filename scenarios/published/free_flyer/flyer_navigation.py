"""What errors of the free-flyer's navigation do to its handovers, one at a time (beyond [Fernandes2020])."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from scipy.stats import chi

from handover.controllers.free_flyer.handover_parameters import Params as DecisionParams
from handover.controllers.free_flyer.sampled_loop import largest_stable
from handover.cosim.blocks.ports import Floats
from handover.plants.free_flyer.robot.thrusters import Params as ThrustersParams
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.plotting import COLOURS
from handover.scenarios.published.claims import Statement
from handover.scenarios.published.figures import Mark, Panel, drawn
from handover.scenarios.published.free_flyer.handovers import (
    PATIENCE,
    TASKS,
    USUAL,
    Variation,
    acted_alone,
    every_of,
    succeeded_touched,
    touched,
    unfinished_note,
)
from handover.scenarios.published.free_flyer.linear_model import linear_loop
from handover.scenarios.published.published_experiment import Claim, ComparisonTable, PublishedExperiment
from handover.scenarios.published.runs import Runs, is_known
from handover.scenarios.published.tables import number, of, table_of
from handover.scenarios.published.verdicts import (
    every_claim,
    format_interval,
    format_p_value,
    format_rate,
    format_share,
)
from handover.scenarios.robots.free_flyer.handover.handovers import HandoverOfTask
from handover.scenarios.robots.free_flyer.handover.person_evaluation import Cause
from handover.scenarios.robots.free_flyer.parameters import Behaviour, Task
from handover.scenarios.runs.campaign.plan import CampaignPlan
from handover.scenarios.runs.campaign.statistics import LEVEL, success_interval, two_proportions
from handover.scenarios.runs.campaign.table import CampaignTable

_REPETITIONS = 3
_MIN_RUNS, _MIN_LATE = 20, 4
"""Runs of which something is concluded that a model predicts, or that never happens; and of an unstable loop."""
_DRIFT_TIME = 10.0
"""Correlation time of drifts, s: of the order of a transfer (assumed)."""
_TRIED = (Task.ROBOT_TO_HUMAN, Task.HUMAN_TO_ROBOT)


@dataclass(frozen=True)
class EstimateError:
    """Something that is wrong with the navigation's estimate, at several levels up to where handovers fail.

    Attributes:
        label: what, in words.
        parameter: of the navigation's unit.
        levels: in SI units, from the mildest on.
        unit: in which levels are shown, as elsewhere on the pages: m/s and rad/s, but mm and degrees.
        scale: how many of it one SI unit is.
        others: parameters of the unit that go with it, as texts.
    """

    label: str
    parameter: str
    levels: tuple[float, ...]
    unit: str
    scale: float = 1.0
    others: dict[str, str] = field(default_factory=dict[str, str], hash=False)

    def variation(self, level: float) -> Variation:
        """Return the navigation with the error at a level."""
        given = {f"navigation.{self.parameter}": f"{level:g}", **self.others}
        space = "" if self.unit == "°" else " "
        return Variation(f"{self.label} {self.scale * level:.3g}{space}{self.unit}", given)


_DRIFTS = {"navigation.drift_time": f"{_DRIFT_TIME:g}"}
DELAY = EstimateError("delay", "delay", (0.016, 0.032, 0.064, 0.128), "ms", 1e3)
VELOCITY_BIAS = EstimateError("bias of velocity", "velocity_bias", (0.002, 0.004, 0.008, 0.016), "m/s")
_POSITION_BIAS = EstimateError("bias of position", "position_bias", (0.005, 0.01, 0.02, 0.04), "mm", 1e3)
ESTIMATE_ERRORS = (
    _POSITION_BIAS,
    EstimateError("bias of attitude", "attitude_bias", (0.02, 0.05, 0.1), "°", 180.0 / np.pi),
    VELOCITY_BIAS,
    EstimateError("bias of rate", "rate_bias", (0.01, 0.03, 0.1), "rad/s"),
    EstimateError("drift of position", "position_drift", (0.01, 0.03, 0.1), "mm", 1e3, _DRIFTS),
    EstimateError("drift of velocity", "velocity_drift", (0.003, 0.01, 0.03), "m/s", others=_DRIFTS),
    EstimateError("updates", "update_rate", (10.0, 5.0, 2.0, 1.0), "Hz"),
    DELAY,
)
"""One at a time, with the usual noise besides. Biases and drifts are deviations, each axis drawn by itself."""
VARIATIONS = tuple(error.variation(level) for error in ESTIMATE_ERRORS for level in error.levels)


class FlyerNavigation(PublishedExperiment):
    """Both behaviours give and receive with a navigation that is biased, drifts, or comes seldom or late.

    One error at a time, at three or four levels up to where handovers fail, three runs each; every run draws its own
    bias. The controllers know nothing of it: a delay that they knew would be refused where their loop is not
    stable. The thesis says nothing of its navigation's errors. The quick plan is the greatest level of each, once.
    """

    name: ClassVar[str] = "flyer-navigation"
    title: ClassVar[str] = "a free-flyer with errors in its navigation hands over (beyond [Fernandes2020] sec. 4.1.2)"
    scenario: ClassVar[str] = HandoverOfTask.name

    def plan(self, quick: bool) -> CampaignPlan:
        """Return errors x levels x tasks x behaviours; if quick, the greatest level of each, of the rigid robot."""
        tried = [e.variation(e.levels[-1]) for e in ESTIMATE_ERRORS] if quick else VARIATIONS
        behaviours = [Behaviour.RIGID] if quick else list(Behaviour)
        points = [
            {"task": task.item, "behaviour": b.item, **v.parameters}
            for v, task, b in product((USUAL, *tried), _TRIED, behaviours)
        ]
        return self.campaign(points, fixed={"patience": PATIENCE}, repetitions=1 if quick else _REPETITIONS, seed=412)

    def claims(self, table: CampaignTable) -> Sequence[Claim]:
        """Judge, beyond the thesis, where models of gate and loop say what is to come out."""
        runs = self.runs(table, is_known)
        usual = _of(runs, USUAL)
        delays = [_delay(runs, b, stable) for b in Behaviour for stable in (True, False)]
        return [
            _estimate(usual),
            every_claim("With the assumed noise alone every handover succeeds", "", (0, 0), succeeded_touched(usual),
                        unfinished_note(usual)),
            _velocity_bias(runs),
            *(claim for claim in delays if claim is not None),
            _fetching(runs),
            _alone({v.label: _of(runs, v) for v in VARIATIONS}),
        ]  # fmt: skip

    def tables(self, table: CampaignTable) -> Sequence[ComparisonTable]:
        """Return successes, false releases, displacement and time by error and level."""
        runs = self.runs(table, is_known)
        rows = [row for v in (Variation("as usual"), *VARIATIONS) if (row := _row(runs, v))]
        note = (
            "Successes of runs of both behaviours, with their interval (Clopper-Pearson). A run in which the robot "
            "acted with nobody at the gripper is no success. Changed hands: runs in which the object did, even if the "
            "robot then never came to rest where it retreats to. Displacement and time are medians, giving and "
            "receiving, without the runs in which it acted alone. Where handovers failed, the last column has what "
            f"decided most. Drifts have a correlation time of {_DRIFT_TIME:g} s."
        )
        return [table_of("Errors of the navigation", rows, note)] if rows else []

    def draw(self, table: CampaignTable, runs: Path, folder: Path) -> Sequence[Figure]:  # noqa: ARG002
        """Draw success, displacement and time by level, a panel for each error."""
        found = self.runs(table, is_known)
        shown = [e for e in ESTIMATE_ERRORS if sum(len(_of(found, e.variation(x))) > 0 for x in e.levels) > 1]
        rows = (len(shown) + 3) // 4
        figures: list[Figure] = []
        for metric, label, scale, what in (
            ("success", "succeeded (%)", 100.0, "Share of handovers that succeed"),
            ("displacement", "gripper went (mm)", 1e3, "How far the gripper goes while the robot yields (means)"),
            ("time", "time (s)", 1.0, "Time from the signal until the receiver has the object (means)"),
        ):
            panels = [_panel(found, error, metric, label, scale) for error in shown]
            caption = f"{what}, by errors of the navigation, one at a time; biases and drifts are deviations."
            size = (10.0, 0.7 + 2.3 * rows)
            figures += drawn(folder / f"navigation_{metric}", caption, panels, 4, size=size)
        return figures


def _of(
    runs: Runs, variation: Variation, tasks: Sequence[Task] = _TRIED, behaviours: Sequence[Behaviour] = tuple(Behaviour)
) -> Runs:
    cases = product(tasks, behaviours)
    return runs.of(*({"task": t.item, "behaviour": b.item, **variation.parameters} for t, b in cases))


def _signalled(runs: Runs) -> int:
    """Return in how many runs the robot found rest in its place and signalled."""
    return sum(row.get("phase_signal") is not None for row in runs)


def rest_probability(deviation: float) -> float:
    """Return how likely a velocity's bias is small enough for a robot at rest to see itself at rest.

    At rest the robot sees the bias, three independent Gaussian components of a deviation, m/s, as its speed, which
    must be below the state machine's `gate_speed`: the length of such a vector has the chi distribution of three
    degrees of freedom. Noise is left out: the speed is low-passed.
    """
    return float(chi.cdf(float(DecisionParams().gate_speed) / deviation, 3))


def count_probability(count: int, chances: Sequence[float]) -> float:
    """Return the exact p-value, two-sided, of a count of independent events of given chances.

    It is the probability of all counts that are no likelier than this one.
    """
    law: Floats = np.ones(1)
    for chance in chances:
        law = np.convolve(law, [1.0 - chance, chance])
    return min(float(law[law <= law[count] * (1.0 + 1e-9)].sum()), 1.0)


def _estimate(runs: Runs) -> Claim:
    says = Statement(
        "The robot's own filter estimates its pose and velocity well enough for handovers",
        "secs. 4.1.1, 4.1.2, 4.3",
        "all handovers succeed, in its simulation",
    )
    if not len(runs):
        return says.unknown()
    return says.not_comparable(
        f"{format_rate(*succeeded_touched(runs))} with the assumed noise",
        "The thesis gives no figure of its filter's errors: noise, biases, drifts and delays are assumed here.",
    )


def _velocity_bias(runs: Runs) -> Claim:
    says = Statement(
        "A robot whose velocity is biased signals as often as its bias is below the speed that counts as rest"
    )
    found = {x: _of(runs, VELOCITY_BIAS.variation(x), (Task.HUMAN_TO_ROBOT,)) for x in VELOCITY_BIAS.levels}
    chances = [rest_probability(x) for x, of_level in found.items() for _ in of_level]
    if not chances:
        return says.unknown()
    count = sum(map(_signalled, found.values()))
    p = count_probability(count, chances)
    each = ", ".join(
        f"{_signalled(r)} of {len(r)} at {x:g} m/s ({format_share(rest_probability(x))})"
        for x, r in found.items()
        if len(r)
    )
    return says.judged(
        f"{count} of {len(chances)}, expected {sum(chances):.1f}",
        p >= LEVEL,
        f"an exact test of the count, of robots that receive, does not reject at {format_share(LEVEL)} that each "
        f"signals with the probability that three Gaussian components are below the gate: p = {format_p_value(p)}",
        f"By deviation, with that probability: {each}.",
        runs=(len(chances), _MIN_RUNS),
    )


@cache
def _greatest_delay(behaviour: Behaviour) -> float:
    """Return about the largest delay, s, with which the linear loop with the propulsion's lag is stable."""
    lag = float(ThrustersParams().lag)
    return largest_stable(lambda delay: linear_loop(behaviour, lag, round(delay, 6)).pole_radius, upper=0.3, steps=12)


def _delay(runs: Runs, behaviour: Behaviour, stable: bool) -> Claim | None:
    """Judge the delays with which a behaviour's loop is stable, or is not; None if there are no such delays."""
    most = _greatest_delay(behaviour)
    levels = [x for x in DELAY.levels if (x < most) is stable]
    if not levels:
        return None
    found = every_of([_of(runs, DELAY.variation(x), behaviours=(behaviour,)) for x in levels])
    tried = ", ".join(f"{1e3 * x:g}" for x in levels)
    note = f"By its poles it is stable up to {1e3 * most:.0f} ms; tried {tried} ms, unknown to it."
    if stable:
        claim = f"With an old estimate, at which its loop is stable by its poles, the {behaviour.item} robot hands over"
        return every_claim(claim, "", (0, 0), succeeded_touched(found), f"{note} {unfinished_note(found)}")
    says = Statement(f"An old estimate, at which its loop is unstable by its poles, makes the {behaviour.item} robot "
                     "fail")  # fmt: skip
    if not len(found):
        return says.unknown()
    limited, failed = found.metric("saturated_share"), len(found) - succeeded_touched(found)[0]
    share = format_share(float(limited.mean())) if len(limited) else "an unknown part"
    return says.judged(
        f"{format_rate(failed, len(found))} failed",
        2 * failed > len(found),
        "more than half of the runs fail",
        f"{note} Limits of thrust, at which it was for {share} of the time, keep a growing oscillation small. "
        f"{unfinished_note(found)}",
        runs=(len(found), _MIN_LATE),
    )


def _fetching(runs: Runs) -> Claim:
    says = Statement(
        "A biased position costs handovers where the robot fetches the object, not where a person brings it"
    )
    levels = [_POSITION_BIAS.variation(x) for x in _POSITION_BIAS.levels]
    gives, receives = (every_of([_of(runs, v, (task,)) for v in levels]) for task in _TRIED)
    if not len(gives) or not len(receives):
        return says.unknown()
    (k, n), (j, m) = succeeded_touched(gives), succeeded_touched(receives)
    p = two_proportions(k, n, j, m)
    return says.judged(
        f"{format_rate(k, n)} against {format_rate(j, m)} succeeded",
        p < LEVEL and k / n < j / m,
        f"Fisher's exact test rejects at {format_share(LEVEL)} that both succeed equally often, and those that fetch "
        f"succeed less often: p = {format_p_value(p)}",
        "The gripper's place in the world is off by the bias, which a person sees and a free object does not heed. "
        f"{unfinished_note(gives.together_with(receives))}",
        runs=(min(n, m), _MIN_RUNS),
    )


def _alone(found: dict[str, Runs]) -> Claim:
    says = Statement("No error of the navigation makes the robot let go, or close, with nobody at the gripper")
    runs = every_of([*found.values()])
    if not len(runs):
        return says.unknown()
    where = ", ".join(f"{n} of {len(r)} with {what}" for what, r in found.items() if (n := acted_alone(r)))
    return says.judged(
        f"{acted_alone(runs)} of {len(runs)} did, and {_signalled(runs)} came to signal",
        not acted_alone(runs),
        "none did",
        "A robot that never finds rest never signals, and says nothing of it. "
        f"{f'It did: {where}. ' if where else ''}{unfinished_note(runs)}",
        runs=(_signalled(runs), _MIN_RUNS),
    )


def _row(runs: Runs, variation: Variation) -> dict[str, str]:
    """Return a row of the table; {} without runs."""
    by_task = {task: _of(runs, variation, (task,)) for task in _TRIED}
    found = every_of([*by_task.values()])
    if not len(found):
        return {}
    decided = [Cause(int(row["decided_by"])) for row in found.failed]
    cause = max(set(decided), key=lambda c: (decided.count(c), -c)).words if decided else ""
    return {
        "navigation": variation.label,
        **{TASKS[task]: _share(of_task) for task, of_task in by_task.items()},
        "changed hands": of((int((found.metric("handed_over") > 0).sum()), len(found))),
        "signalled": of((_signalled(found), len(found))),
        "acted alone": str(acted_alone(found)),
        "displacement, mm": _medians(by_task, "transfer_displacement", 1e3, ".0f"),
        "time, s": _medians(by_task, "transfer_time", 1.0, ".1f"),
        "fails mostly by": cause,
    }


def _share(runs: Runs) -> str:
    if not len(runs):
        return ""
    interval = success_interval(*succeeded_touched(runs))
    return f"{of(succeeded_touched(runs))} ({format_interval(interval.low, interval.high)})"


def _medians(by_task: dict[Task, Runs], metric: str, scale: float, form: str) -> str:
    found = [scale * touched(runs).metric(metric) for runs in by_task.values()]
    return " and ".join(number(x, form) or "none" for x in found) if any(map(len, found)) else "–"


def _panel(runs: Runs, error: EstimateError, metric: str, label: str, scale: float) -> Panel:
    """Draw a metric's means over the runs that have it, or successes of all, by level.

    Runs in which the robot acted alone have no part in the means, and are no success.
    """
    marks: list[Mark] = []
    for k, (task, b) in enumerate(product(_TRIED, Behaviour)):
        points: list[tuple[float, float]] = []
        for x in error.levels:
            found = _of(runs, error.variation(x), (task,), (b,))
            values = touched(found).metric(f"transfer_{metric}")
            if metric == "success":
                values = np.array([float(succeeded_touched(Runs([row], {}))[0]) for row in found])
            mean = float(values.mean()) if len(values) else np.nan
            points.append((1.03 ** (2 * k - 3) * error.scale * x, scale * mean))
        form = "o-" if task is Task.ROBOT_TO_HUMAN else "o--"
        marks.append(Mark.through(points, form, COLOURS[b], f"{TASKS[task]}, {b.item}"))
    highest = max((float(y) for m in marks for y in np.asarray(m.y) if y == y), default=0.0)
    top = 100.0 if metric == "success" else max(highest, 1e-9)
    ticks = {error.scale * x: f"{error.scale * x:.3g}" for x in error.levels}
    limits = (min(ticks) / 1.3, 1.3 * max(ticks))
    axes: dict[str, Any] = {"xlabel": f"{error.label} ({error.unit})", "ylabel": label, "xscale": "log"}
    axes |= {"xlim": limits[::-1] if error.parameter == "update_rate" else limits}
    return Panel(marks, {**axes, "ylim": (-0.04 * top, 1.08 * top)}, ticks)
