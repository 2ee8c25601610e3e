"""The use case of [Vervloet2025], fig. 13: the Helix takes a ball from a hand and drops it into a bowl."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle

from handover.cosim.blocks.ports import Floats
from handover.plants.helix.hand.partner_parameters import Holder
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.paper import paper_values
from handover.scenarios.experiment.plotting import COLOURS
from handover.scenarios.published.figures import Drawable, Mark, Panel, drawn, records_of
from handover.scenarios.published.helix.helix_cases import reasons_of
from handover.scenarios.published.published_experiment import Claim, ComparisonTable, PublishedExperiment
from handover.scenarios.published.runs import Runs
from handover.scenarios.published.tables import of, table_of
from handover.scenarios.published.verdicts import every_claim, format_median
from handover.scenarios.robots.helix.helix_use_case import UseCaseParameters
from handover.scenarios.robots.helix.parameters import HandPlace, Tuning
from handover.scenarios.runs.campaign.plan import CampaignPlan
from handover.scenarios.runs.campaign.table import CampaignTable

_PATIENCE = 600.0
"""Time to reach the ball, and again to reach the bowl, s: as long as the scenario allows."""

_WHERE = "secs. 3.5.3 and 4.4, fig. 13"


_TITLES = {Tuning.THESIS: "the thesis's settings", Tuning.OWN: "our settings"}
"""Whose settings, in words."""
_GREY = "#4d5866"


class Helix3(PublishedExperiment):
    """Eight use cases at the first experiment's four places, with the thesis's settings; and the same with ours.

    The thesis states the step size and the number of runs; ours are at the scenario's own step size and period. Assumed
    are the hand's places, those of the first experiment, and the bowl's place and size. So is the error at which the
    gripper opens: that at which it closes. The quick plan is a run with either settings at one place.
    """

    name: ClassVar[str] = "helix-3"
    title: ClassVar[str] = "the Helix takes a ball from a hand and drops it into a bowl ([Vervloet2025] fig. 13)"
    scenario: ClassVar[str] = "helix_use_case"

    def plan(self, quick: bool) -> CampaignPlan:
        """Return place for the thesis's settings and ours, each twice; if quick, a place."""
        published = paper_values("helix", "published")
        alphas: list[float] = paper_values("helix", "experiment")["alpha"]
        period = published["timestep_mean"][alphas.index(published["use_case_alpha"])]
        places, usual = (HandPlace.FRONT,) if quick else tuple(HandPlace), UseCaseParameters()
        steps = {
            Tuning.THESIS: {"alpha": str(published["use_case_alpha"]), "control_period": str(period)},
            Tuning.OWN: {"alpha": str(usual.alpha), "control_period": str(usual.control_period)},
        }
        return self.campaign(
            [
                {"tuning": tuning.name.lower(), **step, "place": place.name.lower()}
                for tuning, step in steps.items()
                for place in places
            ],
            fixed={
                "patience": str(_PATIENCE),
                "carry_patience": str(_PATIENCE),
                "help_speed": str(paper_values("helix", "experiment")["help_speed"]),
            },
            repetitions=1 if quick else int(published["use_case_success"][1]) // len(HandPlace),
            seed=1,
        )

    def claims(self, table: CampaignTable) -> Sequence[Claim]:
        """Judge the thesis's success on the runs with its settings; beyond it, that of ours."""
        thesis, own = self._by_settings(table).values()
        k, n = paper_values("helix", "published")["use_case_success"]
        taken = "The ball is taken from the hand and dropped into the bowl"
        claims = [every_claim(taken, _WHERE, (k, n), thesis.count)]
        if len(own):
            claims.append(every_claim("With our settings the ball gets into the bowl", "", (0, 0), own.count))
        return claims

    def tables(self, table: CampaignTable) -> Sequence[ComparisonTable]:
        """Return success, times and distances for both settings, and why runs failed."""
        rows = [_row(_TITLES[tuning], runs) for tuning, runs in self._by_settings(table).items() if len(runs)]
        published = {
            "settings": "published",
            "ball in the bowl": of(paper_values("helix", "published")["use_case_success"]),
        }
        radius = 1e3 * UseCaseParameters().bowl_radius
        note = (
            "Medians; in brackets: 95 % interval by bootstrap. Beside the bowl's middle: the ball as it falls past the "
            f"rim, by ground truth; the rim's radius is {radius:.0f} mm. Hand to bowl: from when the hand lets go "
            "until the gripper does, opening included. The thesis gives no times; our settings are at their own period."
        )
        columns = dict.fromkeys(_row("", Runs([], {})), "")
        return [table_of("Use case, fig. 13", [{**columns, **published}, *rows], note)]

    def draw(self, table: CampaignTable, runs: Path, folder: Path) -> Sequence[Figure]:
        """Draw the balls' ways from above, and where they fell into the bowl."""
        found = {tuning: _ways(rows, runs) for tuning, rows in self._by_settings(table).items()}
        ways = {tuning: of_tuning for tuning, of_tuning in found.items() if of_tuning}
        panels = [_panel_of_ways(_TITLES[tuning], of_tuning) for tuning, of_tuning in ways.items()]
        panels += map(_panel_of_drops, ways.values())
        caption = (
            "Above: the balls' ways from above, from the hand (dots) to the bowl (circle), and the arm's axis (cross); "
            "the cameras stand to the left. Below: where the balls' middles fell past the bowl's rim; "
            "dashed: within it a ball does not touch the rim."
        )
        n = len(ways)
        return drawn(folder / "ways", caption, panels, n, size=(1.0 + 3.6 * n, 7.4))

    def _by_settings(self, table: CampaignTable) -> dict[Tuning, Runs]:
        """Return the runs that came to their end, in the plan's order."""
        runs = self.runs(table)
        return {tuning: runs.matching({"tuning": tuning.name.lower()}) for tuning in _TITLES}


