"""The validation of the free-flyer's handovers: [Fernandes2020] sec. 4.3, figs. 4.29 to 4.38."""

from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import ClassVar

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.paper import paper_values
from handover.scenarios.published.claims import Statement
from handover.scenarios.published.free_flyer.flyer_handover_figures import draw_handovers, figure_number
from handover.scenarios.published.free_flyer.handovers import (
    EXACT,
    EXCHANGES,
    GIVING,
    PATIENCE,
    RECEIVING,
    USUAL,
    Exchange,
    Variation,
    acted_alone,
    every_of,
    factor_of,
    published,
    unfinished_note,
)
from handover.scenarios.published.published_experiment import Claim, ComparisonTable, PublishedExperiment
from handover.scenarios.published.runs import Point, Runs, is_done, is_known
from handover.scenarios.published.tables import number, of, span, table_of
from handover.scenarios.published.verdicts import every_claim
from handover.scenarios.robots.free_flyer.handover.handovers import HandoverOfTask
from handover.scenarios.robots.free_flyer.parameters import Behaviour, Propulsion, Task, TaskParameters
from handover.scenarios.runs.campaign.plan import CampaignPlan
from handover.scenarios.runs.campaign.table import CampaignTable

THRUSTS = (Propulsion.IDEAL, Propulsion.LIMITED, Propulsion.NOZZLES)
"""The thesis's pushes need the first; Astrobee's limits are those of each axis, or of twelve nozzles that share."""

_RATE = "handover.controllers.free_flyer.published_rate"
AT_PUBLISHED_RATE = {
    "decision": f"{_RATE}:HandoverStateMachine67",
    "impedance": f"{_RATE}:ImpedanceController67",
    "pose": f"{_RATE}:PoseController67",
}
"""The units on the robot's computer that run at the thesis's 67.5 Hz, by the places that they take."""
_OF_HAND = ("tremor_rms", "drift_rms", "reaction_spread", "timing_error", "effort_spread")
_WITHOUT_CHANCE = {
    **EXACT,
    **dict.fromkeys(("sight_error", "depth_error"), "0"),
    **{f"person.{what}": "0" for what in _OF_HAND},
}
"""Parameters of a navigation without noise, and of a hand that does not shake, sees and times without error, always
reacts in the same time and pulls with the same effort."""

_USUAL_FORCE = f"{TaskParameters().strength:g} N"
"""Force with which the scenario's person pulls at most, in words."""
STRENGTHS = tuple(Variation(f"{n:g} N", {"strength": f"{n:g}"}) for n in (0.3, 0.5, 1.0, 2.0, 8.0))
"""Persons who pull with other forces than the default's at most."""
ARMS = tuple(
    Variation(v.label, {**v.parameters, "model_arm_factor": v.parameters["arm_factor"]})
    for v in (factor_of("arm", "arm_factor", k) for k in (0.5, 1.5))
)
"""Robots with arms of other lengths, which their controllers know."""
PLACES = tuple(
    Variation(f"at ({place.replace(',', ', ')}) m", {"p_WG_handover": place})
    for place in ("0.2,-0.07,0", "0,-0.3,0", "0,-0.07,0.3")
)
UNGATED = tuple(
    Variation(f"within {100 * d:g} cm", {"gated": "false", "decision.gate_error": f"{d:g}"}) for d in (0.05, 0.1, 0.2)
)
"""Robots that yield and signal while they still move, as soon as they are so near their place."""
RATES = (Variation("62.5 Hz", _WITHOUT_CHANCE), Variation("67.5 Hz", {**_WITHOUT_CHANCE, **AT_PUBLISHED_RATE}))
"""Astrobee's rate of control, and that which the thesis prints; nothing is random in either."""

_REPETITIONS = 3
_SAME = 0.001
"""Displacement by which the rate of control may make a difference, m: what is expected of it."""
_MIN_FREE = 4
"""Runs without a gate of which something is concluded."""
_DIFFERING_RATIO = 1.5
"""Compliant over rigid displacement from which on the behaviours differ."""


