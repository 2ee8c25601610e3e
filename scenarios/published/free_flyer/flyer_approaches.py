"""Approaches to places where nobody is: how safely a robot at rest differs from one that is pulled or pushed."""

from collections.abc import Sequence
from fractions import Fraction
from itertools import product
from pathlib import Path
from typing import ClassVar

import numpy as np

from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.plotting import COLOURS
from handover.scenarios.published.claims import Statement
from handover.scenarios.published.figures import Mark, Panel, drawn, strip, upright
from handover.scenarios.published.free_flyer.handovers import (
    GIVING,
    RECEIVING,
    USUAL,
    Exchange,
    Variation,
    acted_alone,
    every_of,
    factor_of,
    noise_times,
    unfinished_note,
)
from handover.scenarios.published.published_experiment import Claim, ComparisonTable, PublishedExperiment
from handover.scenarios.published.runs import Runs, is_known
from handover.scenarios.published.tables import number, table_of
from handover.scenarios.robots.free_flyer.handover.handovers import HandoverOfTask
from handover.scenarios.robots.free_flyer.parameters import Behaviour
from handover.scenarios.runs.campaign.plan import CampaignPlan
from handover.scenarios.runs.campaign.statistics import success_interval
from handover.scenarios.runs.campaign.table import CampaignTable

_STOP = Fraction(36)
"""When a run ends, s: the robot has then waited for ten seconds or more."""
_LOW, _HIGH = (-0.10, -0.35, -0.25), (0.20, 0.20, 0.25)
"""Where it is to wait, m: within the person's and the robot's part of the cabin."""
_PLACES, _REPETITIONS, _QUICK_PLACES = 125, 2, 5
_OTHER_PLACES = 5
"""Places that robots which are otherwise than they should be fly to."""
_MIN_APPROACHES = 100
"""Approaches of which it is concluded that something never happens."""
_MILD = (
    *(factor_of("mass", "mass_factor", k) for k in (0.7, 1.3)),
    *(factor_of("inertia", "inertia_factor", k) for k in (0.7, 1.3)),
    noise_times(2.0),
)
CASES = (*_MILD, noise_times(4.0), noise_times(8.0))
"""Robots whose mass or inertia is not what their controllers assume, or whose navigation is worse."""
_KINDS = [*product((GIVING, RECEIVING), Behaviour)]
_SHOWN = {"as it should be": USUAL, **{case.label: case for case in CASES}}


def places(n: int) -> list[str]:
    """Return the first of the random places of handovers, as texts."""
    drawn_places = np.random.default_rng(0).uniform(_LOW, _HIGH, (n, 3))
    return [",".join(f"{x:.3f}" for x in place) for place in drawn_places.tolist()]


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
        tried = [*product((USUAL,), places(_QUICK_PLACES if quick else _PLACES), _KINDS)]
        tried += [] if quick else product(CASES, places(_OTHER_PLACES), _KINDS)
        points = [
            {"task": e.task.item, "behaviour": b.item, "p_WG_handover": place, **case.parameters}
            for case, place, (e, b) in tried
        ]
        repetitions = 1 if quick else _REPETITIONS
        return self.campaign(points, fixed={"person.motion": "none"}, repetitions=repetitions, seed=1, stop=_STOP)

    def claims(self, table: CampaignTable) -> Sequence[Claim]:
        """Judge whether the robot ever acts with nobody there, as it should be, and otherwise."""
        runs = self._runs(table)
        return [_never_alone(_all_of(runs, USUAL)), _tolerates({c.label: _all_of(runs, c) for c in _MILD})]

    def tables(self, table: CampaignTable) -> Sequence[ComparisonTable]:
        """Return how often the robot signalled and acted, and its speed at rest beside the threshold."""
        runs = self._runs(table)
        cases = [(label, e, b, _of(runs, e, b, case)) for label, case in _SHOWN.items() for e, b in _KINDS]
        return [
            table_of(
                "Approaches to places where nobody is",
                [_row(*case) for case in cases if len(case[-1])],
                "How many robots came, found rest and signalled; how many then let go or closed though nobody touched "
                "them. Distance and speed are the greatest: from the place as they began to yield, and of the gripper, "
                "as they measured it, while they waited.",
            )
        ]

    def draw(self, table: CampaignTable, runs: Path, folder: Path) -> Sequence[Figure]:  # noqa: ARG002
        """Draw the greatest speed at rest of every approach beside the thresholds."""
        found = self._runs(table)
        shown = {label: case for label, case in _SHOWN.items() if len(_all_of(found, case))}
        panels = [_panel(found, exchange, shown) for exchange in (GIVING, RECEIVING)] if shown else []
        caption = (
            "Greatest speed of the gripper, as the robot sees it, while it waits where nobody is, of every approach. "
            "Dashed: the thresholds of sec. 4.1.2, from which on it lets go or closes."
        )
        return drawn(folder / "rest_speed", caption, panels, 2, size=(8.0, 1.6 + 0.34 * len(shown)))

    def _runs(self, table: CampaignTable) -> Runs:
        """Return all runs, also those that did not come to their end: they never signalled."""
        return self.runs(table, is_known, free=("p_WG_handover",))


