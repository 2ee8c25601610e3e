"""The rules by which claims on errors get their verdicts: groups of runs that do not overlap, or pairs, in every cell.

Groups are of runs of their own. Where both errors are of the same runs, they are compared run by run, without a
p-value: five pairs reach 0.0625 at best by signed ranks whatever they show, and repetitions differ by the sensors'
noise alone.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import comb, inf

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.scenarios.campaign.statistics import LEVEL
from handover.scenarios.published.published_experiment import Claim
from handover.scenarios.published.verdicts import format_p_value, nothing_measured, verdict_of

_NAMED = 5
"""Comparisons that are named where a claim fails."""


def p_value_of_separation(n: int) -> float:
    """Return the exact p-value of the rank-sum test, two-sided, of two groups of n values that do not overlap."""
    return 2.0 / comb(2 * n, n)


MIN_RUNS = next(n for n in range(1, 64) if p_value_of_separation(n) < LEVEL)
"""Runs of a group below which groups that do not overlap can be chance; of fewer pairs nothing is concluded, either."""


@dataclass(frozen=True)
class Comparison:
    """Errors of two groups of runs, of which the first are claimed to be less.

    Attributes:
        label: which groups, in words.
        less, more: the errors, shapes (n,) and (m,), m.
        paired: whether both are of the same runs, in the same order.
    """

    label: str
    less: Floats
    more: Floats
    paired: bool = False

    @property
    def margin(self) -> float:
        """How far the groups, or the pairs, are apart, m; negative where any overlap or are the other way round."""
        if not self.runs:
            return -inf
        return float(np.min(self.more - self.less) if self.paired else np.min(self.more) - np.max(self.less))

    @property
    def runs(self) -> int:
        """Runs of the smaller group."""
        return min(len(self.less), len(self.more))

    @property
    def holds(self) -> bool:
        """Whether each of the first group has less error than each of the second, of pairs than its own."""
        return self.margin > 0.0


def separation_claim(
    claim: str, where: str, published: str, comparisons: Sequence[Comparison], *, beyond: bool = False
) -> Claim:
    """Judge that, in all comparisons, one group has less error in each run, of pairs than its own.

    All comparisons are of groups, or all of pairs. Without enough runs of each group, it is not comparable.
    """
    found = [c for c in comparisons if c.runs]
    if not found or len(found) < len(comparisons):
        return nothing_measured(claim, where, published, beyond)
    n, held = min(c.runs for c in found), sum(c.holds for c in found)
    closest = min(found, key=lambda c: c.margin)
    every = f"in each of the {len(found)} comparisons " if len(found) > 1 else ""
    paired = all(c.paired for c in found)
    rule = "in each run the one error is less than the other"
    if not paired:
        rule = "each run of the one has less error than each of the other"
    reason = f"{'Holds' if beyond else 'Reproduced'} if {every}{rule}."
    if every:
        reason += " A mean over all could hide one that goes the other way."
    if n < MIN_RUNS:
        why = "nothing is concluded" if paired else "that can be chance"
        reason += f" With {n} {'runs' if n > 1 else 'run'} of each {why}: it takes {MIN_RUNS}."
    elif paired:
        reason += " Both errors are of the same runs, so no p-value of independent groups is given."
    else:
        p = format_p_value(p_value_of_separation(n))
        reason += (
            f" Runs of a group differ by the sensors' noise alone; that would separate {n} of each with p = {p} (rank "
            "sums), which says nothing of another arm."
        )
    if failing := [f"{c.label} ({1000 * c.margin:+.2f} mm)" for c in found if not c.holds]:
        reason += f" It fails at: {'; '.join(failing[:_NAMED])}"
        reason += f"; and {len(failing) - _NAMED} more." if len(failing) > _NAMED else "."
    return Claim(
        claim=claim,
        published=published,
        measured=f"{held} of {len(found)}; the closest {1000 * closest.margin:+.2f} mm apart ({closest.label})",
        verdict=verdict_of(held == len(found), could_be_either=n >= MIN_RUNS),
        reason=reason,
        where=where,
        beyond=beyond,
    )
