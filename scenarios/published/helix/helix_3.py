"""The use case of [Vervloet2025], fig. 13: the Helix takes a ball from a hand and drops it into a bowl."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle

from handover.cosim.blocks.ports import Floats
from handover.cosim.record.reader import Record
from handover.plants.helix.hand.partner_parameters import Holder
from handover.scenarios.campaign.plan import CampaignPlan
from handover.scenarios.campaign.table import CampaignTable
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.paper import paper_values
from handover.scenarios.experiment.plotting import COLOURS, figure
from handover.scenarios.helix.helix_use_case import UseCaseParameters
from handover.scenarios.helix.parameters import HandPlace, Tuning
from handover.scenarios.published.helix.helix_cases import reasons_of
from handover.scenarios.published.published_experiment import Claim, ComparisonTable, PublishedExperiment
from handover.scenarios.published.verdicts import every_claim, format_median

_PATIENCE = 600.0
"""Time to reach the ball, and again to reach the bowl, s: as long as the scenario allows."""

_WHERE = "secs. 3.5.3 and 4.4, fig. 13"


@dataclass(frozen=True)
class UseCaseRuns:
    """Rows of a campaign's table of runs that came to their end with one tuning.

    Attributes:
        tuning: the settings.
        rows: in the plan's order.
        broken: runs that a unit's failure, a crash or a lost worker ended: they do not count.
    """

    tuning: Tuning
    rows: Sequence[Mapping[str, Any]]
    broken: int

    @classmethod
    def of(cls, table: CampaignTable, tuning: Tuning) -> "UseCaseRuns":
        """Pick the rows of a tuning."""
        mine = [row for row in table.rows if row["tuning"] == tuning.name.lower()]
        done = [row for row in mine if row["status"] == "done"]
        return cls(tuning, done, len(mine) - len(done))

    @property
    def title(self) -> str:
        """Whose settings, in words."""
        return "the thesis's settings" if self.tuning is Tuning.THESIS else "our settings"

    @property
    def count(self) -> tuple[int, int]:
        """Number of runs after which the ball lay in the bowl, and of all."""
        return sum(bool(row["success"]) for row in self.rows), len(self.rows)

    def metric(self, name: str) -> Floats:
        """Return a metric of the runs that have it."""
        values = [row.get(name) for row in self.rows]
        return np.array([v for v in values if v is not None], dtype=np.float64)


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
        return CampaignPlan(
            scenario=self.scenario,
            points=[
                {"tuning": tuning.name.lower(), **steps[tuning], "place": place.name.lower()}
                for tuning in (Tuning.THESIS, Tuning.OWN)
                for place in places
            ],
            fixed={
                "patience": str(_PATIENCE),
                "carry_patience": str(_PATIENCE),
                "help_speed": str(paper_values("helix", "experiment")["help_speed"]),
            },
            repetitions=1 if quick else int(published["use_case_success"][1]) // len(HandPlace),
            seed=1,
            experiment=self.name,
        )

    def claims(self, table: CampaignTable) -> Sequence[Claim]:
        """Judge the thesis's success on the runs with its settings; beyond it, that of ours."""
        thesis, own = _arms(table)
        k, n = paper_values("helix", "published")["use_case_success"]
        taken = "The ball is taken from the hand and dropped into the bowl"
        claims = [every_claim(taken, _WHERE, (k, n), thesis.count)]
        if own.rows:
            claims.append(every_claim("With our settings the ball gets into the bowl", "", (0, 0), own.count))
        return claims

    def tables(self, table: CampaignTable) -> Sequence[ComparisonTable]:
        """Return success, times and distances for both settings, and why runs failed."""
        k, n = paper_values("helix", "published")["use_case_success"]
        rows = [["published", f"{k} of {n}", "", "", "", "", ""], *(_row(arm) for arm in _arms(table) if arm.rows)]
        header = [
            "settings",
            "ball in the bowl",
            "gripper begins to close, s",
            "hand to bowl, s",
            "whole task, s",
            "beside the bowl's middle, mm",
            "failed because",
        ]
        radius = 1e3 * UseCaseParameters().bowl_radius
        note = (
            "Medians; in brackets: 95 % interval by bootstrap. Beside the bowl's middle: the ball as it falls past the "
            f"rim, by ground truth; the rim's radius is {radius:.0f} mm. Hand to bowl: from when the hand lets go "
            "until the gripper does, opening included. The thesis gives no times; our settings are at their own period."
        )
        return [ComparisonTable(title="Use case, fig. 13", header=header, rows=rows, note=note)]

    def draw(self, table: CampaignTable, runs: Path, folder: Path) -> Sequence[Figure]:
        """Draw the balls' ways from above, and where they fell into the bowl."""
        ways = {arm.tuning: _ways(arm, runs) for arm in _arms(table)}
        drawn = {tuning: found for tuning, found in ways.items() if found}
        if not drawn:
            return []
        n = len(drawn)
        with figure(folder / "ways", 2, n, size=(1.0 + 3.6 * n, 7.4)) as axes:
            for i, (tuning, found) in enumerate(drawn.items()):
                _draw_ways(axes[i], found)
                _draw_drops(axes[i + n], found)
                axes[i].set_title(UseCaseRuns(tuning, (), 0).title)
            for axis in (axes[0], axes[n]):
                axis.set_ylabel("y in W (mm)")
        caption = (
            "Above: the balls' ways from above, from the hand (dots) to the bowl (circle), and the arm's axis (cross); "
            "the cameras stand to the left. Below: where the balls' middles fell past the bowl's rim; "
            "dashed: within it a ball does not touch the rim."
        )
        return [Figure("ways", caption)]