def point_of(task: Task, behaviour: Behaviour, propulsion: Propulsion, variation: Variation = USUAL) -> Point:
    """Return the parameters of a handover, as texts."""
    given = {"task": task.item, "behaviour": behaviour.item, "propulsion": propulsion.item}
    return {**given, **variation.parameters}


class FlyerHandoverTable(PublishedExperiment):
    """The four handovers by the rigid and by the compliant robot, with ideal thrust, Astrobee's limits and its nozzles.

    Where the robot gives, there are besides persons who pull with other forces, arms of other lengths, other places.
    Where it gives or receives, there is the control rate that the thesis prints. There is also a robot that yields
    while it still moves, for the thesis names no condition of rest. The quick plan is one run of each of the first 24.
    """

    name: ClassVar[str] = "flyer-handover"
    title: ClassVar[str] = "a free-flyer and a person hand an object over ([Fernandes2020] secs. 4.1.2, 4.3)"
    scenario: ClassVar[str] = HandoverOfTask.name

    def plan(self, quick: bool) -> CampaignPlan:
        """Return tasks x behaviours x propulsion, and what is beyond the thesis; if quick, the first alone."""
        limited, gives, receives = (Propulsion.LIMITED,), (GIVING.task,), RECEIVING.task
        groups = [
            [(t, b, p, USUAL) for t, b, p in product(Task, Behaviour, THRUSTS)],
            [(t, b, p, v) for t, v, p, b in product(gives, STRENGTHS, THRUSTS, Behaviour)],
            [(t, b, p, v) for t, v, p, b in product(gives, (*ARMS, *PLACES), limited, Behaviour)],
            [(t, b, p, v) for t, v, p, b in product((*gives, receives), (*UNGATED, *RATES), limited, Behaviour)],
        ]
        return self.campaign(
            [point_of(*case) for group in (groups[:1] if quick else groups) for case in group],
            fixed={"patience": PATIENCE},
            repetitions=1 if quick else _REPETITIONS,
            seed=1,
            paired=True,
            varied_units=() if quick else tuple(AT_PUBLISHED_RATE),
        )

    def claims(self, table: CampaignTable) -> Sequence[Claim]:
        """Judge secs. 4.1.2 and 4.3, and beyond them what the gate is for."""
        runs = HandoverRuns(table)
        given, failed = runs.usual(Task.ROBOT_TO_HUMAN, Task.HUMAN_TO_ROBOT), runs.usual(Task.FAILED_RECEPTION)
        return [
            every_claim(
                "The robot gives and receives an object with either behaviour",
                "sec. 4.3, figs. 4.29 to 4.36",
                (4, 4),
                given.count,
                f"With ideal thrust, Astrobee's limits of each axis, and its nozzles. {unfinished_note(given)}",
            ),
            every_claim(
                "A push without the object is noticed by the gripper's angle, and the robot asks again",
                "sec. 4.3.2, figs. 4.37, 4.38",
                (1, 1),
                failed.count,
                f"A success is a failed reception that the robot noticed, and then one. {unfinished_note(failed)}",
            ),
            *(_threshold(runs, exchange, b) for exchange in (GIVING, RECEIVING) for b in Behaviour),
            _angle(runs),
            _displacement(runs),
            _ten_times(runs),
            _twice(runs),
            _timing(
                "The robot has the object after {:g} s", "sec. 4.3.1", published("fetched"),
                runs.usual(Task.ROBOT_TO_HUMAN).metric("phase_move_to_handover"),
                "the object's first place is not stated, and was chosen such that it takes about as long",
            ),
            _timing(
                "The first, false reception begins after {:g} s", "sec. 4.3.2", published("failed_reception"),
                failed.metric("phase_close_gripper"),
                "the user begins it at a time of their own; here the person reacts to the light",
            ),
            _limits_hide(runs),
            _gate(runs),
            _rate(runs),
        ]  # fmt: skip

    def tables(self, table: CampaignTable) -> Sequence[ComparisonTable]:
        """Return transfers, margins of the thresholds, and what force, arm, place, gate and rate change."""
        runs = HandoverRuns(table)
        cases = [
            (e, b, p, found)
            for e, b, p in product(EXCHANGES, Behaviour, THRUSTS)
            if len(found := runs.of(e.task, b, p))
        ]
        varied = {f"as usual, {_USUAL_FORCE}": USUAL, **{v.label: v for v in (*STRENGTHS, *ARMS, *PLACES)}}
        rows = [row for (label, v), p in product(varied.items(), THRUSTS) if (row := _varied(runs, label, v, p))]
        beta = np.degrees(published("angle_threshold"))
        exchanges = [*product((GIVING, RECEIVING), Behaviour)]
        tables = [
            table_of("Transfers", [_transfer(*case) for case in cases], _NOTE_ON_TRANSFERS),
            table_of(
                "Margins of the thresholds",
                [_margin(*case) for case in cases],
                "Speeds of the gripper as the robot sees it: the greatest while it waits and nobody touches it, and "
                "those at which it took its motion for a touch. Angles of the closed gripper with the object and "
                f"without, which the robot separates at {beta:.1f}°; what they are is assumed here.",
            ),
            table_of(
                "Where the behaviours differ, as the robot gives",
                rows if any(not row["case"].startswith("as usual") for row in rows) else [],
                "How often the robot took a motion for the pull of a person who pulls with at most that force, how "
                "often the handover succeeded, and, of those, medians along z. Published: 40 and 140 mm, 3.5 times as "
                "far. Shares of the run at the limits of thrust: rigid and compliant.",
            ),
            table_of(
                "Without a gate to the impedance control",
                [row for e, b in exchanges if (row := _ungated(runs, e, b))[UNGATED[-1].label]],
                "How many robots let go, or closed, with nobody at the gripper: those that yield and signal only at "
                "rest in their place, and those that do so as soon as they are so near it, still moving. Astrobee's "
                "software takes 10 to 20 cm for having arrived; the thesis names no condition.",
            ),
            table_of(
                "Control at the rate that the thesis prints",
                [row for e, b in exchanges if (row := _of_rates(runs, e, b))],
                "How far the gripper went from its place at most, with Astrobee's limits, in a run in which nothing is "
                "random. Robot to human the gripper goes on until it has opened, so a release that comes a sample "
                "later adds what it moves in that time.",
            ),
        ]
        return [t for t in tables if t.rows]

    def draw(self, table: CampaignTable, runs: Path, folder: Path) -> Sequence[Figure]:
        """Draw figs. 4.29 to 4.38, the gripper beside python-control's, margins, and displacement by force."""
        found = HandoverRuns(table)
        strengths = {TaskParameters().strength: USUAL, **{float(v.parameters["strength"]): v for v in STRENGTHS}}
        return draw_handovers(found.of, THRUSTS, dict(sorted(strengths.items())), runs, folder)


