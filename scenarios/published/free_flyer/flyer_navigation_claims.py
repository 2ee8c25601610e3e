"""Claims on what errors of the free-flyer's navigation do, where a model says what is to come out."""

from functools import cache
from typing import Any

from handover.controllers.free_flyer.handover_parameters import Params as DecisionParams
from handover.controllers.free_flyer.sampled_loop import largest_stable
from handover.plants.free_flyer.robot.thrusters import Params as ThrustersParams
from handover.scenarios.campaign.statistics import LEVEL, two_proportions
from handover.scenarios.free_flyer.parameters import Behaviour, Task
from handover.scenarios.published.free_flyer.navigation_runs import (
    DELAY,
    POSITION_BIAS,
    TRIED,
    VARIATIONS,
    VELOCITY_BIAS,
    NavigationRuns,
    count_probability,
    rest_probability,
    signalled,
)
from handover.scenarios.published.free_flyer.push_runs import linear_loop
from handover.scenarios.published.free_flyer.variations import (
    USUAL,
    Row,
    acted_alone,
    succeeded_touched,
    unfinished_note,
    values_of,
)
from handover.scenarios.published.published_experiment import Claim, Verdict
from handover.scenarios.published.verdicts import (
    every_claim,
    format_p_value,
    format_rate,
    format_share,
    nothing_measured,
    verdict_of,
    with_shortfall,
)

_MIN_RUNS, _MIN_LATE = 20, 4
"""Runs of which something is concluded that a model predicts, or that never happens; and of an unstable loop."""


def claims_of_navigation(runs: NavigationRuns) -> list[Claim]:
    """Judge what the thesis leaves open, then usual errors, gate, loop, fetching and false releases."""
    delays = [(b, stable) for b in Behaviour for stable in (True, False)]
    return [
        _estimate(runs),
        _usual(runs),
        _velocity_bias(runs),
        *(claim for b, stable in delays if (claim := _delay(runs, b, stable)) is not None),
        _fetching(runs),
        _alone(runs),
    ]


def _estimate(runs: NavigationRuns) -> Claim:
    facts: dict[str, Any] = {
        "claim": "The robot's own filter estimates its pose and velocity well enough for handovers",
        "published": "all handovers succeed, in its simulation",
        "where": "secs. 4.1.1, 4.1.2, 4.3",
    }
    rows = runs.all_of()
    if not rows:
        return nothing_measured(**facts)
    return Claim(
        **facts,
        measured=f"{format_rate(succeeded_touched(rows), len(rows))} with the assumed noise",
        verdict=Verdict.NOT_COMPARABLE,
        reason="The thesis gives no figure of its filter's errors, and noise, biases, drifts and delays are assumed "
        "here; the table says how large each may be.",
    )


def _usual(runs: NavigationRuns) -> Claim:
    rows = runs.all_of(USUAL)
    claim = "With the assumed noise alone every handover succeeds"
    return every_claim(claim, "", (0, 0), (succeeded_touched(rows), len(rows)), unfinished_note(rows))


def _velocity_bias(runs: NavigationRuns) -> Claim:
    gate = float(DecisionParams().gate_speed)
    facts: dict[str, Any] = {
        "claim": "A robot whose velocity is biased signals as often as its bias is below the speed that counts as rest",
        "published": "",
        "beyond": True,
    }
    found = {x: runs.all_of(VELOCITY_BIAS.variation(x), (Task.HUMAN_TO_ROBOT,)) for x in VELOCITY_BIAS.levels}
    chances = [rest_probability(x) for x, rows in found.items() for _ in rows]
    if not chances:
        return nothing_measured(**facts)
    count = sum(map(signalled, found.values()))
    p = count_probability(count, chances)
    each = ", ".join(
        f"{signalled(rows)} of {len(rows)} at {x:g} m/s ({format_share(rest_probability(x))})"
        for x, rows in found.items()
        if rows
    )
    return Claim(
        **facts,
        measured=f"{count} of {len(chances)}, expected {sum(chances):.1f}",
        verdict=verdict_of(p >= LEVEL, could_be_either=len(chances) >= _MIN_RUNS),
        reason=with_shortfall(
            f"At rest it sees the bias as its speed, which must be below {gate:g} m/s. Holds if an exact "
            f"test of the count, of robots that receive, does not reject at {format_share(LEVEL)} that each signals "
            "with the probability that the length of three Gaussian components is: "
            f"p = {format_p_value(p)}. By deviation, with that probability: {each}.",
            len(chances),
            _MIN_RUNS,
        ),
    )


