"""Claims of Luberto et al. on successes (table I) and distances (table II), judged on the runs of `ir-table`.

Each verdict follows from a rule that was laid down before the runs.
"""

from dataclasses import replace

import numpy as np

from handover.scenarios.campaign.statistics import success_interval, time_interval, two_proportions
from handover.scenarios.published.ir_grasp.ir_table_runs import (
    ARMS,
    BLIND,
    FORWARD_35,
    FORWARD_55,
    OBJECTS,
    POSES,
    REFLEX,
    Arm,
    Count,
    IrTableRuns,
)
from handover.scenarios.published.published_experiment import Claim, Verdict
from handover.scenarios.published.verdicts import (
    format_p_value,
    format_rate,
    majority_claim,
    no_worse_claim,
    nothing_measured,
    order_claim,
    rare_claim,
    rate_claim,
    without_verdict,
)

_PUSHED = 0.001
"""How far an object must have moved before the hand closed to count as touched, m."""

_BLIND_SELECTED = (
    "The paper does not say how far the hand is from the object before it closes, nor how far objects were moved: "
    "both were chosen so that the blind hand fails about as often as in table I, so agreement is no evidence."
)

_FAILURE_SELECTED = (
    "The blind hand fails by choice: the gap before it closes and how far objects were moved were chosen so that it "
    "does. To do better than a hand that cannot succeed is no evidence that sensing is needed; `handover paper "
    "ir-limits` asks where it is."
)

_EASIER = (
    "More successes than published indicate an easier task, no better hand: here it is planar, five simple shapes "
    "slide on a table of even friction, nothing tips over, and the sensors follow the controller's own curve."
)

Way = tuple[Arm, bool]
"""An arm, and whether poses are perturbed."""


def rate_claims(runs: IrTableRuns) -> list[Claim]:
    """Return the claims of the totals of table I."""
    claims: list[Claim] = []
    for perturbed, pose in POSES.items():
        for arm in ARMS:
            published = runs.published(arm, perturbed)
            if published is not None:
                sentence = f"The {arm.title} hand holds {published[0]} of {published[1]} objects in {pose} poses."
                claim = rate_claim(sentence, "table I, total", published, runs.count(arm, perturbed))
                claims.append(_easier(claim, published, runs.count(arm, perturbed)))
                if arm is BLIND:
                    claims[-1] = without_verdict(claim, _BLIND_SELECTED)
    return claims


def _easier(claim: Claim, published: Count, measured: Count) -> Claim:
    """Tell what a higher rate than the published one is due to."""
    if not measured[1] or measured[0] * published[1] <= published[0] * measured[1]:
        return claim
    return replace(claim, reason=f"{claim.reason} {_EASIER}")


def order_claims(runs: IrTableRuns) -> list[Claim]:
    """Return the claims that one way does better than another; those against the blind hand have no verdict."""
    claims: list[Claim] = []
    for perturbed, pose in POSES.items():
        sentence = f"In {pose} poses the IR-guided hand succeeds more often than the blind one."
        claim = _order(runs, sentence, (REFLEX, perturbed), (BLIND, perturbed))
        claims.append(without_verdict(claim, _FAILURE_SELECTED))
    fewer = "The {} hand succeeds less often in perturbed poses than in nominal ones."
    claims.append(_order(runs, fewer.format(REFLEX.title), (REFLEX, False), (REFLEX, True)))
    blind = _order(runs, fewer.format(BLIND.title), (BLIND, False), (BLIND, True))
    return [*claims, without_verdict(blind, _BLIND_SELECTED)]


def _order(runs: IrTableRuns, sentence: str, first: Way, second: Way) -> Claim:
    """Return a claim of order, with a test of the paper's own counts, which are not paired."""
    theirs = [count for count in (runs.published(*first), runs.published(*second)) if count is not None]
    printed = f"{format_rate(*theirs[0])} against {format_rate(*theirs[1])}"
    note = f"The paper's own counts give p = {format_p_value(two_proportions(*theirs[0], *theirs[1]))} (Fisher)."
    return order_claim(sentence, "table I, sec. V-D", printed, *runs.pairs(first, second), note=note)


