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
    USUAL,
    Exchange,
    HandoverRuns,
    values_of,
)
from handover.scenarios.published.published_experiment import Claim, Verdict
from handover.scenarios.published.verdicts import every_claim, nothing_measured

_NEAR = 0.25
"""Part of a displacement read off a figure, or of a ratio printed as a word, by which ours may differ."""
_SAME = 0.001
"""Displacement by which the rate of control may make a difference, m: what is expected of it."""
_TOLD_APART = 1.5
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


def _verdict(holds: bool) -> Verdict:
    return Verdict.REPRODUCED if holds else Verdict.NOT_REPRODUCED


def _succeed(runs: HandoverRuns) -> Claim:
    rows = [row for task in (Task.ROBOT_TO_HUMAN, Task.HUMAN_TO_ROBOT) for row in runs.usual(task)]
    return every_claim(
        "The robot gives and receives an object with either behaviour",
        "sec. 4.3, figs. 4.29 to 4.36",
        (4, 4),
        (sum(bool(row["success"]) for row in rows), len(rows)),
        "With Astrobee's limits and with ideal thrust.",
    )


def _failure_noticed(runs: HandoverRuns) -> Claim:
    rows = runs.usual(Task.FAILED_RECEPTION)
    return every_claim(
        "A push without the object is noticed by the gripper's angle, and the robot asks again",
        "sec. 4.3.2, figs. 4.37, 4.38",
        (1, 1),
        (sum(bool(row["success"]) for row in rows), len(rows)),
        "A success is at least one failed reception, each of which the robot noticed, and then the object's reception.",
    )


def _threshold(runs: HandoverRuns, exchange: Exchange, behaviour: Behaviour) -> Claim:
    alpha = exchange.threshold(behaviour)
    what = "is pulled" if exchange.gives else "is given an object"
    facts: dict[str, Any] = {
        "claim": f"By a speed of {1e3 * alpha:.0f} mm/s the {behaviour.item} robot knows that it {what}",
        "published": f"{alpha:g} m/s",
        "where": "sec. 4.1.2",
    }
    same = [e for e in EXCHANGES if e.gives is exchange.gives]
    found = [(e, runs.of(e.task, behaviour, p)) for e in same for p in THRUSTS]
    rows = [row for _, rows_of in found for row in rows_of]
    if not rows:
        return nothing_measured(**facts)
    rest = np.concatenate([e.of(rows_of, "rest_speed") for e, rows_of in found])
    felt = sum(len(e.of(rows_of, "speed")) for e, rows_of in found)
    alone = sum(int(row.get("unprovoked") or 0) for row in rows)
    return Claim(
        **facts,
        measured=f"at rest {1e3 * rest.max(initial=0.0):.1f} mm/s at most; felt in {felt} of {len(rows)}",
        verdict=_verdict(alone == 0 and felt == len(rows)),
        reason="The thesis tuned it to its robot and its user; here both are assumed, and the threshold is its own. "
        "Reproduced if in every run with the scenario's person the robot acted when the gripper was moved, and never "
        f"before; before, it did so {alone} times.",
    )


def _angle(runs: HandoverRuns) -> Claim:
    beta = float(paper_values("free_flyer", "published")["angle_threshold"])
    facts: dict[str, Any] = {
        "claim": "By its gripper's angle the robot knows whether it holds the object",
        "published": f"{beta:g} rad",
        "where": "sec. 4.1.2",
    }
    rows = runs.usual()
    full, empty = values_of(rows, "angle_full"), values_of(rows, "angle_empty")
    if not len(full) or not len(empty):
        return nothing_measured(**facts)
    return Claim(
        **facts,
        measured=f"at least {full.min():.3f} rad with it, at most {empty.max():.3f} rad without",
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
        "claim": "Pulled by a person, the gripper goes 0.04 m along z if rigid, 0.14 m if compliant",
        "published": " and ".join(f"{1e3 * x:.0f}" for x in published) + " mm",
        "where": "sec. 4.3.1, figs. 4.29, 4.31",
    }
    tried = _by_force(runs)
    if not tried:
        return nothing_measured(**facts)
    fits = [label for label, away in tried if np.allclose(np.divide(away, published), 1.0, rtol=0.0, atol=_NEAR)]
    shown = [f"{1e3 * away[0]:.0f} and {1e3 * away[1]:.0f} mm ({label})" for label, away in tried if "4 N" in label]
    return Claim(
        **facts,
        measured=", ".join(shown),
        verdict=_verdict(bool(fits)) if len(tried) > 2 else Verdict.NOT_COMPARABLE,
        reason="The thesis does not say how strongly its user pulled. Reproduced if there is a strength among those "
        f"tried that both robots feel, with limits or with ideal thrust, at which both medians are within "
        f"{100 * _NEAR:.0f} % of its. " + (f"It is so at: {'; '.join(fits)}." if fits else _nearest(tried, published)),
    )


