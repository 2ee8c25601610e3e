"""Where the free-flyer's impedance loop is stable, by communication step and delay, beside its controller's poles."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from handover.controllers.free_flyer.sampled_loop import largest_stable
from handover.cosim.stepping.options import Algorithm, MasterOptions
from handover.plants.free_flyer.robot.thrusters import Params as ThrustersParams
from handover.scenarios.campaign.plan import CampaignPlan
from handover.scenarios.campaign.table import CampaignTable
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.plotting import COLOURS, figure, legend_below
from handover.scenarios.free_flyer.parameters import Behaviour
from handover.scenarios.free_flyer.push.impedance import FlyerImpedance
from handover.scenarios.published.free_flyer.push_runs import linear_loop
from handover.scenarios.published.free_flyer.variations import is_done
from handover.scenarios.published.published_experiment import Claim, ComparisonTable, PublishedExperiment
from handover.scenarios.published.verdicts import nothing_measured, verdict_of

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
_WITHOUT_LIMITS = {"thrusters.f_max": "1000,1000,1000", "thrusters.tau_max": "1000,1000,1000"}


@dataclass(frozen=True)
class _Loop:
    """A behaviour, with propulsion that follows its command at once or with a lag; neither has limits."""

    behaviour: Behaviour
    lags: bool

    @property
    def label(self) -> str:
        return f"{self.behaviour.item}, {'with' if self.lags else 'without'} lag"

    @property
    def parameters(self) -> dict[str, str]:
        propulsion = {"propulsion": "limited", **_WITHOUT_LIMITS} if self.lags else {"propulsion": "ideal"}
        return {"behaviour": self.behaviour.item, "torque": _TWISTS[self.behaviour], **propulsion}


_LOOPS = tuple(_Loop(behaviour, lags) for behaviour in Behaviour for lags in (False, True))


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
        return CampaignPlan(
            scenario=self.scenario,
            points=[
                {**loop.parameters, "parallel_step": f"{step:g}", "delay": f"{delay:g}"}
                for loop in _LOOPS
                if not (quick and loop.behaviour is Behaviour.COMPLIANT)
                for step in ((_QUICK_STEP,) if quick else _STEPS)
                for delay in _DELAYS[loop.behaviour]
            ],
            fixed={"kind": "torque", "axis": "y", "delay_known": "false", "patience": "30"},
            seed=5,
            options=MasterOptions(algorithm=Algorithm.JACOBI),
            experiment=self.name,
        )

    def claims(self, table: CampaignTable) -> Sequence[Claim]:
        """Judge whether runs and poles agree."""
        return [_agrees(_Map(table))]

    def tables(self, table: CampaignTable) -> Sequence[ComparisonTable]:
        """Return, for each loop and step, up to which delay it is stable by its poles, and by the runs."""
        found = _Map(table)
        rows: list[list[str]] = []
        for loop in _LOOPS:
            for step in _STEPS:
                rest, unrest = (found.delays(loop, step, at_rest=at_rest) for at_rest in (True, False))
                if rest or unrest:
                    most = f"{1e3 * max(rest):.0f}" if rest else "none"
                    least = f"{1e3 * min(unrest):.0f}" if unrest else "none"
                    limit = _greatest_delay(loop) - _COUPLING_DELAYS * step
                    rows.append([loop.label, f"{1e3 * step:g}", f"{1e3 * limit:.1f}", most, least])
        header = [
            "robot",
            "communication step, ms",
            "stable by its poles up to, ms",
            "at rest up to, ms",
            "not from, ms",
        ]
        note = (
            "Delay of the thrust's command that the loop tolerates where all units step in parallel: by the poles of "
            f"the controller's own loop, less {_COUPLING_DELAYS} communication steps, and by whether the robot comes "
            "to rest after a twist. Negative: not without delay either."
        )
        return [ComparisonTable(title="Stability by step and delay", header=header, rows=rows, note=note)]

    def draw(self, table: CampaignTable, runs: Path, folder: Path) -> Sequence[Figure]:  # noqa: ARG002
        """Draw the map of each loop, with the poles' boundary."""
        found = _Map(table)
        shown = [loop for loop in _LOOPS if found.steps(loop)]
        rows = (len(shown) + 1) // 2
        if not shown:
            return []
        with figure(folder / "stability", rows, 2, size=(9.0, 0.6 + 2.9 * rows)) as panels:
            for axis, loop in zip(panels, shown, strict=False):
                for at_rest, mark, label in ((True, "o", "came to rest"), (False, "x", "did not")):
                    points = [(1e3 * s, 1e3 * d) for s in _STEPS for d in found.delays(loop, s, at_rest=at_rest)]
                    x, y = zip(*points, strict=True) if points else ((), ())
                    axis.plot(x, y, mark, ms=5, color=COLOURS[0 if at_rest else 1], label=label)
                tried = found.steps(loop)
                steps = np.array([min(tried) - _BESIDE, max(tried) + _BESIDE])
                limit = 1e3 * (_greatest_delay(loop) - _COUPLING_DELAYS * steps)
                axis.plot(1e3 * steps, limit, color=COLOURS[5], lw=1.2, label="|z| = 1 by its poles")
                most = 1e3 * max(_DELAYS[loop.behaviour])
                axis.set(title=loop.label, xlim=(0.0, 17.0), ylim=(-0.04 * most, 1.04 * most))
                axis.set(xlabel="communication step (ms)", ylabel="delay of the thrust (ms)")
            for axis in panels[len(shown) :]:
                axis.set_visible(False)
            legend_below(panels[0])
        caption = (
            "Whether the robot comes to rest after a twist where all units step in parallel, by communication step and "
            "delay of the thrust, and where the largest pole of the controller's own loop is on the unit circle."
        )
        return [Figure("stability", caption)]


