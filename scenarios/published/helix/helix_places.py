"""How often and how exactly the Helix takes a ball anywhere within its reach: places drawn at random."""

from collections.abc import Sequence
from pathlib import Path
from typing import ClassVar

import numpy as np

from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.paper import paper_values
from handover.scenarios.experiment.plotting import COLOURS
from handover.scenarios.published.claims import Statement
from handover.scenarios.published.figures import Mark, Panel, drawn
from handover.scenarios.published.helix.helix_cases import reasons_of
from handover.scenarios.published.published_experiment import Claim, ComparisonTable, PublishedExperiment
from handover.scenarios.published.runs import Runs
from handover.scenarios.published.tables import table_of
from handover.scenarios.published.verdicts import format_rate
from handover.scenarios.robots.helix.workspace import random_place, reach
from handover.scenarios.runs.campaign.plan import CampaignPlan
from handover.scenarios.runs.campaign.statistics import success_interval
from handover.scenarios.runs.campaign.table import CampaignTable

_COUNT, _QUICK_COUNT = 200, 3
_SEED = 2016
"""Draws the places; nothing was tuned on them."""
_LEAST_SUCCESS = 0.98
_MIN_RUNS = 50
"""Runs in which a robot that fails at one place in fifty fails once, on average."""
_MEDIAN, _MOST = 0.002, 0.005
"""How near the gripper is to be when the ball leaves the hand, m: in the median, and at most."""


def random_places(count: int, seed: int = _SEED) -> list[dict[str, str]]:
    """Return places within reach that both cameras see: evenly over the height, and at each height over the area."""
    rng = np.random.default_rng(seed)
    drawn = [dict(zip(("azimuth", "radius", "height"), random_place(rng), strict=True)) for _ in range(count)]
    return [{name: f"{value:.3f}" for name, value in place.items()} for place in drawn]


class HelixPlaces(PublishedExperiment):
    """Two hundred random places within what `helix-workspace` found, each with a seed of its own, with the fast arm.

    The thesis has four places. The quick plan is three of these.
    """

    name: ClassVar[str] = "helix-places"
    title: ClassVar[str] = "the Helix takes a ball at random places of its workspace (beyond [Vervloet2025])"
    scenario: ClassVar[str] = "helix_handover"

    def plan(self, quick: bool) -> CampaignPlan:
        """Return the places; if quick, the first of them."""
        count = _QUICK_COUNT if quick else _COUNT
        return self.campaign(random_places(_COUNT)[:count], seed=98, units={"arm": "TendonArmFast"})

    def claims(self, table: CampaignTable) -> Sequence[Claim]:
        """Judge success and exactness."""
        runs = self.runs(table)
        return [_succeeds(runs), _is_near(runs.successful)]

    def tables(self, table: CampaignTable) -> Sequence[ComparisonTable]:
        """Return each place where the handover failed, and why."""
        runs = self.runs(table)
        rows = [
            {
                "azimuth, rad": f"{row['azimuth']:.2f}",
                "radius, m": f"{row['radius']:.3f}",
                "height, m": f"{row['height']:.3f}",
                "failed because": row["reason"],
            }
            for row in runs.failed
        ]
        return [table_of("Places where the handover failed", rows, f"In short: {reasons_of(runs) or 'none failed'}.")]

    def draw(self, table: CampaignTable, runs: Path, folder: Path) -> Sequence[Figure]:  # noqa: ARG002
        """Draw success by place, and the distances."""
        found = self.runs(table)
        over = [
            Mark(1e3 * of.metric("radius"), 1e3 * of.metric("height"), form, COLOURS[k], label, style={"alpha": 0.8})
            for k, (of, form, label) in enumerate(((found.successful, "o", "taken"), (found.failed, "x", "not taken")))
        ]
        known: list[float] = paper_values("helix", "reach")["height"]
        heights = np.linspace(min(known), max(h for h in known if reach(h) > 0.0), 50)
        reached = [1e3 * reach(h) for h in heights]
        over.append(Mark(reached, 1e3 * heights, "-", "0.5", "reach", style={"lw": 1.0}))
        near: list[Mark] = []
        for k, (metric, label) in enumerate(
            {"closing_distance": "as it begins to close", "final_distance": "at the end"}.items()
        ):
            d = 1e3 * np.sort(found.successful.metric(metric))
            part = np.arange(1, len(d) + 1) / max(1, len(d))
            near.append(Mark(d, part, "-", COLOURS[2 + k], label, style={"drawstyle": "steps-post"}))
        place = {"xlabel": "distance from the arm's axis (mm)", "ylabel": "height in W (mm)", "xlim": (0.0, None)}
        of = {"xlabel": "gripper to ball (mm)", "ylabel": "part of the handovers that succeeded"}
        caption = (
            "Left: where the ball was offered, in any direction around the arm, and whether the Helix took it. Right: "
            "how far the gripper was from the ball, by ground truth."
        )
        panels = [Panel(over, place), Panel(near, {**of, "ylim": (0.0, 1.0), "xlim": (0.0, None)})]
        return drawn(folder / "places", caption, panels, 2, size=(9.0, 4.3))


def _succeeds(runs: Runs) -> Claim:
    says = Statement(f"At least {100 * _LEAST_SUCCESS:.0f} % of handovers within reach succeed")
    k, n = runs.count
    if not n:
        return says.unknown()
    return says.judged(
        format_rate(k, n),
        k >= _LEAST_SUCCESS * n,
        f"{100 * _LEAST_SUCCESS:.0f} % or more of the {n} did, of {_MIN_RUNS} or more",
        enough=n >= _MIN_RUNS,
        interval=success_interval(k, n),
    )


def _is_near(taken: Runs) -> Claim:
    median, most = 1e3 * _MEDIAN, 1e3 * _MOST
    says = Statement(
        f"As the ball leaves the hand it is {median:.0f} mm from the gripper's middle in the median, {most:.0f} mm at "
        "most"
    )
    beside, along = (taken.metric(f"grasp_offset_{name}") for name in ("lateral", "axial"))
    if not len(beside):
        return says.unknown("No handover succeeded.")
    d = np.hypot(beside, along)
    return says.judged(
        f"{1e3 * np.median(d):.1f} mm in the median, {1e3 * d.max():.1f} mm at most",
        bool(np.median(d) <= _MEDIAN and d.max() <= _MOST),
        f"both do, by ground truth, of the {len(d)} handovers that succeeded",
        runs=(len(d), _MIN_RUNS),
    )