@cache
def _greatest_delay(behaviour: Behaviour) -> float:
    """Return about the largest delay, s, with which the linear loop with the propulsion's lag is stable."""
    lag = float(ThrustersParams().lag)
    return largest_stable(lambda delay: linear_loop(behaviour, lag, round(delay, 6)).pole_radius, upper=0.3, steps=12)


def _delay(runs: NavigationRuns, behaviour: Behaviour, stable: bool) -> Claim | None:
    """Judge the delays with which a behaviour's loop is stable, or is not; None if there are no such delays."""
    most = _greatest_delay(behaviour)
    levels = [x for x in DELAY.levels if (x < most) is stable]
    if not levels:
        return None
    rows = [row for x in levels for task in TRIED for row in runs.of(task, behaviour, DELAY.variation(x))]
    tried = ", ".join(f"{1e3 * x:g}" for x in levels)
    note = f"By its poles it is stable up to {1e3 * most:.0f} ms; tried {tried} ms, unknown to it."
    if stable:
        claim = f"With an old estimate, at which its loop is stable by its poles, the {behaviour.item} robot hands over"
        return every_claim(claim, "", (0, 0), (succeeded_touched(rows), len(rows)), f"{note} {unfinished_note(rows)}")
    facts: dict[str, Any] = {
        "claim": f"An old estimate, at which its loop is unstable by its poles, makes the {behaviour.item} robot fail",
        "published": "",
        "beyond": True,
    }
    if not rows:
        return nothing_measured(**facts)
    failed = len(rows) - succeeded_touched(rows)
    limited = values_of(rows, "saturated_share")
    share = (
        f" More was commanded than the thrusters give for {format_share(float(limited.mean()))} of the time."
        if len(limited)
        else ""
    )
    return Claim(
        **facts,
        measured=f"{format_rate(failed, len(rows))} failed",
        verdict=verdict_of(2 * failed > len(rows), could_be_either=len(rows) >= _MIN_LATE),
        reason=with_shortfall(
            f"Holds if more than half of the runs fail. {note}{share} Limits of thrust turn a growing oscillation "
            f"into a lasting one, which may be small. {unfinished_note(rows)}".strip(),
            len(rows),
            _MIN_LATE,
        ),
    )


def _fetching(runs: NavigationRuns) -> Claim:
    facts: dict[str, Any] = {
        "claim": "A biased position costs handovers where the robot fetches the object, not where a person brings it",
        "published": "",
        "beyond": True,
    }
    gives, receives = (
        [row for x in POSITION_BIAS.levels for row in runs.all_of(POSITION_BIAS.variation(x), (task,))]
        for task in TRIED
    )
    if not gives or not receives:
        return nothing_measured(**facts)
    (k, n), (j, m) = ((succeeded_touched(rows), len(rows)) for rows in (gives, receives))
    p = two_proportions(k, n, j, m)
    return Claim(
        **facts,
        measured=f"{format_rate(k, n)} against {format_rate(j, m)} succeeded",
        verdict=verdict_of(p < LEVEL and k / n < j / m, could_be_either=min(n, m) >= _MIN_RUNS),
        reason=with_shortfall(
            "The gripper's place in the world is off by the bias, which a person sees and a free object does not "
            f"heed. Holds if Fisher's exact test rejects at {format_share(LEVEL)} that both succeed equally often, and "
            f"those that fetch succeed less often: p = {format_p_value(p)}. " + unfinished_note([*gives, *receives]),
            min(n, m),
            _MIN_RUNS,
        ),
    )


def _alone(runs: NavigationRuns) -> Claim:
    facts: dict[str, Any] = {
        "claim": "No error of the navigation makes the robot let go, or close, with nobody at the gripper",
        "published": "",
        "beyond": True,
    }
    found = {v.label: runs.all_of(v) for v in VARIATIONS}
    rows: list[Row] = [row for rows_of in found.values() for row in rows_of]
    if not rows:
        return nothing_measured(**facts)
    acted = {what: acted_alone(rows_of) for what, rows_of in found.items()}
    count = sum(acted.values())
    where = ", ".join(f"{n} of {len(found[what])} with {what}" for what, n in acted.items() if n)
    return Claim(
        **facts,
        measured=f"{count} of {len(rows)} did, and {signalled(rows)} came to signal",
        verdict=verdict_of(count == 0, could_be_either=signalled(rows) >= _MIN_RUNS),
        reason=with_shortfall(
            "Holds if none did. A robot that never finds rest never signals, and says nothing of it. "
            + (f"It did: {where}. " if where else "")
            + unfinished_note(rows),
            signalled(rows),
            _MIN_RUNS,
        ),
    )
