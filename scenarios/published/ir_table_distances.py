"""Claims of Luberto et al. on the distances of table II, with verdicts by rules laid down before the runs."""

import numpy as np

from handover.scenarios.campaign.statistics import success_interval, time_interval
from handover.scenarios.published.claim import Claim, Verdict
from handover.scenarios.published.ir_table_runs import OBJECTS, POSES, REFLEX, IrTableRuns
from handover.scenarios.published.telling import told_rate
from handover.scenarios.published.verdict_rules import nothing_measured

_WHERE = "table II"
_IN_COST = ("thumb", "ring")

_MOST_RUNS = (2.5, 97.5)
"""Percentiles of our runs between which a published figure passes for that of one run."""

_FEWEST_RUNS = 10
"""Runs of an object below which such percentiles say nothing."""

_TARGET_TAKEN = (
    "The distance to which thumb and ring are brought, 10 mm, was taken from these figures: agreement would only show "
    "that the correction reaches its target."
)
_TOO_FEW = f"There are fewer than {_FEWEST_RUNS} runs of an object that came to their end."
_IN_SPACE = (
    "The index lags behind as the hand's synergy has it in space. The plane hand's index is stiffer by assumption, so "
    "that it lags behind too: what comes of it is no evidence."
)


def distance_claims(runs: IrTableRuns) -> list[Claim]:
    """Return the claims of table II."""
    return [
        _told(runs, _IN_COST, False, _TARGET_TAKEN),
        _within_runs(runs),
        _centred(runs),
        *(_told(runs, ("index",), perturbed, _IN_SPACE) for perturbed in POSES),
        _index_further(runs),
    ]


def _told(runs: IrTableRuns, fingers: tuple[str, ...], perturbed: bool, reason: str) -> Claim:
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
    """Judge the perturbed distances of thumb and ring, of which the paper tells neither number nor spread."""
    sentence, printed = _sentence(runs, _IN_COST, True), _span(_printed(runs, _IN_COST, True))
    inside: list[bool] = []
    medians: list[float] = []
    for name, things in OBJECTS.items():
        for finger in _IN_COST:
            values = runs.metric(f"final_distance_{finger}", REFLEX, True, things)
            if len(values) < _FEWEST_RUNS:
                return nothing_measured(sentence, _WHERE, printed, reason=_TOO_FEW)
            low, high = np.percentile(values, _MOST_RUNS)
            inside.append(bool(low <= runs.published_distances(name, True)[finger] <= high))
            medians.append(float(np.median(values)))
    reason = (
        "The paper tells neither of how many runs its figures are nor how they spread. Reproduced if each of the six "
        f"lies between the {_MOST_RUNS[0]:g}th and {_MOST_RUNS[1]:g}th percentile of our runs, so that it could be a "
        f"run's: {sum(inside)} of {len(inside)} do."
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
    """Judge that thumb and ring end about as far from the object."""
    printed = [abs(thumb - ring) for p in POSES for thumb, ring in _by_object(runs, p)]
    unlike = np.concatenate(
        [
            np.abs(runs.metric("final_distance_thumb", REFLEX, p) - runs.metric("final_distance_ring", REFLEX, p))
            for p in POSES
        ]
    )
    sentence = "Thumb and ring are well centred with respect to the object."
    told, where, interval = f"{_span(printed)} apart", "table II, sec. V-D", time_interval(unlike)
    if interval is None:
        return nothing_measured(sentence, where, told, reason=_TOO_FEW)
    return Claim(
        claim=sentence,
        published=told,
        measured=f"{1000 * float(np.median(unlike)):.1f} mm apart (median)",
        interval=(interval.low, interval.high),
        unit="m",
        verdict=Verdict.REPRODUCED if interval.high <= max(printed) else Verdict.NOT_REPRODUCED,
        reason=f"Reproduced if the interval of the median of our runs ({interval.method}) lies below the largest "
        f"difference in the table, {1000 * max(printed):.0f} mm.",
        where=where,
    )


def _index_further(runs: IrTableRuns) -> Claim:
    further: list[bool] = []
    for perturbed in POSES:
        index, *others = (runs.metric(f"final_distance_{f}", REFLEX, perturbed) for f in ("index", *_IN_COST))
        further += (index > np.maximum(*others)).tolist()
    interval = success_interval(sum(further), len(further)) if further else None
    return Claim(
        claim="The index is always further from the object than thumb and ring, in most of the tasks.",
        published="in all rows",
        measured=f"{told_rate(sum(further), len(further))} of the runs" if further else "",
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
