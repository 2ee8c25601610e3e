"""Approaches to places where nobody is: how safely a robot at rest is told from one that is pulled or pushed."""

from collections.abc import Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from handover.scenarios.campaign.plan import CampaignPlan
from handover.scenarios.campaign.statistics import success_interval
from handover.scenarios.campaign.table import CampaignTable
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.paper import paper_values
from handover.scenarios.experiment.plotting import COLOURS, figure
from handover.scenarios.free_flyer.handovers import HandoverOfTask
from handover.scenarios.free_flyer.parameters import Behaviour
from handover.scenarios.published.free_flyer.flyer_handover_figures import legend_below
from handover.scenarios.published.free_flyer.handover_runs import (
    GIVING,
    RECEIVING,
    USUAL,
    Exchange,
    Variation,
    is_of,
    values_of,
)
from handover.scenarios.published.published_experiment import Claim, ComparisonTable, PublishedExperiment, Verdict
from handover.scenarios.published.verdicts import nothing_measured

_STOP = Fraction(36)
"""When a run ends, s: the robot has then waited for ten seconds or more."""
_LOW, _HIGH = (-0.10, -0.35, -0.25), (0.20, 0.20, 0.25)
"""Where it is to wait, m: within the person's and the robot's part of the cabin."""
_PLACES, _REPETITIONS = 125, 2
_OTHER_PLACES = 5
"""Places that robots which are otherwise than they should be fly to."""
_QUICK_PLACES = 5


def _noise(factor: float) -> Variation:
    usual = paper_values("free_flyer", "navigation")
    names = [f"{what}_noise" for what in ("position", "attitude", "velocity", "rate")]
    return Variation(f"noise x {factor:g}", {f"navigation.{name}": f"{factor * usual[name]:g}" for name in names})


CASES = (
    *(Variation(f"mass {100 * (k - 1):+.0f} %", {"mass_factor": f"{k:g}"}) for k in (0.7, 1.3)),
    *(Variation(f"inertia {100 * (k - 1):+.0f} %", {"inertia_factor": f"{k:g}"}) for k in (0.7, 1.3)),
    *(_noise(factor) for factor in (2.0, 4.0, 8.0)),
)
"""Robots whose mass or inertia is not what their controllers assume, or whose navigation is worse."""

_NAMES = tuple(dict.fromkeys(name for case in CASES for name in case.parameters))
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
        return [_never_alone(_Approaches(table)), _bears(_Approaches(table))]

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
    """Rows of the runs that came to their end, by what they are of."""

    def __init__(self, table: CampaignTable) -> None:
        self._rows = [row for row in table.rows if row["status"] == "done"]

    def of(self, exchange: Exchange, behaviour: Behaviour, case: Variation = USUAL) -> list[Mapping[str, Any]]:
        return [
            row
            for row in self._rows
            if row["task"] == exchange.task.item and row["behaviour"] == behaviour.item and is_of(row, case, _NAMES)
        ]

    def all_of(self, case: Variation = USUAL) -> list[Mapping[str, Any]]:
        return [row for exchange, behaviour in _kinds() for row in self.of(exchange, behaviour, case)]


def _signalled(rows: Sequence[Mapping[str, Any]]) -> int:
    return len(values_of(rows, "phase_check_velocity"))


def _alone(rows: Sequence[Mapping[str, Any]]) -> int:
    return int((values_of(rows, "unprovoked") > 0).sum())


def _never_alone(runs: _Approaches) -> Claim:
    facts: dict[str, Any] = {
        "claim": "The robot neither lets go nor closes its gripper where nobody is",
        "published": "",
        "beyond": True,
    }
    rows = [row for row in runs.all_of() if row.get("phase_check_velocity") is not None]
    if not rows:
        return nothing_measured(**facts)
    n, k = len(rows), _alone(rows)
    interval = success_interval(k, n)
    waited = sum(float(row["simulated_seconds"]) - float(row["phase_check_velocity"]) for row in rows)
    return Claim(
        **facts,
        measured=f"{k} of {n:,} approaches, in {waited / 3600:.1f} h of waiting",
        interval=(interval.low, interval.high),
        verdict=Verdict.NOT_COMPARABLE if n < 100 else (Verdict.REPRODUCED if k == 0 else Verdict.NOT_REPRODUCED),
        reason="Holds if it never happens, in a hundred approaches or more in which the robot came and signalled; the "
        "interval is Clopper and Pearson's.",
    )


def _bears(runs: _Approaches) -> Claim:
    facts: dict[str, Any] = {
        "claim": "So it is with mass or inertia 30 % off, and with twice the noise of the navigation",
        "published": "",
        "beyond": True,
    }
    mild = [case for case in CASES if "noise" not in case.label or case.label == _noise(2.0).label]
    found = {case.label: runs.all_of(case) for case in mild}
    rows = [row for rows_of in found.values() for row in rows_of]
    if not rows:
        return nothing_measured(**facts)
    failing = {what: (_alone(r), len(r) - _signalled(r), len(r)) for what, r in found.items()}
    faults = [f"{w}: acted alone {a}, never signalled {s} of {n}" for w, (a, s, n) in failing.items() if a or s]
    return Claim(
        **facts,
        measured=f"{_alone(rows)} of {len(rows)} acted alone, {_signalled(rows)} signalled",
        verdict=Verdict.REPRODUCED if not faults else Verdict.NOT_REPRODUCED,
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
                fastest = f"{1e3 * rest.max():.1f}" if len(rest) else ""
                margin = f"{threshold / rest.max():.1f}" if len(rest) and rest.max() > 0.0 else ""
                arrived = values_of(found, "arrival_error")
                rows.append(
                    [
                        case.label,
                        "gives" if exchange.gives else "receives",
                        behaviour.item,
                        f"{_signalled(found)} of {len(found)}",
                        str(_alone(found)),
                        f"{1e3 * arrived.max():.1f}" if len(arrived) else "",
                        fastest,
                        f"{1e3 * threshold:.0f}",
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
            "at rest, mm/s",
            "threshold, mm/s",
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
                    rest = 1e3 * exchange.of(runs.of(exchange, behaviour, case), "rest_speed")
                    axes.plot(rest, np.full(len(rest), k - 0.15 + 0.3 * int(behaviour)), "|", ms=8, color=colour)
                threshold = 1e3 * exchange.threshold(behaviour)
                axes.axvline(threshold, color=colour, ls=(0, (7, 3)), lw=1.0)
                axes.plot([], [], "|", ms=8, color=colour, label=behaviour.item)
            axes.plot([], [], color=COLOURS[5], ls=(0, (7, 3)), lw=1.0, label="threshold")
            axes.set_yticks(range(len(cases)), [label for label, _ in cases], fontsize=9)
            axes.set_ylim(len(cases) - 0.4, -0.6)
            axes.set(title="gives" if exchange.gives else "receives", xlim=(0.0, None), xlabel="speed at rest (mm/s)")
        panels[1].tick_params(labelleft=False)
        legend_below(panels[0])
    caption = (
        "Greatest speed of the gripper, as the robot sees it, while it waits where nobody is, of every approach; "
        "dashed: the thresholds of sec. 4.1.2, from which on it lets go or closes."
    )
    return [Figure("rest_speed", caption)]