class HandoverRuns:
    """Runs of the campaign by what they are for, those that did not come to their end as well.

    Such a run has no metrics and is not a success: whatever counts successes counts it as a failure.
    """

    def __init__(self, table: CampaignTable) -> None:
        self._runs = FlyerHandoverTable().runs(table, is_known)

    def of(
        self,
        task: Task,
        behaviour: Behaviour,
        propulsion: Propulsion = Propulsion.LIMITED,
        variation: Variation = USUAL,
    ) -> Runs:
        """Return the runs of a task, in the order of their repetitions."""
        return self._runs.of(point_of(task, behaviour, propulsion, variation))

    def usual(self, *tasks: Task) -> Runs:
        """Return the runs of tasks, or of all, with the scenario's own values, whatever behaviour and propulsion."""
        return self._runs.of(*(point_of(*case) for case in product(tasks or Task, Behaviour, THRUSTS)))

    def medians(self, exchange: Exchange, metric: str, propulsion: Propulsion, variation: Variation = USUAL) -> Floats:
        """Return the medians of a metric for the rigid and the compliant robot; none without both."""
        found = [exchange.of(self.of(exchange.task, b, propulsion, variation), metric) for b in Behaviour]
        return np.array([np.median(x) for x in found] if all(map(len, found)) else [])

    def ratios(self, exchange: Exchange, metric: str) -> dict[Propulsion, float]:
        """Return the compliant robot's median over the rigid one's, by propulsion."""
        found = {p: self.medians(exchange, metric, p) for p in THRUSTS}
        return {p: float(away[1] / away[0]) for p, away in found.items() if len(away)}

    def by_force(self, felt: bool = True, variations: Sequence[Variation] = (USUAL, *STRENGTHS)) -> dict[str, Floats]:
        """Return both behaviours' medians along z as the robot gives, m, for each force of the pull and each thrust.

        They are those of forces that both robots felt in all runs; or those that one of them did not, in any.
        """
        found: dict[str, Floats] = {}
        for v, p in product(variations, THRUSTS):
            away = self.medians(GIVING, "displacement_z", p, v)
            runs = every_of([self.of(GIVING.task, b, p, v) for b in Behaviour])
            if len(away) and (len(GIVING.of(runs, "speed")) == len(runs)) is felt:
                found[f"{p.item}, {v.label or _USUAL_FORCE}"] = away
        return found


