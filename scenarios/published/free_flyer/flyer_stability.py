"""Where the free-flyer's impedance loop is stable, by communication step and delay, beside its controller's poles."""

from collections.abc import Sequence
from functools import cache
from itertools import product
from pathlib import Path
from typing import ClassVar

import numpy as np

from handover.controllers.free_flyer.sampled_loop import largest_stable
from handover.cosim.exceptions import counted
from handover.cosim.stepping.options import Algorithm, MasterOptions
from handover.plants.free_flyer.robot.thrusters import Params as ThrustersParams
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.plotting import COLOURS
from handover.scenarios.published.claims import Statement
from handover.scenarios.published.figures import Mark, Panel, drawn
from handover.scenarios.published.free_flyer.linear_model import linear_loop
from handover.scenarios.published.published_experiment import Claim, ComparisonTable, PublishedExperiment
from handover.scenarios.published.runs import is_done
from handover.scenarios.published.tables import table_of
from handover.scenarios.robots.free_flyer.parameters import Behaviour
from handover.scenarios.robots.free_flyer.push.impedance import FlyerImpedance
from handover.scenarios.runs.campaign.plan import CampaignPlan
from handover.scenarios.runs.campaign.table import CampaignTable

_STEPS = (0.001, 0.002, 0.004, 0.008, 0.016)
"""Communication steps of a host that steps all units in parallel, s."""
_QUICK_STEP = 0.004
_DELAYS = {
    Behaviour.RIGID: tuple(round(0.002 * k, 3) for k in range(15)),
    Behaviour.COMPLIANT: (0.0, 0.04, *(round(0.06 + 0.008 * k, 3) for k in range(11))),
}
"""Delays of the thrust's command that are tried, s."""
_COUPLING_DELAYS = 3
"""Units between a motion and the thrust that answers it, each of which hands on its results a step late: navigation,
controller and thrusters."""
_MARGIN = 0.005
"""How far the largest pole must be from the unit circle for a run of half a minute to tell its side."""
_TWISTS = {Behaviour.RIGID: "1", Behaviour.COMPLIANT: "0.3"}
"""Torques, N m, that take the robot well out of what counts as rest: from there a growing oscillation is seen."""
_BESIDE = 0.0005
"""How far beyond the steps that were tried the poles' boundary is drawn, s."""
_NO_LIMITS = "1000,1000,1000"

Loop = tuple[Behaviour, bool]
"""A behaviour, and whether propulsion follows its command with a lag; it has no limits."""
_LOOPS: Sequence[Loop] = [*product(Behaviour, (False, True))]


def _label(loop: Loop) -> str:
    return f"{loop[0].item}, {'with' if loop[1] else 'without'} lag"


