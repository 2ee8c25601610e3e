"""Where the Helix can take a ball: how far it reaches, and what its cameras see, as in fig. 14 of [Vervloet2025]."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import ClassVar

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap

from handover.controllers.helix.servo.servo_parameters import Params as ServoParams
from handover.cosim.blocks.ports import Floats
from handover.cosim.exceptions import counted
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.plotting import COLOURS
from handover.scenarios.published.claims import Statement
from handover.scenarios.published.figures import Drawable, Mark, Panel, drawn
from handover.scenarios.published.published_experiment import Claim, ComparisonTable, PublishedExperiment
from handover.scenarios.published.runs import Row, is_done
from handover.scenarios.published.tables import table_of
from handover.scenarios.robots.helix.workspace import cameras_that_see, reach
from handover.scenarios.runs.campaign.plan import CampaignPlan
from handover.scenarios.runs.campaign.table import CampaignTable

AZIMUTHS = (0.0, 1.05, 1.57, 3.14, -1.57)
"""Directions from the axis, rad: along tendons, between two, and across."""
HEIGHTS = tuple(round(-0.72 + 0.08 * k, 2) for k in range(5))
RADII = tuple(round(0.03 * k, 2) for k in range(1, 11))
_WHOLE = len(AZIMUTHS) * len(HEIGHTS) * len(RADII)

_SERVO = ServoParams()
_SETTLED = f"{1e3 * _SERVO.threshold_grasp:g} mm"
_TILTED = f"{np.degrees(_SERVO.threshold_tilt):.0f}°"
_QUICK = ((0.0,), (-0.6,), (0.06, 0.15, 0.3))
_SEEN = ("no camera", "one camera", "both cameras")
_SHADES = ("#d9dde3", "#f3dcc0", "#d6ead8")
_TOLERANCE = 0.005
"""Resolution of the reach that is kept, m."""


class HelixWorkspace(PublishedExperiment):
    """Places around the arm, tried with exact measurements and the fast arm, and what the cameras see of them.

    The quick plan is three places.
    """

    name: ClassVar[str] = "helix-workspace"
    title: ClassVar[str] = "where the Helix reaches and its cameras see ([Vervloet2025] fig. 14)"
    scenario: ClassVar[str] = "helix_reach"

    def plan(self, quick: bool) -> CampaignPlan:
        """Return a grid of places; if quick, a part of it."""
        places = product(*(_QUICK if quick else (AZIMUTHS, HEIGHTS, RADII)))
        points = [{"azimuth": str(a), "height": str(z), "radius": str(r)} for a, z, r in places]
        return self.campaign(points, units={"arm": "TendonArmFast"})

    def claims(self, table: CampaignTable) -> Sequence[Claim]:
        """Judge what the thesis says limits the workspace, and whether the reach that is kept is the one found."""
        return [_limited_by_cameras(table), _kept(table)]

    def tables(self, table: CampaignTable) -> Sequence[ComparisonTable]:
        """Return the reach by height and direction."""
        found = reach_by_place(table)
        azimuths, heights = sorted({a for a, _ in found}), sorted({z for _, z in found}, reverse=True)
        rows = [
            {
                "height, m": f"{z:.2f}",
                **{f"{np.degrees(a):.0f}°": f"{found[a, z]:.2f}" if (a, z) in found else "" for a in azimuths},
                "kept": f"{reach(z):.2f}",
            }
            for z in heights
        ]
        note = (
            "Largest distance from the arm's axis, m, up to which the gripper settles within "
            f"{_SETTLED} of every tried place, tilted by {_TILTED} at most, by direction. Kept is what warns before a "
            "handover: the least of all directions."
        )
        return [table_of("How far the arm reaches", rows, note)]

    def draw(self, table: CampaignTable, runs: Path, folder: Path) -> Sequence[Figure]:  # noqa: ARG002
        """Draw the planes before the cameras and across their view: what is seen, and what is reached."""
        rows = [row for row in table.rows if is_done(row)]
        panels: list[Panel] = []
        for title, name, turn in (("along the cameras' view", "x", 0.0), ("across it", "y", np.pi / 2)):
            marks: list[Drawable] = [_Seen(turn)]
            for k, (reached, form) in enumerate(((True, "o"), (False, "x"))):
                tried = [_in_plane(row, turn) for row in rows if bool(row["success"]) is reached]
                points = [p for p in tried if p is not None]
                x, z = [p[0] for p in points], [p[1] for p in points]
                marks.append(Mark(x, z, form, COLOURS[k], "reached" if reached else "not reached"))
            marks += [
                Mark(form="s", colour=c, label=n, style={"ms": 10.0}) for c, n in zip(_SHADES, _SEEN, strict=True)
            ]
            axes = {"title": title, "xlabel": f"{name} (m)", "ylabel": "z (m)", "aspect": "equal"}
            panels.append(Panel(marks, axes))
        caption = (
            "Places of the ball in two upright planes through the arm's axis, as in [Vervloet2025] fig. 14. Marks say "
            f"where the gripper settles within {_SETTLED} with exact measurements; colours, how many cameras see ball "
            "and markers whole."
        )
        return drawn(folder / "workspace", caption, panels if rows else [], 2, size=(8.0, 3.7))


def reach_by_place(table: CampaignTable) -> dict[tuple[float, float], float]:
    """Return the largest distance, m, up to which all tried places were reached, by azimuth and height."""
    tried: dict[tuple[float, float], dict[float, bool]] = {}
    for row in table.rows:
        if is_done(row):
            tried.setdefault((row["azimuth"], row["height"]), {})[row["radius"]] = bool(row["success"])
    found: dict[tuple[float, float], float] = {}
    for place, by_radius in tried.items():
        found[place] = 0.0
        for radius in sorted(by_radius):
            if not by_radius[radius]:
                break
            found[place] = radius
    return found


def _in_plane(row: Row, turn: float) -> tuple[float, float] | None:
    """Return where a place is in an upright plane through the axis; None where it is not in it."""
    across = row["radius"] * np.sin(row["azimuth"] - turn)
    if abs(across) > 0.1 * row["radius"]:
        return None
    return float(np.sign(np.cos(row["azimuth"] - turn)) * row["radius"]), row["height"]


@dataclass(frozen=True)
class _Seen:
    """The plane by how many cameras see ball and markers."""

    turn: float

    def draw(self, axes: Axes) -> None:
        s, z = np.linspace(-0.4, 0.4, 81), np.linspace(-0.85, -0.3, 56)
        seen = np.array([[cameras_that_see(_point(x, y, self.turn)) for x in s] for y in z])
        axes.pcolormesh(s, z, seen, cmap=ListedColormap(list(_SHADES)), vmin=-0.5, vmax=2.5, shading="nearest")


def _point(s: float, z: float, turn: float) -> Floats:
    return np.array([s * np.cos(turn), s * np.sin(turn), z])


def _limited_by_cameras(table: CampaignTable) -> Claim:
    says = Statement(
        "The cameras' view, not the arm, limits where a ball can be taken",
        "sec. 5.4.1, fig. 14",
        "limited by what was captured by the two cameras",
    )
    rows = [row for row in table.rows if is_done(row)]
    if not rows:
        return says.unknown()
    seen = [cameras_that_see(_point(row["radius"], row["height"], row["azimuth"])) == 2 for row in rows]
    reached = [bool(row["success"]) for row in rows]
    only_seen = sum(a and not b for a, b in zip(seen, reached, strict=True))
    only_reached = sum(b and not a for a, b in zip(seen, reached, strict=True))
    return says.judged(
        f"of {counted(len(rows), 'place')} {only_reached} are reached and not seen, {only_seen} seen and not reached",
        only_reached > only_seen,
        f"more of the {_WHOLE} places are within reach and out of view than the other way round",
        "Where the thesis's cameras stood is known roughly, and of its arm's stiffness and load nothing.",
        enough=_is_whole(rows),
    )


def _kept(table: CampaignTable) -> Claim:
    says = Statement("The reach that warns before a handover is the one found")
    found = reach_by_place(table)
    least = {z: min(r for (_, height), r in found.items() if height == z) for z in {z for _, z in found}}
    if not least:
        return says.unknown()
    off = max(abs(r - reach(z)) for z, r in least.items())
    return says.judged(
        f"{off:.3f} m apart at most, at {len(least)} heights",
        off <= _TOLERANCE,
        f"both differ by {_TOLERANCE} m at most at each height, in the direction of the least reach, by all {_WHOLE} "
        "places",
        enough=_is_whole([row for row in table.rows if is_done(row)]),
    )


def _is_whole(rows: Sequence[Row]) -> bool:
    """Return whether all places of the whole plan have been tried."""
    return len({(row["azimuth"], row["height"], row["radius"]) for row in rows}) >= _WHOLE