def _threshold(runs: HandoverRuns, exchange: Exchange, behaviour: Behaviour) -> Claim:
    alpha = exchange.threshold(behaviour)
    what = "is pulled" if exchange.gives else "is given an object"
    says = Statement(
        f"By a speed of {alpha:g} m/s the {behaviour.item} robot knows that it {what}", "sec. 4.1.2", f"{alpha:g} m/s"
    )
    same = [e for e in EXCHANGES if e.gives is exchange.gives]
    found = [(e, runs.of(e.task, behaviour, p)) for e, p in product(same, THRUSTS)]
    ungated = {v.label: runs.of(exchange.task, behaviour, variation=v) for v in UNGATED}
    gated, free = every_of([of_case for _, of_case in found]), every_of([*ungated.values()])
    if not len(gated):
        return says.unknown()
    rest = np.concatenate([e.of(of_case, "rest_speed") for e, of_case in found])
    felt = sum(len(e.of(of_case, "speed")) for e, of_case in found)
    counts = ", ".join(f"{acted_alone(r)} of {len(r)} {label}" for label, r in ungated.items() if len(r))
    return says.judged(
        f"acted untouched in {acted_alone(free)} of {len(free)} as it arrived; at rest "
        f"{rest.max(initial=0.0):.4f} m/s at most, and felt in {felt} of {len(rest)}",
        acted_alone(free) == 0 and all(map(is_done, [*gated, *free])) and felt == len(rest),
        "without a gate it never acts before it is touched, and at rest it feels the person whenever it has signalled",
        "The thesis names no condition of rest, and a gate that waits for it would keep the speed below any threshold. "
        f"Untouched it acted in {counts or 'no run, for there is none'}; behind the gate in {acted_alone(gated)} of "
        f"{len(gated)}. {unfinished_note(gated.together_with(free))}",
        enough=len(free) >= _MIN_FREE,
    )


def _angle(runs: HandoverRuns) -> Claim:
    beta = published("angle_threshold")
    says = Statement(
        "By its gripper's angle the robot knows whether it holds the object",
        "sec. 4.1.2",
        f"{np.degrees(beta):.1f}° ({beta:g} rad)",
    )
    full, empty = (runs.usual().metric(f"angle_{what}") for what in ("full", "empty"))
    if not len(full) or not len(empty):
        return says.unknown()
    return says.not_comparable(
        f"at least {np.degrees(full.min()):.1f}° with it, at most {np.degrees(empty.max()):.1f}° without",
        "The thesis does not give the gripper's geometry: its angles here are chosen on both sides of the threshold.",
    )


