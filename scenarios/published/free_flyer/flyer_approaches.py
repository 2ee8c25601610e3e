"""Approaches to places where nobody is: how safely a robot at rest is told from one that is pulled or pushed."""

from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from handover.scenarios.campaign.plan import CampaignPlan
from handover.scenarios.campaign.statistics import success_interval
from handover.scenarios.campaign.table import CampaignTable
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.plotting import COLOURS, figure, legend_below
from handover.scenarios.free_flyer.handover.handovers import HandoverOfTask
from handover.scenarios.free_flyer.parameters import Behaviour, TaskParameters
from handover.scenarios.published.free_flyer.handover_runs import GIVING, RECEIVING, Exchange
from handover.scenarios.published.free_flyer.variations import (
    USUAL,
    Row,
    Variation,
    acted_alone,
    has,
    names_of,
    noise_times,
    unfinished_note,
    values_of,
)
from handover.scenarios.published.published_experiment import Claim, ComparisonTable, PublishedExperiment
from handover.scenarios.published.verdicts import nothing_measured, verdict_of

_DEFAULT = TaskParameters()
_STOP = Fraction(36)
"""When a run ends, s: the robot has then waited for ten seconds or more."""
_LOW, _HIGH = (-0.10, -0.35, -0.25), (0.20, 0.20, 0.25)
"""Where it is to wait, m: within the person's and the robot's part of the cabin."""
_PLACES, _REPETITIONS = 125, 2
_OTHER_PLACES = 5
"""Places that robots which are otherwise than they should be fly to."""
_QUICK_PLACES = 5
_MIN_APPROACHES = 100
"""Approaches of which it is concluded that something never happens."""


_MILD = (
    *(Variation(f"mass {100 * (k - 1):+.0f} %", {"mass_factor": f"{k:g}"}) for k in (0.7, 1.3)),
    *(Variation(f"inertia {100 * (k - 1):+.0f} %", {"inertia_factor": f"{k:g}"}) for k in (0.7, 1.3)),
    noise_times(2.0),
)
CASES = (*_MILD, noise_times(4.0), noise_times(8.0))
"""Robots whose mass or inertia is not what their controllers assume, or whose navigation is worse."""

_NAMES = names_of(CASES)
_EXCHANGES = (GIVING, RECEIVING)


def places(n: int) -> list[str]:
    """Return the first of the random places of handovers, as texts."""
    drawn = np.random.default_rng(0).uniform(_LOW, _HIGH, (n, 3))
    return [",".join(f"{x:.3f}" for x in place) for place in drawn.tolist()]


class FlyerApproaches(PublishedExperiment):
    """A robot comes to one of 125 random places, with the object or for it, signals, and nobody is there.

    Both behaviours do so twice at every place, as they give and as they receive: 1,000 approaches. At five places they
    do it, too, with mass or inertia 30 % off what their controllers assume, and with a navigation 2 to 8 times as
    noisy. The thesis has no such runs. No run is a success: there is nobody to hand anything to.
    """

    name: ClassVar[str] = "flyer-approaches"
    title: ClassVar[str] = "a free-flyer waits where nobody is ([Fernandes2020] sec. 4.1.2: its velocity thresholds)"
    scenario: ClassVar[str] = HandoverOfTask.name

    def plan(self, quick: bool) -> CampaignPlan:
        """Return places x behaviours x directions, and robots that are otherwise; if quick, a few places."""
        points = [_point(place, e, b) for place in places(_QUICK_PLACES if quick else _PLACES) for e, b in _kinds()]
        if not quick:
            some = places(_OTHER_PLACES)
            points += [_point(place, e, b, case) for case in CASES for place in some for e, b in _kinds()]
        return CampaignPlan(
            scenario=self.scenario,
            points=points,
            fixed={"person.motion": "none"},
            repetitions=1 if quick else _REPETITIONS,
            seed=1,
            stop=_STOP,
            experiment=self.name,
        )

    def claims(self, table: CampaignTable) -> Sequence[Claim]:
        """Judge whether the robot ever acts with nobody there, as it should be, and otherwise."""
        return [_never_alone(_Approaches(table)), _tolerates(_Approaches(table))]

    def tables(self, table: CampaignTable) -> Sequence[ComparisonTable]:
        """Return how often the robot signalled and acted, and its speed at rest beside the threshold."""
        return [_table(_Approaches(table))]

    def draw(self, table: CampaignTable, runs: Path, folder: Path) -> Sequence[Figure]:  # noqa: ARG002
        """Draw the greatest speed at rest of every approach beside the thresholds."""
        return _draw(_Approaches(table), folder)


def _kinds() -> list[tuple[Exchange, Behaviour]]:
    return [(exchange, behaviour) for exchange in _EXCHANGES for behaviour in Behaviour]


def _point(place: str, exchange: Exchange, behaviour: Behaviour, case: Variation = USUAL) -> dict[str, str]:
    given = {"task": exchange.task.item, "behaviour": behaviour.item, "p_WG_handover": place}
    return {**given, **case.parameters}


class _Approaches:
    """Rows of the runs by what they are of, also of those that did not come to their end: they never signalled."""

    def __init__(self, table: CampaignTable) -> None:
        self._rows: Sequence[Row] = table.rows

    def of(self, exchange: Exchange, behaviour: Behaviour, case: Variation = USUAL) -> list[Row]:
        wanted = {"task": exchange.task.item, "behaviour": behaviour.item, **case.parameters}
        return [row for row in self._rows if has(row, wanted, _NAMES, _DEFAULT)]

    def all_of(self, case: Variation = USUAL) -> list[Row]:
        return [row for exchange, behaviour in _kinds() for row in self.of(exchange, behaviour, case)]


