"""Prints the results of a published experiment: ours beside the published, and verdicts with their reasons."""

from rich.console import Console
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from handover.scenarios.cli.console import open_console
from handover.scenarios.cli.summaries.campaign import print_reasons
from handover.scenarios.published.published_experiment import (
    Claim,
    ComparisonTable,
    PaperResults,
    PublishedExperiment,
    Verdict,
    verdict_counts,
)
from handover.scenarios.runs.campaign.folder import CampaignFolder
from handover.scenarios.runs.campaign.table import CampaignTable

_STYLES = {Verdict.REPRODUCED: "bold green", Verdict.NOT_REPRODUCED: "bold red", Verdict.NOT_COMPARABLE: "bold"}


def print_results(
    experiment: PublishedExperiment, results: PaperResults, table: CampaignTable, folder: CampaignFolder
) -> None:
    """Print tables, claims, why runs failed or were lost, and where claims and table are."""
    console = open_console()
    console.print(f"{experiment.name}: {experiment.title}", style="bold", markup=False)
    for compared in results.tables:
        _print_table(console, compared)
    for beyond, heading in ((False, "Claims"), (True, "Beyond the paper")):
        claims = [claim for claim in results.claims if claim.beyond is beyond]
        if claims:
            console.print(f"\n{heading}", style="bold")
        for claim in claims:
            _print_claim(console, claim)
    console.print()
    for beyond, heading in ((False, "The paper's claims"), (True, "Beyond the paper")):
        counts = verdict_counts(results.claims, beyond)
        if counts:
            console.print(f"{heading}: " + ", ".join(f"{n} {words}" for n, _, words in counts))
    print_reasons(console, table)
    console.print(f"claims: {folder.path / 'claims.json'}", markup=False, soft_wrap=True)
    console.print(f"table: {folder.table}", markup=False, soft_wrap=True)


def _print_table(console: Console, compared: ComparisonTable) -> None:
    rows = Table(box=None, padding=(0, 2, 0, 0), pad_edge=False)
    for heading, *cells in zip(compared.header, *compared.rows, strict=True):
        longest_word = max((len(word) for text in (heading, *cells) for word in text.split()), default=0)
        rows.add_column(Text(heading), overflow="fold", min_width=longest_word)
    for row in compared.rows:
        rows.add_row(*map(Text, row))
    console.print(f"\n{compared.title}", style="bold", markup=False)
    console.print(Padding(rows, (0, 0, 0, 2), expand=False))
    if compared.note:
        console.print(Padding(Text(compared.note, style="dim"), (0, 0, 0, 2), expand=False))


def _print_claim(console: Console, claim: Claim) -> None:
    """Print the verdict and the claim, the figures below, then the reason."""
    figures = [f"published: {claim.published}"] if claim.published else []
    figures += [f"ours: {claim.measured}"] if claim.measured else []
    if claim.interval is not None:
        figures.append(f"95 % interval: {claim.interval_text}")
    where = f" ({claim.where})" if claim.where else ""
    console.print(Text.assemble((claim.verdict_text, _STYLES[claim.verdict]), f"  {claim.claim}{where}"))
    if figures:
        console.print(Padding(Text("; ".join(figures)), (0, 0, 0, 4), expand=False))
    console.print(Padding(Text(claim.reason, style="dim"), (0, 0, 0, 4), expand=False))