def closing_claims(runs: IrTableRuns) -> list[Claim]:
    """Return the claims on how the hand comes to close."""
    low, high = (f"{100 * d:.0f}" for d in runs.closing_distance)
    from_afar = majority_claim(
        f"Most grasps succeed that are closed without sensing from {low} to {high} cm.",
        "sec. V-D",
        "most",
        runs.count(FORWARD_35, False),
        "The paper does not say from which part of the hand it measures. Taken here: from the palm, which in "
        "nominal poses is 35 mm off, as vision asks for 70 mm and the hand goes 35 mm forward.",
    )
    touched, displaced = (
        np.concatenate([runs.metric(name, REFLEX, perturbed) for perturbed in POSES])
        for name in ("touched", "displacement")
    )
    pushed = format_rate(int(np.sum(displaced >= _PUSHED)), len(displaced)) if len(displaced) else "none"
    untouched = rare_claim(
        "The IR-guided hand does not touch the object before it closes.",
        "sec. I",
        "no premature contact",
        (int(np.sum(touched > 0.0)), len(touched)),
        "Counted are grasps in which anything of the hand was in contact with the object before it closed; the object "
        f"was moved by {1000 * _PUSHED:g} mm or more in {pushed}.",
    )
    return [from_afar, untouched]


def further_claims(runs: IrTableRuns) -> list[Claim]:
    """Return claims about the control arm, beyond the paper; they were observed while the scenario was tuned."""
    claims = [
        no_worse_claim(
            f"In {pose} poses a hand that goes 55 mm forward without looking does no worse than the IR-guided one.",
            *runs.pairs((FORWARD_55, perturbed), (REFLEX, perturbed)),
        )
        for perturbed, pose in POSES.items()
    ]
    claims.append(
        no_worse_claim(
            "In nominal poses a hand that goes 35 mm forward without looking does no worse than the IR-guided one.",
            *runs.pairs((FORWARD_35, False), (REFLEX, False)),
        )
    )
    worse = order_claim(
        "In perturbed poses the IR-guided hand succeeds more often than one that goes 35 mm forward without looking.",
        "",
        "",
        *runs.pairs((REFLEX, True), (FORWARD_35, True)),
        beyond=True,
    )
    return [*claims, worse]


_WHERE = "table II"
_IN_COST = ("thumb", "ring")

_SPAN_OF_MOST_RUNS = (2.5, 97.5)
"""Percentiles of our runs between which a published figure passes for that of one run."""

_MIN_RUNS = 10
"""Runs of an object below which such percentiles say nothing."""

_TARGET_TAKEN = (
    "The distance to which thumb and ring are brought, 10 mm, was taken from these figures: agreement would only show "
    "that the correction reaches its target."
)
_ONE_TARGET = (
    "Both fingers have one target distance by construction, so that they are alike shows that the correction ends, and "
    "no more."
)
_TOO_FEW = f"There are fewer than {_MIN_RUNS} runs of an object that came to their end."
_IN_SPACE = (
    "The index lags behind as the hand's synergy has it in space. The plane hand's index is stiffer by assumption, so "
    "that it lags behind too: what comes of it is no evidence."
)


def distance_claims(runs: IrTableRuns) -> list[Claim]:
    """Return the claims of table II."""
    return [
        _without_verdict(runs, _IN_COST, False, _TARGET_TAKEN),
        _within_runs(runs),
        _centred(runs),
        *(_without_verdict(runs, ("index",), perturbed, _IN_SPACE) for perturbed in POSES),
        _index_further(runs),
    ]


def _without_verdict(runs: IrTableRuns, fingers: tuple[str, ...], perturbed: bool, reason: str) -> Claim:
    """Return a claim on fingers' distances that has no verdict."""
    medians = [
        float(np.median(values))
        for things in OBJECTS.values()
        for finger in fingers
        if len(values := runs.metric(f"final_distance_{finger}", REFLEX, perturbed, things))
    ]
    return Claim(
        claim=_sentence(runs, fingers, perturbed),
        published=_span(_printed(runs, fingers, perturbed)),
        measured=f"{_span(medians)} (medians by object)" if medians else "",
        verdict=Verdict.NOT_COMPARABLE,
        reason=reason,
        where=_WHERE,
    )


