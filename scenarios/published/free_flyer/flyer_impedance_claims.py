"""Claims on the free-flyer's impedance control: [Fernandes2020] sec. 4.1.3, and what its plots leave open."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from handover.scenarios.experiment.paper import paper_values
from handover.scenarios.free_flyer.parameters import Axis, Behaviour, ImpedanceParameters, Propulsion
from handover.scenarios.published.free_flyer.push_runs import (
    CHANGES,
    DURATIONS,
    PUSHES,
    PushRuns,
    predicted_greatest,
)
from handover.scenarios.published.free_flyer.variations import Row, is_done, unfinished_note, values_of
from handover.scenarios.published.published_experiment import Claim, Verdict
from handover.scenarios.published.verdicts import nothing_measured, verdict_of

_WHERE = "sec. 4.1.3"
_AS_PUBLISHED = 0.05
"""Part of a published ratio by which ours may differ: the thesis prints it without digits after the point."""
_EXACT = (0.001, 0.002)
"""By how much the motion may differ from eq. (4.4) without noise, m and rad."""
_PREDICTED = 0.05
"""Part of a greatest error by which the linear model's may differ."""


def claims_of_pushes(runs: PushRuns) -> Sequence[Claim]:
    """Judge the thesis's discussion, and beyond it what noise, limits and a wrong model do, and the linear model."""
    return [_ratio(runs), _yields_more(runs), _comes_back(runs), _agrees(runs), *_beyond(runs)]


def _ratio(runs: PushRuns) -> Claim:
    published = float(paper_values("free_flyer", "published")["compliant_over_rigid"])
    facts: dict[str, Any] = {
        "claim": "A force takes the compliant robot ten times as far as the rigid one",
        "published": f"{published:g}",
        "where": f"{_WHERE}, discussion",
    }
    found = {d: [r for axis in Axis if (r := runs.ratio(axis, d)) is not None] for d in DURATIONS}
    tried = {d: ratios for d, ratios in found.items() if len(ratios) == len(Axis)}
    if not tried:
        return nothing_measured(**facts)
    fits = [d for d, ratios in tried.items() if all(abs(r / published - 1.0) <= _AS_PUBLISHED for r in ratios)]
    usual = ImpedanceParameters().duration
    shown = [
        f"{min(tried[d]):.1f} to {max(tried[d]):.1f} after {d:g} s" for d in sorted({usual, max(tried)} & set(tried))
    ]
    decides = len(tried) == len(DURATIONS)
    first = f" It is so from {min(fits):g} s on." if fits else ""
    return Claim(
        **facts,
        measured=" and ".join(shown),
        verdict=verdict_of(bool(fits)) if decides else Verdict.NOT_COMPARABLE,
        reason="The thesis does not say how long its pushes lasted. Reproduced if there is a duration among those "
        f"tried, {min(DURATIONS):g} to {max(DURATIONS):g} s, at which the ratio is within {100 * _AS_PUBLISHED:.0f} % "
        f"of it along all three axes.{first}",
    )


def _yields_more(runs: PushRuns) -> Claim:
    facts: dict[str, Any] = {
        "claim": "Under every push the compliant robot yields more",
        "published": "in all directions",
        "where": f"{_WHERE}, discussion",
    }
    ratios: list[float] = []
    for push in PUSHES:
        rigid, compliant = (runs.of(push, b) for b in (Behaviour.RIGID, Behaviour.COMPLIANT))
        if rigid is not None and compliant is not None:
            ratios.append(float(compliant[push.metric]) / float(rigid[push.metric]))
    if not ratios:
        return nothing_measured(**facts)
    return Claim(
        **facts,
        measured=f"{min(ratios):.1f} to {max(ratios):.1f} times as much",
        verdict=verdict_of(min(ratios) > 1.0) if len(ratios) == len(PUSHES) else Verdict.NOT_COMPARABLE,
        reason="Reproduced if each of the six pushes moves the compliant robot's gripper farther, or turns it more, "
        "than the rigid one's.",
    )


def _comes_back(runs: PushRuns) -> Claim:
    facts: dict[str, Any] = {
        "claim": "The robot comes back to rest after a push",
        "published": "for both behaviours",
        "where": f"{_WHERE}, discussion",
    }
    rows = runs.all_of()
    if not rows:
        return nothing_measured(**facts)
    times = [float(row["settling_time"]) for row in rows if row.get("settling_time") is not None]
    within = f", within {max(times):.0f} s of the push's end" if times else ""
    return Claim(
        **facts,
        measured=f"{len(times)} of {len(rows)}{within}",
        verdict=_verdict_of_all(len(times), rows),
        reason=f"Reproduced if the gripper is back at rest within a minute in all twelve, with ideal thrust. "
        f"{unfinished_note(rows)}".strip(),
    )


def _agrees(runs: PushRuns) -> Claim:
    bounds: list[float] = paper_values("free_flyer", "published")["model_agreement"]
    return _agreement(
        {
            "claim": "The motion is the impedance model's",
            "published": f"within {1e3 * bounds[0]:.0f} mm and {np.degrees(bounds[1]):.1f}° ({bounds[1]:g} rad)",
            "where": f"{_WHERE}, eq. (4.4)",
        },
        runs.all_of(),
        (bounds[0], bounds[1]),
        "Reproduced",
    )