def _of(runs: Runs, exchange: Exchange, behaviour: Behaviour, case: Variation) -> Runs:
    return runs.of({"task": exchange.task.item, "behaviour": behaviour.item, **case.parameters})


def _all_of(runs: Runs, case: Variation) -> Runs:
    return every_of([_of(runs, e, b, case) for e, b in _KINDS])


def _signalled(runs: Runs) -> int:
    return len(runs.metric("phase_check_velocity"))


def _never_alone(tried: Runs) -> Claim:
    says = Statement("The robot neither lets go nor closes its gripper where nobody is")
    runs = tried.where(lambda row: row.get("phase_check_velocity") is not None)
    if not len(runs):
        return says.unknown()
    n, k, silent = len(runs), acted_alone(runs), len(tried) - len(runs)
    waited = sum(float(row["simulated_seconds"]) - float(row["phase_check_velocity"]) for row in runs)
    return says.judged(
        f"{k} of {n:,} approaches, in {waited / 3600:.1f} h of waiting",
        k == 0 and not silent,
        "it never happens, and each robot comes and signals",
        f"{silent} others never signalled. {unfinished_note(tried)}",
        runs=(n, _MIN_APPROACHES),
        interval=success_interval(k, n),
    )


def _tolerates(found: dict[str, Runs]) -> Claim:
    says = Statement("So it is with mass or inertia 30 % off, and with twice the noise of the navigation")
    runs = every_of([*found.values()])
    if not len(runs):
        return says.unknown()
    failing = {what: (acted_alone(of), len(of) - _signalled(of), len(of)) for what, of in found.items()}
    faults = [f"{w}: acted alone {a}, never signalled {s} of {n}" for w, (a, s, n) in failing.items() if a or s]
    return says.judged(
        f"{acted_alone(runs)} of {len(runs)} acted alone, {_signalled(runs)} signalled",
        not faults,
        "every such robot comes, signals, and neither lets go nor closes",
        f"It did not: {'; '.join(faults)}." if faults else "",
    )


def _row(label: str, exchange: Exchange, behaviour: Behaviour, runs: Runs) -> dict[str, str]:
    rest, threshold = exchange.of(runs, "rest_speed"), exchange.threshold(behaviour)
    return {
        "robot": label,
        "it": "gives" if exchange.gives else "receives",
        "behaviour": behaviour.item,
        "signalled": f"{_signalled(runs)} of {len(runs)}",
        "acted alone": str(acted_alone(runs)),
        "off its place, mm": number(1e3 * runs.metric("arrival_error"), ".1f", np.max),
        "at rest, m/s": number(rest, ".4f", np.max),
        "threshold, m/s": f"{threshold:.3f}",
        "threshold over rest": f"{threshold / rest.max():.1f}" if rest.max(initial=0.0) > 0.0 else "",
    }


def _panel(runs: Runs, exchange: Exchange, shown: dict[str, Variation]) -> Panel:
    marks = [Mark(label="threshold", style={"ls": "--"})]
    lines = [upright(exchange.threshold(b), COLOURS[b]) for b in Behaviour]
    for b in Behaviour:
        marks.append(Mark(form="|", colour=COLOURS[b], label=b.item, style={"ms": 8}))
        for k, case in enumerate(shown.values()):
            rest = exchange.of(_of(runs, exchange, b, case), "rest_speed")
            marks += strip(k, [Mark(rest, 0.3 * b - 0.15, "|", COLOURS[b], style={"ms": 8})])
    axes = {"title": "gives" if exchange.gives else "receives", "xlabel": "speed at rest (m/s)"}
    return Panel([*lines, *marks], {**axes, "xlim": (0.0, None), "ylim": (len(shown) - 0.4, -0.6)},
                 y_ticks=dict(enumerate(shown)))  # fmt: skip
