"""Claims on the free-flyer's handovers: [Fernandes2020] secs. 4.1.2 and 4.3, and what its text leaves open."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.scenarios.experiment.paper import paper_values
from handover.scenarios.free_flyer.parameters import Behaviour, Propulsion, Task
from handover.scenarios.published.free_flyer.handover_runs import (
    EXCHANGES,
    GIVING,
    RATES,
    RECEIVING,
    STRENGTHS,
    THRUSTS,
    UNGATED,
    USUAL_FORCE,
    Exchange,
    HandoverRuns,
)
from handover.scenarios.published.free_flyer.variations import (
    USUAL,
    Variation,
    acted_alone,
    is_done,
    succeeded,
    unfinished_note,
    values_of,
)
from handover.scenarios.published.published_experiment import Claim, Verdict
from handover.scenarios.published.verdicts import every_claim, nothing_measured, verdict_of

_SAME = 0.001
"""Displacement by which the rate of control may make a difference, m: what is expected of it."""
_MIN_FREE = 4
"""Runs without a gate of which something is concluded."""
_DIFFERING_RATIO = 1.5
"""Compliant over rigid displacement from which on the behaviours are told apart."""


def claims_of_handovers(runs: HandoverRuns) -> Sequence[Claim]:
    """Judge the thesis's handovers, thresholds and displacements, and beyond it limits, gate and rate."""
    return [
        _succeed(runs),
        _failure_noticed(runs),
        *(_threshold(runs, exchange, b) for exchange in (GIVING, RECEIVING) for b in Behaviour),
        _angle(runs),
        _displacement(runs),
        _ten_times(runs),
        _twice(runs),
        _fetched(runs),
        _failure_begins(runs),
        _limits_hide(runs),
        _gate(runs),
        _rate(runs),
    ]


def _near() -> float:
    """Return by which part a displacement or a ratio may differ from a published one."""
    return float(paper_values("free_flyer", "published")["tolerance"])


def _succeed(runs: HandoverRuns) -> Claim:
    rows = [row for task in (Task.ROBOT_TO_HUMAN, Task.HUMAN_TO_ROBOT) for row in runs.usual(task)]
    return every_claim(
        "The robot gives and receives an object with either behaviour",
        "sec. 4.3, figs. 4.29 to 4.36",
        (4, 4),
        (succeeded(rows), len(rows)),
        f"With ideal thrust, with Astrobee's limits of each axis, and with its nozzles. {unfinished_note(rows)}",
    )


def _failure_noticed(runs: HandoverRuns) -> Claim:
    rows = runs.usual(Task.FAILED_RECEPTION)
    return every_claim(
        "A push without the object is noticed by the gripper's angle, and the robot asks again",
        "sec. 4.3.2, figs. 4.37, 4.38",
        (1, 1),
        (succeeded(rows), len(rows)),
        "A success is at least one failed reception, each of which the robot noticed, and then the object's reception. "
        f"{unfinished_note(rows)}",
    )


def _threshold(runs: HandoverRuns, exchange: Exchange, behaviour: Behaviour) -> Claim:
    alpha = exchange.threshold(behaviour)
    what = "is pulled" if exchange.gives else "is given an object"
    facts: dict[str, Any] = {
        "claim": f"By a speed of {alpha:g} m/s the {behaviour.item} robot knows that it {what}",
        "published": f"{alpha:g} m/s",
        "where": "sec. 4.1.2",
    }
    same = [e for e in EXCHANGES if e.gives is exchange.gives]
    found = [(e, runs.of(e.task, behaviour, p)) for e in same for p in THRUSTS]
    gated = [row for _, rows_of in found for row in rows_of]
    ungated = {v.label: runs.of(exchange.task, behaviour, variation=v) for v in UNGATED}
    free = [row for rows_of in ungated.values() for row in rows_of]
    if not gated:
        return nothing_measured(**facts)
    rest = np.concatenate([e.of(rows_of, "rest_speed") for e, rows_of in found])
    felt = sum(len(e.of(rows_of, "speed")) for e, rows_of in found)
    counts = ", ".join(
        f"{acted_alone(rows_of)} of {len(rows_of)} {label}" for label, rows_of in ungated.items() if rows_of
    )
    return Claim(
        **facts,
        measured=f"acted untouched in {acted_alone(free)} of {len(free)} as it arrived; at rest "
        f"{rest.max(initial=0.0):.4f} m/s at most, and felt in {felt} of {len(rest)}",
        verdict=verdict_of(
            acted_alone(free) == 0 and all(map(is_done, [*gated, *free])) and felt == len(rest),
            could_be_either=len(free) >= _MIN_FREE,
        ),
        reason="The thesis names no condition of rest. Judged on runs without one, in which the robot watches its "
        "speed as soon as it is near its place, still moving: a gate that waits for rest would keep the speed below "
        "any threshold. Reproduced if there it never acts before it is touched, and if at rest it feels the scenario's "
        f"person whenever it has signalled. Untouched it acted in {counts or 'no run, for there is none'}; behind the "
        f"gate in {acted_alone(gated)} of {len(gated)}. {unfinished_note([*gated, *free])}".strip(),
    )


