"""Results of `ir-limits`: counts by arm, axis and level, paired tests, and what follows from them by rule."""

import enum
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, cast

import numpy as np

from handover.controllers.ir_grasp.parameters import Params as ReflexParams
from handover.cosim.blocks.ports import Floats
from handover.plants.ir_grasp.parameters import Params as SceneParams
from handover.scenarios.campaign.statistics import LEVEL, holm, sign_flip_test
from handover.scenarios.campaign.table import CampaignTable
from handover.scenarios.ir_grasp.parameters import Parameters
from handover.scenarios.published.ir_grasp.limits_axes import AXES, PARAMETERS, Axis, LimitArm, Point, settings_of

WORTH = 0.15
"""Difference of rates from which on sensing counts as worth something, or as costing something."""

_HALF = 0.5

Row = Mapping[str, Any]
Scene = tuple[object, ...]
Count = tuple[int, int]
"""Successes and trials."""

_DEFAULTS = {"": Parameters(), "scene": SceneParams(), "reflex": ReflexParams()}


_BOOLEANS = {"true": 1.0, "false": 0.0}
Levels = Sequence[tuple[Axis, Sequence[float]]]
"""Levels of some axes."""


def _is_unset(value: Any) -> bool:
    return value is None or value == "" or (isinstance(value, float) and value != value)


@lru_cache(maxsize=4096)
def _canonical(name: str, value: Any) -> object:
    """Return a parameter's value, a text of a point or of a column, in one form; None stands for the default."""
    unit, _, parameter = name.rpartition(".")
    value = getattr(_DEFAULTS[unit], parameter, None) if _is_unset(value) else value
    if isinstance(value, enum.Enum):
        return value.name.lower()
    if isinstance(value, str):
        try:
            value = [_BOOLEANS[x] if x in _BOOLEANS else float(x) for x in value.split(",")]
        except ValueError:
            return value
    return tuple(np.round(np.atleast_1d(np.asarray(value, dtype=np.float64)), 9).tolist())


def _key(values: Point | Row) -> tuple[object, ...]:
    return tuple(_of(values, name) for name in PARAMETERS)


def _of(values: Point | Row, name: str) -> object:
    value: Any = values.get(name)
    return _canonical(name, tuple(cast(list[float], value)) if isinstance(value, list) else value)


@dataclass(frozen=True)
class Comparison:
    """The first arm beside the best of others along an axis, all levels beyond the start together.

    Attributes:
        axis: the axis.
        first: counts of the first arm.
        best: which of the others held most.
        second: its counts.
        only_first: scenes of which the first arm held more.
        only_second: scenes of which the other held more.
        p: of the exact sign-flip test over scenes, corrected by Holm over the axes.
    """

    axis: Axis
    first: Count
    best: LimitArm
    second: Count
    only_first: int
    only_second: int
    p: float

    @property
    def gain(self) -> float:
        """Difference of the rates."""
        return self.first[0] / self.first[1] - self.second[0] / self.second[1]

    @property
    def verdict(self) -> str:
        """Whether looking is worth something, costs something, or neither is shown."""
        gain = round(self.gain, 9)  # 57 of 60 less 48 of 60 is 15 points
        if self.p < LEVEL and gain >= WORTH:
            return "worth it"
        if self.p < LEVEL and gain <= -WORTH:
            return "costs"
        return "no difference shown" if self.p >= LEVEL else "slightly better" if self.gain > 0.0 else "slightly worse"