class FlyerStability(PublishedExperiment):
    """A twist on the robot, in a host that steps all units in parallel, with a delay unknown to the robot.

    Each unit hands on its results a communication step late, so three steps come on top of the thrust's own delay. The
    controller's linearised loop, with the sum of both as its delay, says by its poles where the robot comes to rest
    again; so do the runs. Thrust has no limits, which would turn a growing oscillation into a lasting one. The quick
    plan has one step and the rigid robot.
    """

    name: ClassVar[str] = "flyer-stability"
    title: ClassVar[str] = "where the free-flyer's impedance loop is stable, by step and delay (beyond [Fernandes2020])"
    scenario: ClassVar[str] = FlyerImpedance.name

    def plan(self, quick: bool) -> CampaignPlan:
        """Return loops x steps x delays."""
        ideal = {"propulsion": "ideal"}
        lagging = {"propulsion": "limited", "thrusters.f_max": _NO_LIMITS, "thrusters.tau_max": _NO_LIMITS}
        return self.campaign(
            [
                {
                    "behaviour": b.item,
                    "torque": _TWISTS[b],
                    **(lagging if lags else ideal),
                    "parallel_step": f"{step:g}",
                    "delay": f"{delay:g}",
                }
                for b, lags in _LOOPS
                if not (quick and b is Behaviour.COMPLIANT)
                for step in ((_QUICK_STEP,) if quick else _STEPS)
                for delay in _DELAYS[b]
            ],
            fixed={"kind": "torque", "axis": "y", "delay_known": "false", "patience": "30"},
            seed=5,
            options=MasterOptions(algorithm=Algorithm.JACOBI),
        )

    def claims(self, table: CampaignTable) -> Sequence[Claim]:
        """Judge whether runs and poles agree; runs in which a motion diverged until a unit failed are not at rest."""
        says = Statement("The robot comes to rest where its controller's poles say so, and nowhere else")
        compared = [
            (_pole_radius(b, lags, delay + _COUPLING_DELAYS * step), rests)
            for b, lags, step, delay, rests in _runs(table)
        ]
        clear = [(radius < 1.0, rests) for radius, rests in compared if abs(radius - 1.0) > _MARGIN]
        near = [(radius < 1.0, rests) for radius, rests in compared if abs(radius - 1.0) <= _MARGIN]
        if not clear:
            return [says.unknown()]
        diverged, lost = (
            sum(row["status"] == s and row.get("parallel_step") is not None for row in table.rows)
            for s in ("failed", "lost")
        )
        agree, stable = sum(said is rests for said, rests in clear), sum(said for said, _ in clear)
        claim = says.judged(
            f"{agree} of {counted(len(clear), 'run')}, of which {stable} are stable by their poles; "
            f"{len(near)} near the unit circle left out",
            agree == len(clear) and not lost,
            f"all do whose largest pole is more than {_MARGIN:g} from the unit circle, and none was lost",
            f"Of the {len(near)} nearer ones {sum(said is rests for said, rests in near)} agree. Runs that diverged "
            f"until a unit failed, {diverged}, count as not at rest; {lost} were lost.",
            enough=0 < stable < len(clear),
        )
        return [claim]

    def tables(self, table: CampaignTable) -> Sequence[ComparisonTable]:
        """Return, for each loop and step, up to which delay it is stable by its poles, and by the runs."""
        found = _runs(table)
        rows: list[dict[str, str]] = []
        for loop, step in product(_LOOPS, _STEPS):
            rest, unrest = _delays(found, loop, step)
            if rest or unrest:
                limit = _greatest_delay(*loop) - _COUPLING_DELAYS * step
                rows.append({
                    "robot": _label(loop),
                    "communication step, ms": f"{1e3 * step:g}",
                    "stable by its poles up to, ms": f"{1e3 * limit:.1f}",
                    "at rest up to, ms": f"{1e3 * max(rest):.0f}" if rest else "none",
                    "not from, ms": f"{1e3 * min(unrest):.0f}" if unrest else "none",
                })  # fmt: skip
        note = (
            "Delay of the thrust's command that the loop tolerates where all units step in parallel. It is found by "
            f"the poles of the controller's own loop, less {_COUPLING_DELAYS} communication steps, and by whether the "
            "robot comes to rest after a twist. Negative: not without delay either."
        )
        return [table_of("Stability by step and delay", rows, note)]

    def draw(self, table: CampaignTable, runs: Path, folder: Path) -> Sequence[Figure]:  # noqa: ARG002
        """Draw the map of each loop, with the poles' boundary."""
        found = _runs(table)
        panels = [_panel(found, loop) for loop in _LOOPS if any(of[:2] == loop for of in found)]
        caption = (
            "Whether the robot comes to rest after a twist where all units step in parallel, by communication step "
            "and delay of the thrust. The line: the largest pole of the controller's own loop is on the unit circle."
        )
        rows = (len(panels) + 1) // 2
        return drawn(folder / "stability", caption, panels, 2, size=(9.0, 0.6 + 2.9 * rows))


Run = tuple[Behaviour, bool, float, float, bool]
"""Loop, communication step and delay, s, and whether the robot came to rest."""


def _runs(table: CampaignTable) -> list[Run]:
    """Return the runs of which something is known."""
    return [
        (
            Behaviour[str(row["behaviour"]).upper()],
            row["propulsion"] == "limited",
            float(row["parallel_step"]),
            float(row["delay"]),
            is_done(row) and row.get("settling_time") is not None,
        )
        for row in table.rows
        if row.get("parallel_step") is not None and row["status"] != "lost"
    ]


def _delays(found: Sequence[Run], loop: Loop, step: float) -> tuple[list[float], list[float]]:
    """Return the delays at which the robot came to rest, and those at which it did not, s."""
    rest, unrest = ([of[3] for of in found if of[:3] == (*loop, step) and of[4] is rests] for rests in (True, False))
    return rest, unrest


def _panel(found: Sequence[Run], loop: Loop) -> Panel:
    tried = [of for of in found if of[:2] == loop]
    marks = [
        Mark.through([(1e3 * of[2], 1e3 * of[3]) for of in tried if of[4] is rests], form, COLOURS[k], label)
        for k, (rests, form, label) in enumerate(((True, "o", "came to rest"), (False, "x", "did not")))
        if any(of[4] is rests for of in tried)
    ]
    steps = np.array([min(of[2] for of in tried) - _BESIDE, max(of[2] for of in tried) + _BESIDE])
    limit = 1e3 * (_greatest_delay(*loop) - _COUPLING_DELAYS * steps)
    most = 1e3 * max(_DELAYS[loop[0]])
    axes = {"title": _label(loop), "xlabel": "communication step (ms)", "ylabel": "delay of the thrust (ms)"}
    limits = {"xlim": (0.0, 17.0), "ylim": (-0.04 * most, 1.04 * most)}
    return Panel([*marks, Mark(1e3 * steps, limit, label="|z| = 1 by its poles")], {**axes, **limits})


def _pole_radius(behaviour: Behaviour, lags: bool, delay: float) -> float:
    """Return the largest |z| of the controller's loop with a delay, s, to the microsecond."""
    lag = float(ThrustersParams().lag) if lags else 0.0
    return linear_loop(behaviour, lag, round(delay, 6)).pole_radius


@cache
def _greatest_delay(behaviour: Behaviour, lags: bool) -> float:
    """Return about the largest delay with which the controller's loop is stable, s."""
    return largest_stable(lambda delay: _pole_radius(behaviour, lags, delay), upper=0.3, steps=12)