def _displacement(runs: HandoverRuns) -> Claim:
    theirs = np.array(paper_values("free_flyer", "published")["transfer_displacement_z"], dtype=np.float64)
    says = Statement(
        f"Pulled by a person, the gripper goes {theirs[0]:g} m along z if rigid, {theirs[1]:g} m if compliant",
        "sec. 4.3.1, figs. 4.29, 4.31",
        " and ".join(f"{1e3 * x:.0f}" for x in theirs) + " mm",
    )
    tried, near = runs.by_force(), published("tolerance")
    if not tried:
        return says.unknown()

    def judged(away: Floats) -> Floats:
        """Return the compliant displacement and its ratio to the rigid one, by which the force was chosen."""
        return np.array([away[1], away[1] / away[0]])

    fits = [label for label, away in tried.items() if np.allclose(judged(away) / judged(theirs), 1.0, 0.0, near)]
    shown = {label: f"{1e3 * away[0]:.0f} and {1e3 * away[1]:.0f} mm ({label})" for label, away in tried.items()}
    nearest = min(tried, key=lambda label: float(np.max(np.abs(np.log(tried[label] / theirs)))))
    return says.judged(
        ", ".join(shown[label] for label in runs.by_force(variations=(USUAL,))),
        bool(fits),
        "at a strength that both robots feel, with any thrust, the compliant robot's median and its ratio to the "
        f"rigid one's are within {100 * near:.0f} % of the thesis's",
        f"The thesis does not say how strongly its user pulled, and {_USUAL_FORCE} were chosen since they move the "
        "rigid robot about as far. "
        + (f"It is so at: {'; '.join(fits)}." if fits else f"The nearest were {shown[nearest]}."),
        enough=len(tried) > len(THRUSTS),
    )


def _ten_times(runs: HandoverRuns) -> Claim:
    times, near = published("compliant_over_rigid_robot_to_human"), published("tolerance")
    rigid, compliant = paper_values("free_flyer", "published")["transfer_displacement_z"]
    says = Statement(
        "As it gives, the compliant robot's error along z is ten times the rigid one's",
        "sec. 4.3.1, discussion",
        f"{times:g} times, and {compliant / rigid:.1f} times by its own figures",
    )
    ratios, tried = runs.ratios(GIVING, "displacement_z"), runs.by_force()
    if not ratios:
        return says.unknown()

    def is_ten(away: Floats) -> bool:
        return bool(abs(away[1] / away[0] / times - 1.0) <= near)

    unfelt = "; ".join(label for label, away in runs.by_force(felt=False).items() if is_ten(away))
    return says.judged(
        _by_propulsion(ratios),
        any(map(is_ten, tried.values())),
        f"at a force that both robots feel, with any thrust, the ratio of the medians is within {100 * near:.0f} % of "
        f"it. The thesis's own {rigid:g} and {compliant:g} m are not",
        f"A pull that one of them does not feel has it: {unfelt}." if unfelt else "",
        enough=len(tried) > len(THRUSTS),
    )


def _twice(runs: HandoverRuns) -> Claim:
    times, near = published("compliant_over_rigid_human_to_robot"), published("tolerance")
    says = Statement(
        "As it receives, the compliant robot is moved twice as far along x as the rigid one",
        "sec. 4.3.2, figs. 4.33, 4.35",
        f"{times:g} times",
    )
    ratios = runs.ratios(RECEIVING, "displacement_x")
    if Propulsion.IDEAL not in ratios:
        return says.unknown()
    return says.judged(
        _by_propulsion(ratios),
        abs(ratios[Propulsion.IDEAL] / times - 1.0) <= near,
        f"the ratio of the medians is within {100 * near:.0f} % of it with ideal thrust",
        "The thesis's pushes need that thrust, too.",
    )


def _by_propulsion(ratios: dict[Propulsion, float]) -> str:
    return ", ".join(f"{r:.1f} times ({p.item})" for p, r in ratios.items())