class LimitRuns:
    """The rows of a campaign's table by what they are of; a run that did not come to its end has failed.

    Args:
        table: of the campaign.
        pushed_most: how far an object may have been pushed before the hand closes to count as held, m.
    """

    def __init__(self, table: CampaignTable, pushed_most: float = math.inf) -> None:
        self.pushed_most = pushed_most
        self._rows: dict[tuple[object, ...], list[Row]] = {}
        for row in table.rows:
            self._rows.setdefault(_key(row), []).append(row)
        self.unfinished = sum(row["status"] != "done" for row in table.rows)

    def rows(self, arm: LimitArm, axis: Axis, levels: Sequence[float]) -> list[Row]:
        """Return the runs of an arm at levels of an axis, each once, of however many levels it is."""
        points = [p for level in levels for p in settings_of(arm, axis, level)]
        return list({row["run"]: row for p in points for row in self._rows.get(_key(p), ())}.values())

    def count(self, arm: LimitArm, axis: Axis, levels: Sequence[float]) -> Count:
        """Return successes and trials."""
        rows = self.rows(arm, axis, levels)
        return sum(self._held(row) for row in rows), len(rows)

    def differences(self, first: LimitArm, second: LimitArm, axis: Axis) -> list[int]:
        """Return, by scene, how many levels beyond the start the first arm held more than the second."""
        sums: dict[Scene, int] = {}
        for level in axis.levels:
            a, b = (self._by_scene(arm, axis, level) for arm in (first, second))
            for scene in a.keys() & b.keys():
                sums[scene] = sums.get(scene, 0) + a[scene] - b[scene]
        return list(sums.values())

    def from_start(self, arm: LimitArm, levels: Levels) -> tuple[list[float], list[bool]]:
        """Return, by scene, the share of levels that was held, and whether the axis's start was.

        The axes are `blind_alike`, with one start: their levels are of the same scenes.
        """
        started = self._by_scene(arm, levels[0][0], levels[0][0].all_levels[0])
        found: dict[Scene, list[bool]] = {}
        for axis, tried in levels:
            for level in tried:
                for scene, held in self._by_scene(arm, axis, level).items():
                    found.setdefault(scene, []).append(held)
        kept = [scene for scene in found if scene in started]
        return [float(np.mean(found[scene])) for scene in kept], [started[scene] for scene in kept]

    def _by_scene(self, arm: LimitArm, axis: Axis, level: float) -> dict[Scene, bool]:
        """Return successes at a level by scene: object and seed."""
        return {
            (*(_of(row, name) for name in ("thing", "thing_seed", "scene.mass_O")), row["seed"]): self._held(row)
            for row in self.rows(arm, axis, (level,))
        }

    def _held(self, row: Row) -> bool:
        if row["status"] != "done" or not row["success"]:
            return False
        pushed = row.get("displacement")
        return self.pushed_most == math.inf or (pushed is not None and pushed <= self.pushed_most)

    def values(self, metric: str, arm: LimitArm, axis: Axis, levels: Sequence[float]) -> Floats:
        """Return a metric of runs, without those that have none."""
        found = [row.get(metric) for row in self.rows(arm, axis, levels)]
        return np.array([v for v in found if v is not None and v == v], dtype=np.float64)

    def half(self, arm: LimitArm, axis: Axis) -> str:
        """Return where an arm's rate first is below one half along an axis, interpolated between levels.

        It is "" if the arm was not tried at all of the axis's levels.
        """
        rates = [(level, k / n) for level in axis.all_levels for k, n in [self.count(arm, axis, (level,))] if n]
        if len(rates) < len(axis.all_levels):
            return ""
        below = next((i for i, (_, rate) in enumerate(rates) if rate < _HALF), None)
        if below is None:
            return "not within the range"
        if below == 0:
            return "from the start" if axis.start is not None else f"at {axis.format_level(rates[0][0])} or before"
        (x, high), (y, low) = rates[below - 1], rates[below]
        return axis.format_level(x + (high - _HALF) / (high - low) * (y - x))

    def compared(self, first: LimitArm, others: Sequence[LimitArm]) -> list[Comparison]:
        """Compare an arm with the best of others along each axis of which there are runs of both."""
        found: list[Comparison] = []
        for axis in AXES:
            counts = {arm.title: self.count(arm, axis, axis.levels) for arm in (first, *others)}
            tried = [arm for arm in others if counts[arm.title][1]]
            if not counts[first.title][1] or not tried:
                continue
            best = max(tried, key=lambda arm: counts[arm.title][0] / counts[arm.title][1])
            differences = self.differences(first, best, axis)
            more, less = sum(d > 0 for d in differences), sum(d < 0 for d in differences)
            sums = counts[first.title], best, counts[best.title]
            found.append(Comparison(axis, *sums, more, less, sign_flip_test(differences)))
        corrected = holm([c.p for c in found])
        return [replace(c, p=p) for c, p in zip(found, corrected, strict=True)]


def sentence_of_worth(compared: Sequence[Comparison]) -> str:
    """Return a plain sentence of what looking is worth, and where, by rule."""
    if not compared:
        return "No axis was tried both with and without looking."
    groups = {"worth it": "worth", "costs": "costs"}
    worth, costs = ([c for c in compared if c.verdict == verdict] for verdict in groups)
    other = [c for c in compared if c.verdict not in groups]
    parts = [
        f"Looking holds more than the best way without, by {round(100 * WORTH)} points or more, where the object is "
        f"{_listed(worth)}"
        if worth
        else f"Looking is nowhere shown to hold {round(100 * WORTH)} points more than the best way without",
        *([f"less, by as much, where it is {_listed(costs)}"] if costs else []),
    ]
    rest = f" On {len(other)} of {len(compared)} axes neither is shown: {_listed(other)}." if other else ""
    return f"{'; '.join(parts)}.{rest}"


def _listed(compared: Sequence[Comparison]) -> str:
    return ", ".join(f"{c.axis.title} ({100 * c.gain:+.0f})" for c in sorted(compared, key=lambda c: -c.gain))