def _arms(table: CampaignTable) -> tuple[UseCaseRuns, UseCaseRuns]:
    return UseCaseRuns.of(table, Tuning.THESIS), UseCaseRuns.of(table, Tuning.OWN)


def _row(arm: UseCaseRuns) -> list[str]:
    succeeded, tried = arm.count
    return [
        arm.title,
        f"{succeeded} of {tried}",
        *(format_median(arm.metric(name), 1) for name in ("arm_time", "carry_time", "task_time")),
        format_median(1000 * arm.metric("drop_offset"), 1),
        reasons_of(arm.rows),
    ]


class BallWay(NamedTuple):
    """The carried ball's way in W, shape (rows, 3), m, where it fell past the rim, if it did, and its run's colour."""

    carried: Floats
    fell: Floats | None
    colour: str


def _ways(arm: UseCaseRuns, runs: Path) -> list[BallWay]:
    """Return the balls' ways of the runs that have a record."""
    bowl = UseCaseParameters().bowl
    found: list[BallWay] = []
    for row in arm.rows:
        path = runs / row["run"] / "signals.parquet"
        if not path.exists():
            continue
        record = Record(path)
        p_WO, holder = record["hand.p_WO"], record["hand.holder"]
        falling = np.flatnonzero(holder[1:] == int(Holder.FREE))
        crossings = [p for i in falling if (p := bowl.crossing(p_WO[i], p_WO[i + 1])) is not None]
        colour = COLOURS[HandPlace[row["place"].upper()]]
        found.append(BallWay(p_WO[holder == int(Holder.GRIPPER)], crossings[-1] if crossings else None, colour))
    return found


def _draw_ways(axis: Axes, found: Sequence[BallWay]) -> None:
    p = UseCaseParameters()
    for way in found:
        axis.plot(1000 * way.carried[:, 0], 1000 * way.carried[:, 1], color=way.colour, lw=1.0)
        if len(way.carried):
            axis.plot(*1000 * way.carried[0, :2], "o", color=way.colour, ms=5, mew=0)
    axis.add_patch(Circle((1000 * p.p_WD[0], 1000 * p.p_WD[1]), 1000 * p.bowl_radius, fill=False, color="#4d5866"))
    axis.plot(0, 0, "+", color="#4d5866", ms=9)
    axis.set(aspect="equal", xlim=(-210, 240), ylim=(-270, 230))


def _draw_drops(axis: Axes, found: Sequence[BallWay]) -> None:
    p = UseCaseParameters()
    x, y, _ = 1000 * p.p_WD
    for radius, stroke in ((p.bowl_radius, "-"), (p.bowl_radius - p.bowl.ball_radius, "--")):
        axis.add_patch(Circle((x, y), 1000 * radius, fill=False, color="#4d5866", ls=stroke))
    for way in found:
        if way.fell is not None:
            axis.plot(*1000 * way.fell[:2], "o", color=way.colour, ms=5, mew=0)
    reach = 1150 * p.bowl_radius
    axis.set(aspect="equal", xlim=(x - reach, x + reach), ylim=(y - reach, y + reach), xlabel="x in W (mm)")