def _timing(claim: str, where: str, theirs: float, times: Floats, why: str) -> Claim:
    says = Statement(claim.format(theirs), where, f"{theirs:g} s")
    if not len(times):
        return says.unknown()
    return says.not_comparable(f"{times.min():.1f} to {times.max():.1f} s", f"It says nothing about the robot: {why}.")


def _limits_hide(runs: HandoverRuns) -> Claim:
    says = Statement(
        f"With Astrobee's limits of thrust a pull of {_USUAL_FORCE} takes a rigid robot as far as a compliant one"
    )
    ratios = runs.ratios(GIVING, "displacement_z")
    if len(ratios) < len(THRUSTS):
        return says.unknown()
    differing = [label for label, away in runs.by_force().items() if away[1] / away[0] >= _DIFFERING_RATIO]
    return says.judged(
        _by_propulsion(ratios),
        ratios[Propulsion.LIMITED] < _DIFFERING_RATIO <= ratios[Propulsion.IDEAL],
        f"the compliant one goes less than {_DIFFERING_RATIO:g} times as far along z with limits, and so far or "
        "farther with ideal thrust",
        f"Of the forces that both feel, so at: {'; '.join(differing) or 'none'}.",
    )


def _gate(runs: HandoverRuns) -> Claim:
    says = Statement("A robot that yields while it still moves, 10 to 20 cm from its place, lets go with nobody there")
    found = {
        e: every_of([runs.of(e.task, b, variation=v) for v, b in product(UNGATED[1:], Behaviour)])
        for e in (GIVING, RECEIVING)
    }
    free, gated = every_of([*found.values()]), acted_alone(runs.usual())
    if not len(free):
        return says.unknown()
    return says.judged(
        ", ".join(f"{acted_alone(r)} of {len(r)} {'giving' if e.gives else 'receiving'}" for e, r in found.items()),
        2 * acted_alone(free) > len(free) and gated == 0,
        "more than half of the runs without the gate have it, and none of those that yield and signal only at rest",
        f"Of these, {gated} of {len(runs.usual())} had it.",
    )


def _rate(runs: HandoverRuns) -> Claim:
    says = Statement("Control at 67.5 Hz, as the thesis prints, moves the gripper as Astrobee's 62.5 Hz does")
    found = [_at_rates(runs, e, b, "displacement") for e, b in product((GIVING, RECEIVING), Behaviour)]
    off = [abs(float(after[0] - before[0])) for before, after in found if len(before) and len(after)]
    if not off:
        return says.unknown()
    rule = f"the greatest displacements differ by less than {1e3 * _SAME:g} mm where nothing is random"
    return says.judged(f"within {1e3 * max(off):.2f} mm", max(off) < _SAME, rule)


def _at_rates(runs: HandoverRuns, exchange: Exchange, behaviour: Behaviour, metric: str) -> tuple[Floats, Floats]:
    """Return a metric of a run at either rate of control."""
    first, second = (
        exchange.of(Runs(runs.of(exchange.task, behaviour, variation=v).rows[:1], {}), metric) for v in RATES
    )
    return first, second


_NOTE_ON_TRANSFERS = (
    "Received: the receiver of this transfer got the object, whatever came of the rest. Medians are of runs that "
    "succeeded; in parentheses, where none did, of what all reached. Along x, y, z of W, and in all: how far the "
    "gripper went at most from its place for as long as the robot yielded. Felt after: from the last signal to release "
    "or closing. Taken after: from the first signal until the receiver had the object alone. At the limits: the share "
    "of the run for which more was commanded than the thrusters give. Published: 40 mm (rigid) and 140 mm (compliant) "
    "along z where the robot gives, and twice as much of the compliant robot along x where it receives."
)