def _angle(runs: HandoverRuns) -> Claim:
    beta = float(paper_values("free_flyer", "published")["angle_threshold"])
    facts: dict[str, Any] = {
        "claim": "By its gripper's angle the robot knows whether it holds the object",
        "published": f"{np.degrees(beta):.1f}° ({beta:g} rad)",
        "where": "sec. 4.1.2",
    }
    rows = runs.usual()
    full, empty = values_of(rows, "angle_full"), values_of(rows, "angle_empty")
    if not len(full) or not len(empty):
        return nothing_measured(**facts)
    return Claim(
        **facts,
        measured=f"at least {np.degrees(full.min()):.1f}° with it, at most {np.degrees(empty.max()):.1f}° without",
        verdict=Verdict.NOT_COMPARABLE,
        reason="The threshold lies between the two, but so it must: the thesis does not give the gripper's geometry, "
        "and its angles here are chosen on both sides of the threshold.",
    )


def _medians(runs: HandoverRuns, exchange: Exchange, metric: str, propulsion: Propulsion, **which: Any) -> list[float]:
    """Return the medians of a metric for the rigid and the compliant robot; [] without both."""
    found = [exchange.of(runs.of(exchange.task, b, propulsion, **which), metric) for b in Behaviour]
    return [float(np.median(x)) for x in found] if all(len(x) for x in found) else []


def _displacement(runs: HandoverRuns) -> Claim:
    published = [float(x) for x in paper_values("free_flyer", "published")["transfer_displacement_z"]]
    facts: dict[str, Any] = {
        "claim": f"Pulled by a person, the gripper goes {published[0]:g} m along z if rigid, {published[1]:g} m if "
        "compliant",
        "published": " and ".join(f"{1e3 * x:.0f}" for x in published) + " mm",
        "where": "sec. 4.3.1, figs. 4.29, 4.31",
    }
    tried = _by_force(runs)
    if not tried:
        return nothing_measured(**facts)
    fits = [label for label, away in tried if np.allclose(_judged(away) / _judged(published), 1.0, 0.0, _near())]
    usual = _by_force(runs, variations=(USUAL,))
    shown = [f"{1e3 * away[0]:.0f} and {1e3 * away[1]:.0f} mm ({label})" for label, away in usual]
    return Claim(
        **facts,
        measured=", ".join(shown),
        verdict=verdict_of(bool(fits), could_be_either=len(tried) > len(THRUSTS)),
        reason=f"The thesis does not say how strongly its user pulled, and {USUAL_FORCE} were chosen since they move "
        "the rigid robot about as far as its own: that is no finding. Reproduced if there is a strength among those "
        "tried that both robots feel, with any thrust, at which the compliant robot's median and its ratio to the "
        f"rigid one's are within {100 * _near():.0f} % of the thesis's. "
        + (f"It is so at: {'; '.join(fits)}." if fits else _nearest(tried, published)),
    )


def _judged(away: Sequence[float]) -> Floats:
    """Return the compliant displacement and its ratio to the rigid one, by which the force was chosen."""
    return np.array([away[1], away[1] / away[0]])


