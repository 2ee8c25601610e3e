"""What `helix-1` says of the claims about table 1 and fig. 9 of [Vervloet2025]; each rule was laid down before runs."""

from typing import Any

import numpy as np

from handover.scenarios.campaign.statistics import FEWEST, success_interval, time_interval, two_proportions
from handover.scenarios.published.claim import Claim, Verdict
from handover.scenarios.published.helix_1_arm import Helix1Arm
from handover.scenarios.published.helix_1_telling import published, too_few
from handover.scenarios.published.helix_1_time_claims import time_claims
from handover.scenarios.published.ratio_interval import ratio_interval
from handover.scenarios.published.telling import told_p

_READING = 0.01
"""What the lengths of fig. 9 are told to, m."""


def thesis_claims(arm: Helix1Arm) -> list[Claim]:
    """Judge the thesis's claims on the runs with its settings."""
    return [_closes(arm), _succeeds(arm), *time_claims(arm), _mismatch(arm), _timestep(arm)]


def own_claims(thesis: Helix1Arm, own: Helix1Arm) -> list[Claim]:
    """Judge what this project says of its own settings, if there are runs with them."""
    return [_own_success(own), _nearer(thesis, own)] if own.tried else []


def _closes(arm: Helix1Arm) -> Claim:
    return _rate(arm, "The arm reaches the ball and the gripper begins to close in every run", arm.closed)


def _succeeds(arm: Helix1Arm) -> Claim:
    return _rate(arm, "Every handover succeeds", arm.succeeded)


def _rate(arm: Helix1Arm, claim: str, successes: int) -> Claim:
    k, n = published()["success"]
    told: dict[str, Any] = {"claim": claim, "published": f"{k} of {n}", "where": "sec. 4"}
    if not arm.tried:
        return too_few(told, "no runs")
    interval, p = success_interval(successes, arm.tried), two_proportions(successes, arm.tried, k, n)
    rule = "Reproduced if every run does; the interval is Clopper and Pearson's"
    return Claim(
        **told,
        measured=f"{successes} of {arm.tried}",
        interval=(interval.low, interval.high),
        verdict=Verdict.REPRODUCED if successes == arm.tried else Verdict.NOT_REPRODUCED,
        reason=f"{rule}. Fisher's exact test against the published rate: p = {told_p(p)}.{_broken(arm)}",
    )


def _mismatch(arm: Helix1Arm) -> Claim:
    there, alpha = published(), arm.alphas[0]
    named = ("model_mismatch", "arm_travel", "model_travel")
    told: dict[str, Any] = {
        "claim": "At the goal the model's gripper is far from the measured one",
        "published": "{:.2f} m (arm {:.2f} m, model {:.2f} m from the start)".format(*(there[n] for n in named)),
        "where": "sec. 5.2, fig. 9",
    }
    values = [arm.metric(name, alpha) for name in named]
    interval = time_interval(values[0], np.mean)
    if interval is None:
        return too_few(told, f"{len(values[0])} runs at step size {alpha}")
    agrees = interval.low - _READING <= there["model_mismatch"] <= interval.high + _READING
    return Claim(
        **told,
        measured="{:.3f} m (arm {:.3f} m, model {:.3f} m from the start)".format(*map(np.mean, values)),
        interval=(interval.low, interval.high),
        unit="m",
        verdict=Verdict.NOT_COMPARABLE if agrees else Verdict.NOT_REPRODUCED,
        reason="The arm's stiffness and masses were chosen such that it is as far off as in fig. 9 in one state at "
        "rest, so that agreement would prove nothing and would not be comparable. Not reproduced if the interval of "
        f"the mean, widened by {_READING} m as the figure is told, leaves the published length out. Where the ball is "
        "offered is assumed, and with it how far the arm goes.",
    )


def _timestep(arm: Helix1Arm) -> Claim:
    mean, std = published()["timestep_mean"], published()["timestep_std"]
    periods = {alpha: sorted({row["control_period"] for row in arm.rows[alpha]}) for alpha in arm.alphas}
    return Claim(
        claim="A control step takes about 1.4 s",
        published=", ".join(f"{m} ± {s}" for m, s in zip(mean, std, strict=True)) + " s",
        measured=", ".join(f"{p:.2f}" for told in periods.values() for p in told) + " s (as set)",
        verdict=Verdict.NOT_COMPARABLE,
        reason="The published time is what the thesis's program took to compute a step on its laptop; here it is the "
        "control period that runs are given.",
        where="table 1",
    )


def _own_success(own: Helix1Arm) -> Claim:
    interval = success_interval(own.succeeded, own.tried)
    return Claim(
        claim="With our settings every handover succeeds",
        published="",
        measured=f"{own.succeeded} of {own.tried}",
        interval=(interval.low, interval.high),
        verdict=Verdict.REPRODUCED if own.succeeded == own.tried else Verdict.NOT_REPRODUCED,
        reason=f"Holds if every run does; the interval is Clopper and Pearson's.{_broken(own)}",
        beyond=True,
    )


def _nearer(thesis: Helix1Arm, own: Helix1Arm) -> Claim:
    told: dict[str, Any] = {
        "claim": "With our settings the gripper takes the ball nearer to its axis than with the thesis's",
        "published": "",
        "beyond": True,
    }
    theirs, ours = (
        np.concatenate([a.metric("grasp_offset_lateral", alpha) for alpha in a.alphas]) for a in (thesis, own)
    )
    if min(len(theirs), len(ours)) < FEWEST:
        return too_few(told, f"{len(theirs)} and {len(ours)} balls taken")
    interval = ratio_interval(ours, theirs, np.median)
    return Claim(
        **told,
        measured=f"{np.median(ours):.4f} m against {np.median(theirs):.4f} m (medians)",
        interval=interval,
        verdict=Verdict.REPRODUCED if interval and interval[1] < 1.0 else Verdict.NOT_REPRODUCED,
        reason="Holds if the bootstrap's interval of the ratio of medians, ours to the thesis's, lies below 1.",
    )


def _broken(arm: Helix1Arm) -> str:
    return f" {arm.broken} runs that did not come to their end do not count." if arm.broken else ""
