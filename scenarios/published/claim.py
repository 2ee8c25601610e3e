"""What a paper claims, and how the campaign's runs bear on it."""

import enum
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any


class Verdict(str, enum.Enum):
    """What became of a claim."""

    REPRODUCED = "reproduced"
    NOT_REPRODUCED = "not reproduced"
    NOT_COMPARABLE = "not comparable"


_BEYOND = {
    Verdict.REPRODUCED: "holds",
    Verdict.NOT_REPRODUCED: "does not hold",
    Verdict.NOT_COMPARABLE: "too few runs",
}
"""Verdicts in words on claims that nobody has published."""


@dataclass(frozen=True, kw_only=True)
class Claim:
    """A claim with its verdict, which follows from a rule that was laid down before the runs.

    Attributes:
        claim: what is claimed, in a sentence.
        published: the figure as printed, with its unit.
        measured: the campaign's figure, with its unit.
        verdict: what became of it.
        reason: by which rule the verdict, in sentences.
        interval: confidence interval of what was measured, in `unit`; None if there is none.
        unit: of the interval.
        where: place in the paper.
        beyond: whether the claim is this project's own and no paper's.
    """

    claim: str
    published: str
    measured: str
    verdict: Verdict
    reason: str
    interval: tuple[float, float] | None = None
    unit: str = "1"
    where: str = ""
    beyond: bool = False

    @property
    def told_verdict(self) -> str:
        """The verdict in words: that of a claim which nobody has published says whether it holds."""
        return _BEYOND[self.verdict] if self.beyond else self.verdict.value

    def as_data(self) -> dict[str, Any]:
        """Return it as JSON can hold it."""
        return {
            "claim": self.claim,
            "published": self.published,
            "measured": self.measured,
            "interval": None if self.interval is None else list(self.interval),
            "unit": self.unit,
            "verdict": self.verdict.value,
            "reason": self.reason,
            "where": self.where,
            "beyond": self.beyond,
        }

    @classmethod
    def from_data(cls, data: Mapping[str, Any]) -> "Claim":
        """Return the claim that `as_data` told.

        Raises:
            KeyError, TypeError, ValueError: it is of another form.
        """
        interval = data["interval"]
        rest: dict[str, Any] = {k: v for k, v in data.items() if k not in ("interval", "verdict")}
        low_high = None if interval is None else (float(interval[0]), float(interval[1]))
        return cls(interval=low_high, verdict=Verdict(data["verdict"]), **rest)


def verdict_counts(claims: Sequence[Claim], beyond: bool) -> Sequence[tuple[int, Verdict, str]]:
    """Return how many of a paper's claims, or of those beyond it, have each verdict that occurs, with its words."""
    told = [(c.verdict, c.told_verdict) for c in claims if c.beyond is beyond]
    return [(told.count(t), *t) for t in sorted(set(told), key=lambda t: list(Verdict).index(t[0]))]