class _Map:
    """The runs by loop, step and delay, also those in which a unit failed: a motion that diverges ends so.

    Attributes:
        diverged: how many of them there are; they did not come to rest.
        lost: runs of which nothing is known, since no worker came back with them.
    """

    def __init__(self, table: CampaignTable) -> None:
        self._at_rest: dict[tuple[_Loop, float, float], bool] = {}
        rows = [row for row in table.rows if row.get("parallel_step") is not None]
        self.lost = sum(row["status"] == "lost" for row in rows)
        self.diverged = sum(row["status"] == "failed" for row in rows)
        for row in rows:
            if row["status"] != "lost":
                behaviour = Behaviour[str(row["behaviour"]).upper()]
                loop = _Loop(behaviour, lags=row["propulsion"] == "limited")
                key = loop, float(row["parallel_step"]), float(row["delay"])
                self._at_rest[key] = is_done(row) and row.get("settling_time") is not None

    def delays(self, loop: _Loop, step: float, *, at_rest: bool) -> list[float]:
        """Return the delays at which the robot came to rest, or did not, s."""
        return [d for (l, s, d), rests in self._at_rest.items() if (l, s) == (loop, step) and rests is at_rest]

    def steps(self, loop: _Loop) -> set[float]:
        """Return the communication steps that were tried, s."""
        return {s for l, s, _ in self._at_rest if l == loop}

    def compared(self) -> list[tuple[float, bool]]:
        """Return the largest pole's |z| and whether the robot came to rest, for each run."""
        return [(_pole_radius(l, d + _COUPLING_DELAYS * s), rests) for (l, s, d), rests in self._at_rest.items()]


def _agrees(found: _Map) -> Claim:
    facts: Mapping[str, Any] = {
        "claim": "The robot comes to rest where its controller's poles say so, and nowhere else",
        "published": "",
        "beyond": True,
    }
    compared = found.compared()
    clear = [(radius < 1.0, rests) for radius, rests in compared if abs(radius - 1.0) > _MARGIN]
    near = [(radius < 1.0, rests) for radius, rests in compared if abs(radius - 1.0) <= _MARGIN]
    if not clear:
        return nothing_measured(**facts)
    agree, stable = sum(said is rests for said, rests in clear), sum(said for said, _ in clear)
    either = 0 < stable < len(clear)
    return Claim(
        **facts,
        measured=f"{agree} of {len(clear)} runs, of which {stable} are stable by their poles; {len(near)} near the "
        "unit circle left out",
        verdict=verdict_of(agree == len(clear) and not found.lost, could_be_either=either),
        reason=f"Holds if all do whose largest pole is more than {_MARGIN:g} from the unit circle. Nearer to it a run "
        f"of half a minute cannot show its side: {len(near)} of {len(compared)} runs are left out, of which "
        f"{sum(said is rests for said, rests in near)} agree. Runs that diverged until a unit failed, "
        f"{found.diverged}, count as not at rest; {found.lost} were lost.",
    )


def _pole_radius(loop: _Loop, delay: float) -> float:
    """Return the largest |z| of the controller's loop with a delay, s, to the microsecond."""
    lag = float(ThrustersParams().lag) if loop.lags else 0.0
    return linear_loop(loop.behaviour, lag, round(delay, 6)).pole_radius


@cache
def _greatest_delay(loop: _Loop) -> float:
    """Return about the largest delay with which the controller's loop is stable, s."""
    return largest_stable(lambda delay: _pole_radius(loop, delay), upper=0.3, steps=12)