def _agreement(facts: dict[str, Any], rows: Sequence[Row], bounds: tuple[float, float], word: str) -> Claim:
    if not rows:
        return nothing_measured(**facts)
    off = [values_of(rows, f"disagreement_{what}").max(initial=0.0) for what in ("position", "orientation")]
    within = all(map(is_done, rows)) and off[0] <= bounds[0] and off[1] <= bounds[1]
    return Claim(
        **facts,
        measured=f"{1e3 * off[0]:.2f} mm and {np.degrees(off[1]):.3f}° at most, of {len(rows)}",
        verdict=verdict_of(within) if len(rows) == 2 * len(PUSHES) else Verdict.NOT_COMPARABLE,
        reason=f"{word} if no actual error differs from eq. (4.4)'s by more than {1e3 * bounds[0]:g} mm along an axis "
        f"or {np.degrees(bounds[1]):.2g}° in any of the twelve, with ideal thrust. {unfinished_note(rows)}".strip(),
    )


def _verdict_of_all(count: int, rows: Sequence[Row]) -> Verdict:
    return verdict_of(count == len(rows)) if len(rows) == 2 * len(PUSHES) else Verdict.NOT_COMPARABLE


def _beyond(runs: PushRuns) -> list[Claim]:
    exact: dict[str, Any] = {"claim": "Without noise of the navigation the motion is the impedance model's"}
    return [
        _agreement({**exact, "published": "", "beyond": True}, runs.all_of(exact=True), _EXACT, "Holds"),
        _foreseen(runs),
        _bears_limits(runs),
        _tells_wrong_models(runs),
    ]


def _foreseen(runs: PushRuns) -> Claim:
    facts: dict[str, Any] = {
        "claim": "The linear response of the controller's model predicts the greatest errors",
        "published": "",
        "beyond": True,
    }
    duration, off = ImpedanceParameters().duration, dict[str, float]()
    for behaviour in Behaviour:
        for push in PUSHES:
            if (row := runs.of(push, behaviour, exact=True)) is not None:
                predicted = predicted_greatest(push, behaviour, duration)
                off[f"{push.label}, {behaviour.item}"] = abs(float(row[push.metric]) / predicted - 1.0)
    if not off:
        return nothing_measured(**facts)
    most = max(off, key=lambda name: off[name])
    return Claim(
        **facts,
        measured=f"{100 * off[most]:.1f} % off at most ({most})",
        verdict=verdict_of(off[most] <= _PREDICTED) if len(off) == 2 * len(PUSHES) else Verdict.NOT_COMPARABLE,
        reason=f"Holds if it is within {100 * _PREDICTED:.0f} % of what ideal thrust and exact navigation give, under "
        "each push. It is the response near rest: a robot that turns by a radian is beyond that.",
    )


def _bears_limits(runs: PushRuns) -> Claim:
    facts: dict[str, Any] = {
        "claim": "With Astrobee's limits of thrust the robot comes back from the same pushes",
        "published": "",
        "beyond": True,
    }
    rows = runs.all_of(propulsion=Propulsion.LIMITED)
    if not rows:
        return nothing_measured(**facts)
    back = [row for row in rows if row.get("settling_time") is not None]
    twisted = sum(row["kind"] == "torque" for row in back)
    return Claim(
        **facts,
        measured=f"{len(back)} of {len(rows)}, {twisted} of them twists",
        verdict=_verdict_of_all(len(back), rows),
        reason="Holds if all twelve end at rest within a minute. What is published needs thrust without limits: 3 N·m "
        f"is forty times what Astrobee has. {unfinished_note(rows)}".strip(),
    )


def _tells_wrong_models(runs: PushRuns) -> Claim:
    bounds: list[float] = paper_values("free_flyer", "published")["model_agreement"]
    facts: dict[str, Any] = {
        "claim": "A mass or an inertia that is 30 % off shows in how far the motion departs from the model",
        "published": "",
        "beyond": True,
    }
    shown, cases, planned = 0, 0, 0
    for change in CHANGES:
        for behaviour in Behaviour:
            rows = [row for push in PUSHES if (row := runs.of(push, behaviour, change=change)) is not None]
            if change.name == "arm_factor":
                continue
            planned += 1
            if not rows:
                continue
            cases += 1
            shown += any(
                row["disagreement_position"] > bounds[0] or row["disagreement_orientation"] > bounds[1] for row in rows
            )
    if not cases:
        return nothing_measured(**facts)
    return Claim(
        **facts,
        measured=f"in {shown} of {cases} cases",
        verdict=verdict_of(shown == cases) if cases == planned else Verdict.NOT_COMPARABLE,
        reason="Holds if under one of the six pushes at least the motion is farther from eq. (4.4) than the thesis's "
        "bound, for each of mass and inertia, up and down, and both behaviours.",
    )
