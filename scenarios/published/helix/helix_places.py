"""How often and how exactly the Helix takes a ball anywhere within its reach: places drawn at random."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from handover.scenarios.campaign.plan import CampaignPlan
from handover.scenarios.campaign.statistics import success_interval
from handover.scenarios.campaign.table import CampaignTable
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.paper import paper_values
from handover.scenarios.experiment.plotting import COLOURS, figure
from handover.scenarios.helix.workspace import random_place, reach
from handover.scenarios.published.helix.helix_cases import distances, reasons_of
from handover.scenarios.published.published_experiment import Claim, ComparisonTable, PublishedExperiment, Verdict
from handover.scenarios.published.verdicts import format_rate, nothing_measured, verdict_of, with_shortfall

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
        return CampaignPlan(
            scenario=self.scenario,
            points=random_places(_COUNT)[: _QUICK_COUNT if quick else _COUNT],
            seed=98,
            units={"arm": "TendonArmFast"},
            experiment=self.name,
        )

    def claims(self, table: CampaignTable) -> Sequence[Claim]:
        """Judge success and exactness."""
        rows = [row for row in table.rows if row["status"] == "done"]
        return [_succeeds(rows), _is_near(rows)]

    def tables(self, table: CampaignTable) -> Sequence[ComparisonTable]:
        """Return each place where the handover failed, and why."""
        failed = [row for row in table.rows if row["status"] == "done" and not row["success"]]
        rows = [
            [f"{row['azimuth']:.2f}", f"{row['radius']:.3f}", f"{row['height']:.3f}", row["reason"]] for row in failed
        ]
        header = ["azimuth, rad", "radius, m", "height, m", "failed because"]
        note = f"In short: {reasons_of(failed) or 'none failed'}."
        return [ComparisonTable(title="Places where the handover failed", header=header, rows=rows, note=note)]

    def draw(self, table: CampaignTable, runs: Path, folder: Path) -> Sequence[Figure]:  # noqa: ARG002
        """Draw success by place, and the distances."""
        rows = [row for row in table.rows if row["status"] == "done"]
        with figure(folder / "places", 1, 2, size=(9.0, 4.0)) as (over, near):
            for success, mark, label in ((True, "o", "taken"), (False, "x", "not taken")):
                of_it = [row for row in rows if row["success"] is success]
                r, z = (np.array([row[name] for row in of_it], dtype=np.float64) for name in ("radius", "height"))
                over.plot(r, z, mark, ms=4, color=COLOURS[0 if success else 1], alpha=0.8, label=label)
            known: list[float] = paper_values("helix", "reach")["height"]
            heights = np.linspace(min(known), max(h for h in known if reach(h) > 0.0), 50)
            over.plot([reach(h) for h in heights], heights, color="0.5", lw=1, label="reach")
            over.set(xlabel="distance from the arm's axis (m)", ylabel="height in W (m)", xlim=(0.0, None))
            over.set_xticks(np.arange(0.0, 0.25, 0.05))
            over.legend(loc="upper left", bbox_to_anchor=(0.0, 1.12), ncols=3)
            for metric, label in _SHOWN.items():
                d = 1e3 * np.sort(distances(rows, success=True, metric=metric))
                near.plot(d, np.arange(1, len(d) + 1) / max(1, len(d)), drawstyle="steps-post", label=label)
            near.set(xlabel="gripper to ball (mm)", ylabel="part of the handovers that succeeded", ylim=(0.0, 1.0))
            near.set(xlim=(0.0, None))
            near.legend(loc="lower right")
        caption = (
            "Left: where the ball was offered, in any direction around the arm, and whether the Helix took it. Right: "
            "how far the gripper was from the ball, by ground truth."
        )
        return [Figure("places", caption)]


_SHOWN = {"closing_distance": "as it begins to close", "final_distance": "at the end"}


def _succeeds(rows: Sequence[Mapping[str, Any]]) -> Claim:
    facts: dict[str, Any] = {
        "claim": f"At least {100 * _LEAST_SUCCESS:.0f} % of handovers within reach succeed",
        "published": "",
        "beyond": True,
    }
    if not rows:
        return nothing_measured(**facts)
    k, n = sum(bool(row["success"]) for row in rows), len(rows)
    interval = success_interval(k, n)
    verdict = Verdict.REPRODUCED if k >= _LEAST_SUCCESS * n else Verdict.NOT_REPRODUCED
    return Claim(
        **facts,
        measured=format_rate(k, n),
        interval=(interval.low, interval.high),
        verdict=verdict if n >= _MIN_RUNS else Verdict.NOT_COMPARABLE,
        reason=f"Holds if {100 * _LEAST_SUCCESS:.0f} % or more of the {n} did, of {_MIN_RUNS} or more; the interval is "
        "Clopper and Pearson's.",
    )


def _is_near(rows: Sequence[Mapping[str, Any]]) -> Claim:
    median, most = 1e3 * _MEDIAN, 1e3 * _MOST
    facts: dict[str, Any] = {
        "claim": f"As the ball leaves the hand it is {median:.0f} mm from the gripper's middle in the median, "
        f"{most:.0f} mm at most",
        "published": "",
        "beyond": True,
    }
    beside, along = (distances(rows, success=True, metric=f"grasp_offset_{name}") for name in ("lateral", "axial"))
    if not len(beside):
        return nothing_measured(**facts, reason="No handover succeeded.")
    d = np.hypot(beside, along)
    return Claim(
        **facts,
        measured=f"{1e3 * np.median(d):.1f} mm in the median, {1e3 * d.max():.1f} mm at most",
        verdict=verdict_of(bool(np.median(d) <= _MEDIAN and d.max() <= _MOST), could_be_either=len(d) >= _MIN_RUNS),
        reason=with_shortfall(
            f"Holds if both do, by ground truth, of the {len(d)} handovers that succeeded.", len(d), _MIN_RUNS
        ),
    )