def _row(settings: str, runs: Runs) -> dict[str, str]:
    return {
        "settings": settings,
        "ball in the bowl": of(runs.count),
        "gripper begins to close, s": format_median(runs.metric("arm_time"), 1),
        "hand to bowl, s": format_median(runs.metric("carry_time"), 1),
        "whole task, s": format_median(runs.metric("task_time"), 1),
        "beside the bowl's middle, mm": format_median(1000 * runs.metric("drop_offset"), 1),
        "failed because": reasons_of(runs),
    }


class BallWay(NamedTuple):
    """The carried ball's way in W, shape (rows, 3), m, where it fell past the rim, if it did, and its run's colour."""

    carried: Floats
    fell: Floats | None
    colour: str


def _ways(found: Runs, runs: Path) -> list[BallWay]:
    """Return the balls' ways of the runs that have a record."""
    bowl = UseCaseParameters().bowl
    ways: list[BallWay] = []
    for row in found:
        for record in records_of([row["run"]], runs):
            p_WO, holder = record["hand.p_WO"], record["hand.holder"]
            falling = np.flatnonzero(holder[1:] == int(Holder.FREE))
            crossings = [p for i in falling if (p := bowl.crossing(p_WO[i], p_WO[i + 1])) is not None]
            colour = COLOURS[HandPlace[row["place"].upper()]]
            ways.append(BallWay(p_WO[holder == int(Holder.GRIPPER)], crossings[-1] if crossings else None, colour))
    return ways


@dataclass(frozen=True)
class _Ring:
    """The bowl's rim, or a circle of another radius, m, about its middle."""

    radius: float
    stroke: str = "-"

    def draw(self, axes: Axes) -> None:
        x, y, _ = 1000 * UseCaseParameters().p_WD
        axes.add_patch(Circle((x, y), 1000 * self.radius, fill=False, color=_GREY, ls=self.stroke))


def _dot(p_WO: Floats, colour: str) -> Mark:
    return Mark(1000 * p_WO[:1], 1000 * p_WO[1:2], "o", colour, style={"ms": 5, "mew": 0})


def _panel_of_ways(title: str, ways: Sequence[BallWay]) -> Panel:
    marks: list[Drawable] = []
    for way in ways:
        x, y, _ = 1000 * way.carried.T
        marks.append(Mark(x, y, "-", way.colour, style={"lw": 1.0}))
        marks += [_dot(p_WO, way.colour) for p_WO in way.carried[:1]]
    marks += [_Ring(UseCaseParameters().bowl_radius), Mark([0], [0], "+", _GREY, style={"ms": 9})]
    axes = {"title": title, "aspect": "equal", "xlim": (-210, 240), "ylim": (-270, 230), "ylabel": "y in W (mm)"}
    return Panel(marks, axes)


def _panel_of_drops(ways: Sequence[BallWay]) -> Panel:
    p = UseCaseParameters()
    x, y, _ = 1000 * p.p_WD
    marks = [_Ring(p.bowl_radius), _Ring(p.bowl_radius - p.bowl.ball_radius, "--")]
    dots = [_dot(way.fell, way.colour) for way in ways if way.fell is not None]
    reach = 1150 * p.bowl_radius
    limits = {"xlim": (x - reach, x + reach), "ylim": (y - reach, y + reach)}
    return Panel([*marks, *dots], {"aspect": "equal", **limits, "xlabel": "x in W (mm)", "ylabel": "y in W (mm)"})