def _by_force(
    runs: HandoverRuns, felt: bool = True, variations: Sequence[Variation] = (USUAL, *STRENGTHS)
) -> list[tuple[str, list[float]]]:
    """Return both behaviours' medians along z as the robot gives, m, for each thrust and each force of the pull.

    They are those of forces that both robots felt in all runs; or those that one of them did not, in any.
    """
    found: list[tuple[str, list[float]]] = []
    for variation in variations:
        for propulsion in THRUSTS:
            away = _medians(runs, GIVING, "displacement_z", propulsion, variation=variation)
            rows = [row for b in Behaviour for row in runs.of(GIVING.task, b, propulsion, variation)]
            if away and (len(GIVING.of(rows, "speed")) == len(rows)) is felt:
                found.append((f"{propulsion.item}, {variation.label or USUAL_FORCE}", away))
    return found


def _nearest(tried: Sequence[tuple[str, list[float]]], published: Sequence[float]) -> str:
    def off(away: Sequence[float]) -> float:
        return max(abs(np.log(a / p)) for a, p in zip(away, published, strict=True))

    label, away = min(tried, key=lambda pair: off(pair[1]))
    return f"The nearest were {1e3 * away[0]:.0f} and {1e3 * away[1]:.0f} mm ({label})."


def _ten_times(runs: HandoverRuns) -> Claim:
    published = paper_values("free_flyer", "published")
    times, (rigid, compliant) = _ten(), published["transfer_displacement_z"]
    facts: dict[str, Any] = {
        "claim": "As it gives, the compliant robot's error along z is ten times the rigid one's",
        "published": f"{times:g} times, and {compliant / rigid:.1f} times by its own figures",
        "where": "sec. 4.3.1, discussion",
    }
    found = {p: _medians(runs, GIVING, "displacement_z", p) for p in THRUSTS}
    ratios = {p: away[1] / away[0] for p, away in found.items() if away}
    if not ratios:
        return nothing_measured(**facts)
    tried = _by_force(runs)
    unfelt = [label for label, away in _by_force(runs, felt=False) if _is_ten(away)]
    return Claim(
        **facts,
        measured=_by_propulsion(ratios),
        verdict=verdict_of(any(_is_ten(away) for _, away in tried), could_be_either=len(tried) > len(THRUSTS)),
        reason="Reproduced if at a force that both robots feel, with any thrust, the ratio of the "
        f"medians is within {100 * _near():.0f} % of it, which the thesis's own {rigid:g} and {compliant:g} m do not "
        "have. " + (f"A pull that one of them does not feel has it: {'; '.join(unfelt)}." if unfelt else ""),
    )


def _ten() -> float:
    return float(paper_values("free_flyer", "published")["compliant_over_rigid_robot_to_human"])


def _is_ten(away: Sequence[float]) -> bool:
    return abs(away[1] / away[0] / _ten() - 1.0) <= _near()


def _twice(runs: HandoverRuns) -> Claim:
    published = float(paper_values("free_flyer", "published")["compliant_over_rigid_human_to_robot"])
    facts: dict[str, Any] = {
        "claim": "As it receives, the compliant robot is moved twice as far along x as the rigid one",
        "published": f"{published:g} times",
        "where": "sec. 4.3.2, figs. 4.33, 4.35",
    }
    found = {p: _medians(runs, RECEIVING, "displacement_x", p) for p in THRUSTS}
    ratios = {p: away[1] / away[0] for p, away in found.items() if away}
    if Propulsion.IDEAL not in ratios:
        return nothing_measured(**facts)
    return Claim(
        **facts,
        measured=_by_propulsion(ratios),
        verdict=verdict_of(abs(ratios[Propulsion.IDEAL] / published - 1.0) <= _near()),
        reason=f"Reproduced if the ratio of the medians is within {100 * _near():.0f} % of it with ideal thrust, which "
        "the thesis's pushes need, too.",
    )


def _by_propulsion(ratios: dict[Propulsion, float]) -> str:
    return ", ".join(f"{r:.1f} times ({p.item})" for p, r in ratios.items())


def _fetched(runs: HandoverRuns) -> Claim:
    return _timing(
        "The robot has the object",
        "sec. 4.3.1",
        float(paper_values("free_flyer", "published")["fetched"]),
        values_of(runs.usual(Task.ROBOT_TO_HUMAN), "phase_move_to_handover"),
        "the object's first place is not stated, and was chosen such that it takes about as long",
    )