def _within_runs(runs: IrTableRuns) -> Claim:
    """Judge the perturbed distances of thumb and ring, of which the paper gives neither number nor spread."""
    sentence, printed = _sentence(runs, _IN_COST, True), _span(_printed(runs, _IN_COST, True))
    inside: list[bool] = []
    medians: list[float] = []
    for name, things in OBJECTS.items():
        for finger in _IN_COST:
            values = runs.metric(f"final_distance_{finger}", REFLEX, True, things)
            if len(values) < _MIN_RUNS:
                return nothing_measured(sentence, _WHERE, printed, reason=_TOO_FEW)
            low, high = np.percentile(values, _SPAN_OF_MOST_RUNS)
            inside.append(bool(low <= runs.published_distances(name, True)[finger] <= high))
            medians.append(float(np.median(values)))
    reason = (
        "The paper says neither of how many runs its figures are nor how they spread. Reproduced if each of the six "
        f"lies between the {_SPAN_OF_MOST_RUNS[0]:g}th and {_SPAN_OF_MOST_RUNS[1]:g}th percentile of our runs, so that "
        f"it could be a run's: {sum(inside)} of {len(inside)} do."
    )
    return Claim(
        claim=sentence,
        published=printed,
        measured=f"{_span(medians)} (medians by object)",
        verdict=Verdict.REPRODUCED if all(inside) else Verdict.NOT_REPRODUCED,
        reason=reason,
        where=_WHERE,
    )


def _centred(runs: IrTableRuns) -> Claim:
    """Return that thumb and ring end about as far from the object, as the controller has them do."""
    printed = [abs(thumb - ring) for p in POSES for thumb, ring in _by_object(runs, p)]
    names = [f"final_distance_{finger}" for finger in _IN_COST]
    unlike = np.concatenate([np.abs(np.subtract(*runs.together(names, REFLEX, p))) for p in POSES])
    unlike = unlike[np.isfinite(unlike)]  # of the runs in which both see the object
    sentence = "Thumb and ring are well centred with respect to the object."
    apart, where, interval = f"{_span(printed)} apart", "table II, sec. V-D", time_interval(unlike)
    if interval is None:
        return nothing_measured(sentence, where, apart, reason=_TOO_FEW)
    return Claim(
        claim=sentence,
        published=apart,
        measured=f"{1000 * float(np.median(unlike)):.1f} mm apart (median)",
        interval=(interval.low, interval.high),
        unit="m",
        verdict=Verdict.NOT_COMPARABLE,
        reason=f"{_ONE_TARGET} The interval is that of the median of our runs ({interval.method}); the largest "
        f"difference in the table is {1000 * max(printed):.0f} mm.",
        where=where,
    )


def _index_further(runs: IrTableRuns) -> Claim:
    further: list[bool] = []
    for perturbed in POSES:
        names = [f"final_distance_{finger}" for finger in ("index", *_IN_COST)]
        index, *others = runs.together(names, REFLEX, perturbed)
        farthest = np.maximum(*others)
        seen = np.isfinite(farthest)  # an index that sees nothing is further than fingers that see the object
        further += (np.isnan(index[seen]) | (index[seen] > farthest[seen])).tolist()
    interval = success_interval(sum(further), len(further)) if further else None
    return Claim(
        claim="The index is always further from the object than thumb and ring, in most of the tasks.",
        published="in all rows",
        measured=f"{format_rate(sum(further), len(further))} of the runs" if further else "",
        interval=None if interval is None else (interval.low, interval.high),
        verdict=Verdict.NOT_COMPARABLE,
        reason=_IN_SPACE,
        where="table II, sec. V-D",
    )


def _sentence(runs: IrTableRuns, fingers: tuple[str, ...], perturbed: bool) -> str:
    who = f"the {fingers[0]} ends" if len(fingers) == 1 else f"{' and '.join(fingers)} end"
    return f"In {POSES[perturbed]} poses {who} {_span(_printed(runs, fingers, perturbed))} from the object."


def _printed(runs: IrTableRuns, fingers: tuple[str, ...], perturbed: bool) -> list[float]:
    return [runs.published_distances(name, perturbed)[finger] for name in OBJECTS for finger in fingers]


def _by_object(runs: IrTableRuns, perturbed: bool) -> list[tuple[float, float]]:
    rows = [runs.published_distances(name, perturbed) for name in OBJECTS]
    return [(row["thumb"], row["ring"]) for row in rows]


def _span(values: list[float]) -> str:
    return f"{1000 * min(values):.0f} to {1000 * max(values):.0f} mm"
