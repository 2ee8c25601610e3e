"""An experiment of a paper: its campaign's plan, claims with verdicts, tables beside the published, and figures.

An experiment subclasses `PublishedExperiment`. `PaperResults` holds its claims and tables for a campaign's table of
runs; `write_claims` and `draw_figures` write what it leaves in the campaign's folder.
"""

import abc
import enum
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

from handover.scenarios.experiment.display_unit import DisplayUnit, display_unit
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.published.runs import Row, Runs, is_done
from handover.scenarios.runs.campaign.folder import CampaignFolder
from handover.scenarios.runs.campaign.plan import CampaignPlan
from handover.scenarios.runs.campaign.table import CampaignTable
from handover.scenarios.runs.results.run_folder import disk_errors_reported, folder_within, write_whole


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
        reason: the rule behind the verdict, in sentences.
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
    def verdict_text(self) -> str:
        """The verdict in words: that of a claim which nobody has published says whether it holds."""
        return _BEYOND[self.verdict] if self.beyond else self.verdict.value

    @property
    def interval_text(self) -> str:
        """The interval with a unit that suits its size, a rate's in percent; empty if there is none."""
        if self.interval is None:
            return ""
        unit = display_unit(self.unit, self.interval)
        if self.unit == "1" and "%" in self.measured:
            unit = DisplayUnit(100.0, "%")
        low, high = (x * unit.factor for x in self.interval)
        return f"{low:.3g} to {high:.3g} {unit.symbol}".rstrip()

    def as_data(self) -> dict[str, Any]:
        """Return it as JSON data."""
        return {
            "claim": self.claim,
            "published": self.published,
            "measured": self.measured,
            "interval": None if self.interval is None else list(self.interval),
            "unit": self.unit,
            "verdict": self.verdict_text,
            "reason": self.reason,
            "where": self.where,
            "beyond": self.beyond,
        }

    @classmethod
    def from_data(cls, data: Mapping[str, Any]) -> "Claim":
        """Return the claim from what `as_data` returned.

        Raises:
            KeyError, TypeError, ValueError: it is of another form.
        """
        interval = data["interval"]
        other_fields: dict[str, Any] = {k: v for k, v in data.items() if k not in ("interval", "verdict")}
        low_high = None if interval is None else (float(interval[0]), float(interval[1]))
        named = {words: verdict for verdict, words in _BEYOND.items()} if data["beyond"] else {}
        verdict = named.get(data["verdict"]) or Verdict(data["verdict"])
        return cls(interval=low_high, verdict=verdict, **other_fields)


def verdict_counts(claims: Sequence[Claim], beyond: bool) -> Sequence[tuple[int, Verdict, str]]:
    """Return how many of a paper's claims, or of those beyond it, have each verdict that occurs, with its words."""
    verdicts = [(c.verdict, c.verdict_text) for c in claims if c.beyond is beyond]
    return [(verdicts.count(v), *v) for v in sorted(set(verdicts), key=lambda v: list(Verdict).index(v[0]))]


@dataclass(frozen=True, kw_only=True)
class ComparisonTable:
    """A table of texts, in which published values stand beside ours.

    Attributes:
        title: what it compares.
        header: names of the columns; the first column names what a row is of.
        rows: texts; "" where there is no value.
        note: how its figures were made, in sentences.

    Raises:
        ValueError: a row is longer or shorter than the header.
    """

    title: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    note: str = ""

    def __post_init__(self) -> None:
        for row in self.rows:
            if len(row) != len(self.header):
                raise ValueError(f"{self.title}: row {list(row)} has {len(row)} cells, the header {len(self.header)}")

    def without_empty_columns(self) -> "ComparisonTable":
        """Return the table without columns in which no row has a value, as a quick plan leaves some."""
        kept = [i for i in range(len(self.header)) if any(row[i] for row in self.rows)]
        rows = [[row[i] for i in kept] for row in self.rows]
        return replace(self, header=[self.header[i] for i in kept], rows=rows)


class PublishedExperiment(abc.ABC):
    """A table or figure of a paper. Published values come from its scenario's `paper.toml`."""

    name: ClassVar[str]
    title: ClassVar[str]
    """What was tried, in a line, with its place in the paper."""
    scenario: ClassVar[str]

    def take_model(self, file: Path) -> None:  # noqa: ARG002
        """Let the plan have the file of a trained model.

        Raises:
            ValueError: with what is wrong with the model, or that it has no use for one.
        """
        raise ValueError(f"{self.name} has no use for a trained model")

    @abc.abstractmethod
    def plan(self, quick: bool) -> CampaignPlan:
        """Return the runs that it needs, with its usual seed; if `quick`, a fraction of them."""

    def campaign(self, points: Sequence[Mapping[str, str]], **others: Any) -> CampaignPlan:
        """Return a plan of points; the others are those of `CampaignPlan`."""
        return CampaignPlan(scenario=self.scenario, points=points, experiment=self.name, **others)

    def runs(self, table: CampaignTable, keep: Callable[[Row], bool] = is_done, free: Sequence[str] = ()) -> Runs:
        """Return the runs of a campaign's table to keep; `free` names parameters that do not tell points apart."""
        return Runs.of_plan(table, self.plan(quick=False), keep, free)

    @abc.abstractmethod
    def claims(self, table: CampaignTable) -> Sequence[Claim]:
        """Return the paper's claims with their verdicts, those beyond the paper last."""

    def record_claims(self, table: CampaignTable, runs: Path) -> Sequence[Claim]:  # noqa: ARG002
        """Return claims judged on the runs' records, whose folders are in `runs`; by default there are none."""
        return ()

    @abc.abstractmethod
    def tables(self, table: CampaignTable) -> Sequence[ComparisonTable]:
        """Return published values beside the campaign's."""

    @abc.abstractmethod
    def draw(self, table: CampaignTable, runs: Path, folder: Path) -> Sequence[Figure]:
        """Draw the figures into a folder, as PNG and SVG; return them in the order of a page.

        Args:
            table: the campaign's.
            runs: where the folders of its runs are.
            folder: where the figures go.
        """


@dataclass(frozen=True, kw_only=True)
class PaperResults:
    """The claims with their verdicts, and published values beside the campaign's."""

    claims: Sequence[Claim]
    tables: Sequence[ComparisonTable]

    @classmethod
    def of(cls, experiment: PublishedExperiment, table: CampaignTable, runs: Path) -> "PaperResults":
        """Judge the claims, those beyond the paper last, and fill in the tables; the runs' folders are in `runs`.

        Raises:
            KeyError: the table is of another version of the experiment, and lacks a column.
        """
        claims = [*experiment.claims(table), *experiment.record_claims(table, runs)]
        tables = [filled.without_empty_columns() for filled in experiment.tables(table)]
        return cls(claims=sorted(claims, key=lambda claim: claim.beyond), tables=tables)


def write_claims(claims: Sequence[Claim], folder: CampaignFolder) -> None:
    """Write `claims.json`, a list of claims.

    Raises:
        RecordNotWritten: it cannot be written.
    """
    entries = [claim.as_data() for claim in claims]
    write_whole(folder.path / "claims.json", json.dumps(entries, indent=2, allow_nan=False, ensure_ascii=False) + "\n")


def draw_figures(experiment: PublishedExperiment, table: CampaignTable, runs: Path, folder: Path) -> Sequence[Figure]:
    """Draw the figures into a folder, of runs whose folders are in `runs`; return them in the order of a page.

    Raises:
        RecordNotWritten: the disk is full.
    """
    with disk_errors_reported(folder):
        return experiment.draw(table, runs, folder_within(folder))