def _failure_begins(runs: HandoverRuns) -> Claim:
    return _timing(
        "The first, false reception begins",
        "sec. 4.3.2",
        float(paper_values("free_flyer", "published")["failed_reception"]),
        values_of(runs.usual(Task.FAILED_RECEPTION), "phase_close_gripper"),
        "it is the user who begins it, at a time of their own; here the person reacts to the light",
    )


def _timing(claim: str, where: str, published: float, times: Floats, why: str) -> Claim:
    facts: dict[str, Any] = {"claim": f"{claim} after {published:g} s", "published": f"{published:g} s", "where": where}
    if not len(times):
        return nothing_measured(**facts)
    return Claim(
        **facts,
        measured=f"{times.min():.1f} to {times.max():.1f} s",
        verdict=Verdict.NOT_COMPARABLE,
        reason=f"It says nothing about the robot: {why}.",
    )


def _limits_hide(runs: HandoverRuns) -> Claim:
    facts: dict[str, Any] = {
        "claim": f"With Astrobee's limits of thrust a pull of {USUAL_FORCE} takes a rigid robot as far as a compliant "
        "one",
        "published": "",
        "beyond": True,
    }
    found = {p: _medians(runs, GIVING, "displacement_z", p) for p in THRUSTS}
    if not all(found.values()):
        return nothing_measured(**facts)
    ratios = {p: away[1] / away[0] for p, away in found.items()}
    differing = [label for label, away in _by_force(runs) if away[1] / away[0] >= _DIFFERING_RATIO]
    return Claim(
        **facts,
        measured=_by_propulsion(ratios),
        verdict=verdict_of(ratios[Propulsion.LIMITED] < _DIFFERING_RATIO <= ratios[Propulsion.IDEAL]),
        reason=f"Holds if the compliant one goes less than {_DIFFERING_RATIO:g} times as far along z with limits, and "
        f"so far or farther with ideal thrust. Of the forces that both feel, so at: {'; '.join(differing) or 'none'}.",
    )


def _gate(runs: HandoverRuns) -> Claim:
    facts: dict[str, Any] = {
        "claim": "A robot that yields while it still moves, 10 to 20 cm from its place, lets go with nobody there",
        "published": "",
        "beyond": True,
    }
    counts: list[str] = []
    alone, all_of = 0, 0
    for exchange in (GIVING, RECEIVING):
        rows = [r for v in UNGATED[1:] for b in Behaviour for r in runs.of(exchange.task, b, variation=v)]
        unprovoked = acted_alone(rows)
        counts.append(f"{unprovoked} of {len(rows)} {'giving' if exchange.gives else 'receiving'}")
        alone, all_of = alone + unprovoked, all_of + len(rows)
    if not all_of:
        return nothing_measured(**facts)
    gated = acted_alone(runs.usual())
    return Claim(
        **facts,
        measured=", ".join(counts),
        verdict=verdict_of(2 * alone > all_of and gated == 0),
        reason="Holds if more than half of the runs without the gate have it, and none of those that yield and signal "
        f"only at rest; of these, {gated} of {len(runs.usual())} had it.",
    )


def _rate(runs: HandoverRuns) -> Claim:
    facts: dict[str, Any] = {
        "claim": "Control at 67.5 Hz, as the thesis prints, moves the gripper as Astrobee's 62.5 Hz does",
        "published": "",
        "beyond": True,
    }
    off: list[float] = []
    for exchange in (GIVING, RECEIVING):
        for behaviour in Behaviour:
            found = [exchange.of(runs.of(exchange.task, behaviour, variation=v)[:1], "displacement") for v in RATES]
            if all(len(x) for x in found):
                off.append(abs(float(found[1][0] - found[0][0])))
    if not off:
        return nothing_measured(**facts)
    return Claim(
        **facts,
        measured=f"within {1e3 * max(off):.2f} mm",
        verdict=verdict_of(max(off) < _SAME),
        reason=f"Holds if the greatest displacements of giving and receiving, of both behaviours, differ by less than "
        f"{1e3 * _SAME:g} mm where nothing is random.",
    )