def _by_force(runs: HandoverRuns, felt: bool = True) -> list[tuple[str, list[float]]]:
    """Return both behaviours' medians along z as the robot gives, m, for each thrust and each force of the pull.

    They are those of forces that both robots felt in all runs; or those that one of them did not, in any.
    """
    found: list[tuple[str, list[float]]] = []
    for variation in (USUAL, *STRENGTHS):
        for propulsion in THRUSTS:
            away = _medians(runs, GIVING, "displacement_z", propulsion, variation=variation)
            rows = [row for b in Behaviour for row in runs.of(GIVING.task, b, propulsion, variation)]
            if away and (len(GIVING.of(rows, "speed")) == len(rows)) is felt:
                found.append((f"{propulsion.item}, {variation.label or '4 N'}", away))
    return found


def _nearest(tried: Sequence[tuple[str, list[float]]], published: Sequence[float]) -> str:
    def off(away: Sequence[float]) -> float:
        return max(abs(np.log(a / p)) for a, p in zip(away, published, strict=True))

    label, away = min(tried, key=lambda pair: off(pair[1]))
    return f"The nearest were {1e3 * away[0]:.0f} and {1e3 * away[1]:.0f} mm ({label})."


def _ten_times(runs: HandoverRuns) -> Claim:
    facts: dict[str, Any] = {
        "claim": "As it gives, the compliant robot's error along z is ten times the rigid one's",
        "published": "10 times, and 3.5 times by its own figures",
        "where": "sec. 4.3.1, discussion",
    }
    found = {p: _medians(runs, GIVING, "displacement_z", p) for p in THRUSTS}
    ratios = {p: away[1] / away[0] for p, away in found.items() if away}
    if not ratios:
        return nothing_measured(**facts)
    unfelt = [label for label, away in _by_force(runs, felt=False) if _is_ten(away)]
    return Claim(
        **facts,
        measured=_by_propulsion(ratios),
        verdict=_verdict(any(_is_ten(away) for _, away in _by_force(runs))),
        reason="Reproduced if at a force that both robots feel, with limits or with ideal thrust, the ratio of the "
        f"medians is within {100 * _NEAR:.0f} % of it, which the thesis's own 0.04 and 0.14 m do not have. "
        + (f"A pull that one of them does not feel has it: {'; '.join(unfelt)}." if unfelt else ""),
    )


def _is_ten(away: Sequence[float]) -> bool:
    return abs(away[1] / away[0] / 10.0 - 1.0) <= _NEAR


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
        verdict=_verdict(abs(ratios[Propulsion.IDEAL] / published - 1.0) <= _NEAR),
        reason=f"Reproduced if the ratio of the medians is within {100 * _NEAR:.0f} % of it with ideal thrust, which "
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
        "claim": "With Astrobee's limits of thrust a pull of 4 N takes a rigid robot as far as a compliant one",
        "published": "",
        "beyond": True,
    }
    found = {p: _medians(runs, GIVING, "displacement_z", p) for p in THRUSTS}
    if not all(found.values()):
        return nothing_measured(**facts)
    ratios = {p: away[1] / away[0] for p, away in found.items()}
    told = [label for label, away in _by_force(runs) if away[1] / away[0] >= _TOLD_APART]
    return Claim(
        **facts,
        measured=_by_propulsion(ratios),
        verdict=_verdict(ratios[Propulsion.LIMITED] < _TOLD_APART <= ratios[Propulsion.IDEAL]),
        reason=f"Holds if the compliant one goes less than {_TOLD_APART:g} times as far along z with limits, and so "
        f"far or farther with ideal thrust. Of the forces that both feel, so at: {'; '.join(told) or 'none'}.",
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
        unprovoked = int((values_of(rows, "unprovoked") > 0).sum())
        counts.append(f"{unprovoked} of {len(rows)} {'giving' if exchange.gives else 'receiving'}")
        alone, all_of = alone + unprovoked, all_of + len(rows)
    if not all_of:
        return nothing_measured(**facts)
    gated = int((values_of(runs.usual(), "unprovoked") > 0).sum())
    return Claim(
        **facts,
        measured=", ".join(counts),
        verdict=_verdict(2 * alone > all_of and gated == 0),
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
        verdict=_verdict(max(off) < _SAME),
        reason=f"Holds if the greatest displacements of giving and receiving, of both behaviours, differ by less than "
        f"{1e3 * _SAME:g} mm where nothing is random.",
    )