def _transfer(exchange: Exchange, behaviour: Behaviour, propulsion: Propulsion, runs: Runs) -> dict[str, str]:
    done = runs.successful
    shown = done if len(done) else runs
    cells = {f"{name}, mm": number(1e3 * exchange.of(shown, f"displacement{axis}"), ".0f")
             for name, axis in (("along x", "_x"), ("along y", "_y"), ("along z", "_z"), ("in all", ""))}  # fmt: skip
    cells |= {
        "felt after, s": number(exchange.of(shown, "felt_after")),
        "taken after, s": number(exchange.of(shown, "time")),
        "at the limits, %": number(100.0 * shown.metric("saturated_share"), ".0f"),
    }
    return {
        "like": figure_number(exchange.task, behaviour),
        "handover": exchange.label,
        "behaviour": behaviour.item,
        "thrust": propulsion.item,
        "received": of((len(exchange.of(runs, "time")), len(runs))),
        "succeeded": of(runs.count),
        **{name: cell if len(done) or not cell else f"({cell})" for name, cell in cells.items()},
    }


def _margin(exchange: Exchange, behaviour: Behaviour, propulsion: Propulsion, runs: Runs) -> dict[str, str]:
    threshold, rest = exchange.threshold(behaviour), exchange.of(runs, "rest_speed")
    return {
        "handover": exchange.label,
        "behaviour": behaviour.item,
        "thrust": propulsion.item,
        "threshold, m/s": f"{threshold:.3f}",
        "at rest, m/s": number(rest, ".4f", np.max),
        "threshold over rest": f"{threshold / rest.max():.1f}" if rest.max(initial=0.0) > 0.0 else "",
        "when felt, m/s": span(exchange.of(runs, "speed"), ".3f"),
        "angle if full, °": span(np.degrees(runs.metric("angle_full"))),
        "angle if empty, °": span(np.degrees(runs.metric("angle_empty"))),
    }


def _varied(runs: HandoverRuns, label: str, variation: Variation, propulsion: Propulsion) -> dict[str, str]:
    """Return a row for both behaviours; {} without both."""
    found = {b.item: runs.of(GIVING.task, b, propulsion, variation) for b in Behaviour}
    if not all(map(len, found.values())):
        return {}
    away = {b: GIVING.of(r.successful, "displacement_z") for b, r in found.items()}
    rigid, compliant = away.values()
    ratio = f"{np.median(compliant) / np.median(rigid):.1f}" if len(rigid) and len(compliant) else ""
    shares = [number(100.0 * r.metric("saturated_share"), ".0f") for r in found.values()]
    return {
        "case": label,
        "thrust": propulsion.item,
        **{f"{b} felt it": of((len(GIVING.of(r, "speed")), len(r))) for b, r in found.items()},
        **{f"{b} succeeded": of(r.count) for b, r in found.items()},
        **{f"{b} along z, mm": number(1e3 * z, ".0f") for b, z in away.items()},
        "compliant over rigid": ratio,
        "at the limits, %": " and ".join(shares),
    }


def _ungated(runs: HandoverRuns, exchange: Exchange, behaviour: Behaviour) -> dict[str, str]:
    found = {v.label or "at rest": runs.of(exchange.task, behaviour, variation=v) for v in (USUAL, *UNGATED)}
    counts = {label: of((acted_alone(r), len(r))) if len(r) else "" for label, r in found.items()}
    return {"handover": exchange.label, "behaviour": behaviour.item, **counts}


def _of_rates(runs: HandoverRuns, exchange: Exchange, behaviour: Behaviour) -> dict[str, str]:
    """Return a row; {} without a run at either rate."""
    away, felt = (_at_rates(runs, exchange, behaviour, metric) for metric in ("displacement", "felt_after"))
    if not all(map(len, away)):
        return {}
    rates = [v.label for v in RATES]
    return {
        "handover": exchange.label,
        "behaviour": behaviour.item,
        **{f"at {rate}, mm": f"{1e3 * x[0]:.2f}" for rate, x in zip(rates, away, strict=True)},
        "difference, mm": f"{1e3 * (away[1][0] - away[0][0]):+.2f}",
        **{f"felt at {rate} after, s": number(x, ".3f") for rate, x in zip(rates, felt, strict=True)},
    }