def _signalled(rows: Sequence[Row]) -> int:
    return len(values_of(rows, "phase_check_velocity"))


def _never_alone(runs: _Approaches) -> Claim:
    facts: dict[str, Any] = {
        "claim": "The robot neither lets go nor closes its gripper where nobody is",
        "published": "",
        "beyond": True,
    }
    tried = runs.all_of()
    rows = [row for row in tried if row.get("phase_check_velocity") is not None]
    if not rows:
        return nothing_measured(**facts)
    silent = len(tried) - len(rows)
    n, k = len(rows), acted_alone(rows)
    interval = success_interval(k, n)
    waited = sum(float(row["simulated_seconds"]) - float(row["phase_check_velocity"]) for row in rows)
    return Claim(
        **facts,
        measured=f"{k} of {n:,} approaches, in {waited / 3600:.1f} h of waiting",
        interval=(interval.low, interval.high),
        verdict=verdict_of(k == 0 and not silent, could_be_either=n >= _MIN_APPROACHES),
        reason=f"Holds if it never happens, in {_MIN_APPROACHES} approaches or more, in each of which the robot came "
        f"and signalled; {silent} others never signalled. The interval is Clopper and Pearson's. "
        f"{unfinished_note(tried)}".strip(),
    )


def _tolerates(runs: _Approaches) -> Claim:
    facts: dict[str, Any] = {
        "claim": "So it is with mass or inertia 30 % off, and with twice the noise of the navigation",
        "published": "",
        "beyond": True,
    }
    found = {case.label: runs.all_of(case) for case in _MILD}
    rows = [row for rows_of in found.values() for row in rows_of]
    if not rows:
        return nothing_measured(**facts)
    failing = {what: (acted_alone(r), len(r) - _signalled(r), len(r)) for what, r in found.items()}
    faults = [f"{w}: acted alone {a}, never signalled {s} of {n}" for w, (a, s, n) in failing.items() if a or s]
    return Claim(
        **facts,
        measured=f"{acted_alone(rows)} of {len(rows)} acted alone, {_signalled(rows)} signalled",
        verdict=verdict_of(not faults),
        reason="Holds if every such robot comes, signals, and neither lets go nor closes. "
        + (f"It did not: {'; '.join(faults)}." if faults else ""),
    )


def _table(runs: _Approaches) -> ComparisonTable:
    rows: list[list[str]] = []
    for case in (Variation("as it should be"), *CASES):
        for exchange, behaviour in _kinds():
            found = runs.of(exchange, behaviour, case)
            if found:
                rest, threshold = exchange.of(found, "rest_speed"), exchange.threshold(behaviour)
                fastest = f"{rest.max():.4f}" if len(rest) else ""
                margin = f"{threshold / rest.max():.1f}" if len(rest) and rest.max() > 0.0 else ""
                arrived = values_of(found, "arrival_error")
                rows.append(
                    [
                        case.label,
                        "gives" if exchange.gives else "receives",
                        behaviour.item,
                        f"{_signalled(found)} of {len(found)}",
                        str(acted_alone(found)),
                        f"{1e3 * arrived.max():.1f}" if len(arrived) else "",
                        fastest,
                        f"{threshold:.3f}",
                        margin,
                    ]
                )
    return ComparisonTable(
        title="Approaches to places where nobody is",
        header=[
            "robot",
            "it",
            "behaviour",
            "signalled",
            "acted alone",
            "off its place, mm",
            "at rest, m/s",
            "threshold, m/s",
            "threshold over rest",
        ],
        rows=rows,
        note="How many robots came, found rest and signalled; how many then let go or closed though nobody touched "
        "them; and the greatest, over these runs, of their distance from the place as they began to yield and of the "
        "speed that they saw of their gripper while they waited.",
    )


def _draw(runs: _Approaches, folder: Path) -> list[Figure]:
    cases = [(label, case) for label, case in (("as it should be", USUAL), *((c.label, c) for c in CASES))]
    cases = [(label, case) for label, case in cases if runs.all_of(case)]
    if not cases:
        return []
    with figure(folder / "rest_speed", 1, 2, size=(8.0, 1.6 + 0.34 * len(cases))) as panels:
        for axes, exchange in zip(panels, _EXCHANGES, strict=True):
            for behaviour in Behaviour:
                colour = COLOURS[int(behaviour)]
                for k, (_, case) in enumerate(cases):
                    rest = exchange.of(runs.of(exchange, behaviour, case), "rest_speed")
                    axes.plot(rest, np.full(len(rest), k - 0.15 + 0.3 * int(behaviour)), "|", ms=8, color=colour)
                threshold = exchange.threshold(behaviour)
                axes.axvline(threshold, color=colour, ls=(0, (7, 3)), lw=1.0)
                axes.plot([], [], "|", ms=8, color=colour, label=behaviour.item)
            axes.plot([], [], color=COLOURS[5], ls=(0, (7, 3)), lw=1.0, label="threshold")
            axes.set_yticks(range(len(cases)), [label for label, _ in cases], fontsize=9)
            axes.set_ylim(len(cases) - 0.4, -0.6)
            axes.set(title="gives" if exchange.gives else "receives", xlim=(0.0, None), xlabel="speed at rest (m/s)")
        panels[1].tick_params(labelleft=False)
        legend_below(panels[0])
    caption = (
        "Greatest speed of the gripper, as the robot sees it, while it waits where nobody is, of every approach; "
        "dashed: the thresholds of sec. 4.1.2, from which on it lets go or closes."
    )
    return [Figure("rest_speed", caption)]
