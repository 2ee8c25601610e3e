"""Claims of Luberto et al. on the successes of table I, with verdicts by rules laid down before the runs."""

import numpy as np

from handover.scenarios.campaign.statistics import two_proportions
from handover.scenarios.published.claim import Claim
from handover.scenarios.published.ir_table_runs import (
    ARMS,
    BLIND,
    FORWARD_35,
    FORWARD_55,
    POSES,
    REFLEX,
    Arm,
    IrTableRuns,
)
from handover.scenarios.published.telling import told_p, told_rate
from handover.scenarios.published.verdict_rules import (
    majority_claim,
    no_worse_claim,
    order_claim,
    rare_claim,
    rate_claim,
    without_verdict,
)

_PUSHED = 0.001
"""How far an object must have moved before the hand closed to count as touched, m."""

_BLIND_CHOSEN = (
    "The paper does not tell how far the hand is from the object before it closes, nor how far objects were moved: "
    "both were chosen so that the blind hand fails about as often as in table I, so agreement is no evidence."
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
                claims.append(claim if arm is not BLIND else without_verdict(claim, _BLIND_CHOSEN))
    return claims


def order_claims(runs: IrTableRuns) -> list[Claim]:
    """Return the claims that one way does better than another."""
    claims: list[Claim] = []
    for perturbed, pose in POSES.items():
        sentence = f"In {pose} poses the IR-guided hand succeeds more often than the blind one."
        claims.append(_order(runs, sentence, (REFLEX, perturbed), (BLIND, perturbed)))
    fewer = "The {} hand succeeds less often in perturbed poses than in nominal ones."
    claims.append(_order(runs, fewer.format(REFLEX.title), (REFLEX, False), (REFLEX, True)))
    blind = _order(runs, fewer.format(BLIND.title), (BLIND, False), (BLIND, True))
    return [*claims, without_verdict(blind, _BLIND_CHOSEN)]


def _order(runs: IrTableRuns, sentence: str, first: Way, second: Way) -> Claim:
    """Return a claim of order, and what the paper's own counts, which are not paired, say of it."""
    theirs = [count for count in (runs.published(*first), runs.published(*second)) if count is not None]
    printed = f"{told_rate(*theirs[0])} against {told_rate(*theirs[1])}"
    note = f"The paper's own counts give p = {told_p(two_proportions(*theirs[0], *theirs[1]))} (Fisher)."
    return order_claim(sentence, "table I, sec. V-D", printed, *runs.pairs(first, second), note=note)


def closing_claims(runs: IrTableRuns) -> list[Claim]:
    """Return the claims on how the hand comes to close."""
    low, high = (f"{100 * d:.0f}" for d in runs.closing_distance)
    from_afar = majority_claim(
        f"Most grasps succeed that are closed without sensing from {low} to {high} cm.",
        "sec. V-D",
        "most",
        runs.count(FORWARD_35, False),
        "The paper does not tell from which part of the hand it measures. Taken here: from the palm, which in "
        "nominal poses is 35 mm off, as vision asks for 70 mm and the hand goes 35 mm forward.",
    )
    displaced = np.concatenate([runs.metric("displacement", REFLEX, perturbed) for perturbed in POSES])
    untouched = rare_claim(
        "The IR-guided hand does not touch the object before it closes.",
        "sec. I",
        "no premature contact",
        (int(np.sum(displaced >= _PUSHED)), len(displaced)),
        f"Counted are objects that were moved by {1000 * _PUSHED:g} mm or more before the hand closed.",
    )
    return [from_afar, untouched]


def further_claims(runs: IrTableRuns) -> list[Claim]:
    """Return what the control arm says beyond the paper, as the scenario's tuning had it."""
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
