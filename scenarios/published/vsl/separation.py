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
from handover.scenarios.published.claims import Statement
from handover.scenarios.published.published_experiment import Claim
from handover.scenarios.published.verdicts import format_p_value
from handover.scenarios.runs.campaign.statistics import LEVEL

_NAMED = 5
"""Comparisons that are named where a claim fails."""
_SPACE = "\u00a0"
"""At which no line of a table is broken."""


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


def separation_claim(claim: str, where: str, published: str, comparisons: Sequence[Comparison]) -> Claim:
    """Judge that, in all comparisons, one group has less error in each run, of pairs than its own.

    All comparisons are of groups, or all of pairs. Without enough runs of each group, it is not comparable.
    """
    says, n = Statement(claim, where, published), min((c.runs for c in comparisons), default=0)
    if not n:
        return says.unknown()
    held, failing = (sum(c.holds for c in comparisons), [c for c in comparisons if not c.holds])
    closest = min(comparisons, key=lambda c: c.margin)
    if all(c.paired for c in comparisons):
        rule = "in each comparison and run the one error is less than the other"
    else:
        p = f". By noise alone {n} of each would be apart so with p = {format_p_value(p_value_of_separation(n))}"
        rule = f"in each comparison each run of the one has less error than each of the other{p}"
    more = f"; and {len(failing) - _NAMED} more" if len(failing) > _NAMED else ""
    named = "; ".join(f"{c.label} ({1000 * c.margin:+.2f} mm)" for c in failing[:_NAMED])
    return says.judged(
        f"{held} of {len(comparisons)}; the closest {1000 * closest.margin:+.2f} mm apart ({closest.label})",
        not failing,
        rule,
        f"It fails at: {named}{more}." if failing else "",
        runs=(n, MIN_RUNS),
    )


def in_mm(errors: Floats) -> str:
    """Return the mean of errors, m, in mm; "" of none."""
    return f"{1000 * errors.mean():.1f}" if len(errors) else ""


def spread_in_mm(errors: Floats) -> str:
    """Return mean and standard deviation of errors, m, in mm, such as `1.5 ± 0.03`; of one value the value alone."""
    return in_mm(errors) + (f"{_SPACE}±{_SPACE}{1000 * errors.std(ddof=1):.2f}" if len(errors) > 1 else "")
