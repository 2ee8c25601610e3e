"""Claims as they are stated: in a sentence, with their place in the paper and what is printed there; then judged."""

from dataclasses import dataclass

from handover.scenarios.published.published_experiment import Claim, Verdict
from handover.scenarios.published.verdicts import nothing_measured, verdict_of, with_shortfall
from handover.scenarios.runs.campaign.statistics import Interval


@dataclass(frozen=True)
class Statement:
    """What is claimed.

    Attributes:
        claim: a sentence.
        where: place in the paper; "" of a claim that is this project's own.
        published: the figure as printed, with its unit.
    """

    claim: str
    where: str = ""
    published: str = ""

    @property
    def beyond(self) -> bool:
        """Whether nobody has published it."""
        return not self.where

    def judged(
        self,
        measured: str,
        met: bool,
        rule: str,
        note: str = "",
        *,
        enough: bool = True,
        runs: tuple[int, int] | None = None,
        interval: Interval | tuple[float, float] | None = None,
        unit: str = "1",
    ) -> Claim:
        """Return the claim with its verdict.

        Args:
            measured: the campaign's figure, with its unit.
            met: whether the rule is met.
            rule: what follows "reproduced if".
            note: what is left open, in a sentence or two.
            enough: whether the runs could have led to either verdict.
            runs: how many there are, and how many it takes for that.
            interval: confidence interval of what was measured, in `unit`.
            unit: of the interval.
        """
        n, least = runs or (0, 0)
        reason = f"{'Holds' if self.beyond else 'Reproduced'} if {rule}. {note}".strip()
        return Claim(
            claim=self.claim,
            published=self.published,
            measured=measured,
            verdict=verdict_of(met, could_be_either=enough and n >= least),
            reason=with_shortfall(reason, n, least),
            interval=(interval.low, interval.high) if isinstance(interval, Interval) else interval,
            unit=unit,
            where=self.where,
            beyond=self.beyond,
        )

    def not_comparable(self, measured: str, why: str, interval: Interval | None = None, unit: str = "1") -> Claim:
        """Return the claim without a verdict, as agreement proves nothing."""
        return Claim(
            claim=self.claim,
            published=self.published,
            measured=measured,
            verdict=Verdict.NOT_COMPARABLE,
            reason=why,
            interval=None if interval is None else (interval.low, interval.high),
            unit=unit,
            where=self.where,
            beyond=self.beyond,
        )

    def unknown(self, why: str = "") -> Claim:
        """Return the claim as one on which there is no run, or there are too few."""
        facts = (self.claim, self.where, self.published, self.beyond)
        return nothing_measured(*facts, reason=why) if why else nothing_measured(*facts)
