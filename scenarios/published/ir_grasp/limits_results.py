"""Results of `ir-limits`: counts by arm, axis and level, paired tests, and what follows from them by rule."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from handover.cosim.exceptions import counted
from handover.scenarios.published.ir_grasp.limits_axes import AXES, Axis, LimitArm, settings_of
from handover.scenarios.published.runs import Count, Row, Runs, is_done, plain
from handover.scenarios.runs.campaign.statistics import LEVEL, holm, sign_flip_test

WORTH = 0.15
"""Difference of rates from which on sensing counts as worth something, or as costing something."""

_HALF = 0.5

Scene = tuple[object, ...]
Levels = Sequence[tuple[Axis, Sequence[float]]]
"""Levels of some axes."""


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
        runs: of the campaign.
        pushed_most: how far an object may have been pushed before the hand closes to count as held, m.
    """

    def __init__(self, runs: Runs, pushed_most: float = math.inf) -> None:
        self.all, self.pushed_most = runs, pushed_most
        self.unfinished = sum(not is_done(row) for row in runs)

    def of(self, arm: LimitArm, axis: Axis, levels: Sequence[float]) -> Runs:
        """Return the runs of an arm at levels of an axis, each once, of however many levels it is."""
        return self.all.of(*(point for level in levels for point in settings_of(arm, axis, level)))

    def count(self, arm: LimitArm, axis: Axis, levels: Sequence[float]) -> Count:
        """Return successes and trials."""
        runs = self.of(arm, axis, levels)
        return sum(map(self._held, runs)), len(runs)

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
            (*(plain(row.get(name)) for name in ("thing", "thing_seed", "scene.mass_O")), row["seed"]): self._held(row)
            for row in self.of(arm, axis, (level,))
        }

    def _held(self, row: Row) -> bool:
        if not is_done(row) or not row["success"]:
            return False
        pushed = row.get("displacement")
        return self.pushed_most == math.inf or (pushed is not None and pushed <= self.pushed_most)

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
    of = counted(len(compared), "axis", "axes")
    rest = f" On {len(other)} of {of} neither is shown: {_listed(other)}." if other else ""
    return f"{'; '.join(parts)}.{rest}"


def _listed(compared: Sequence[Comparison]) -> str:
    return ", ".join(f"{c.axis.title} ({100 * c.gain:+.0f})" for c in sorted(compared, key=lambda c: -c.gain))
