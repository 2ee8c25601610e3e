"""The command `handover paper`: runs a paper's experiment and compares its results with the published ones."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click
from rich.table import Table
from rich.text import Text

from handover.cosim.exceptions import nearest
from handover.scenarios.cli.campaign import CampaignOutcome, pool_config, run_campaign_command
from handover.scenarios.cli.console import open_console
from handover.scenarios.cli.options import FILE, SEED, HeadedCommand, campaign_options
from handover.scenarios.runs.execution.errors import UsageError, require_extra
from handover.scenarios.runs.execution.progress import doing, say
from handover.scenarios.runs.results.run_folder import InvalidRunFolder

if TYPE_CHECKING:
    from handover.scenarios.published.published_experiment import PublishedExperiment

_HELP = """Run a paper's EXPERIMENT, and compare its results with the published ones.

Without EXPERIMENT, list them.

Each claim of the paper gets a verdict, reproduced, not reproduced or not comparable, with the rule behind it. What is
claimed here beyond the paper holds, does not hold, or has too few runs. Rules were laid down before the runs. Intervals
are at 95 %: Clopper and Pearson's for rates, bootstrapped for times and distances.

The folder is that of a campaign, as of `handover sweep`, with claims.json, and figures for papers in figures/. However
it was ended, run the same command again to resume; nothing that is done is repeated.

\b
Exit status
  0    it ran, whatever the verdicts
  1    interrupted with Ctrl-C; run the same command again to resume
  2    usage error or invalid input; nothing was written
  3    a unit failed in a run, a run was lost, or the disk is full; what is done is kept
  130  aborted with Ctrl-C: before the first run, or by a second one
"""


@click.command("paper", cls=HeadedCommand, help=_HELP, context_settings={"show_default": True})
@click.argument("experiment", required=False, metavar="[EXPERIMENT]")
@click.option("--quick", is_flag=True, help="A fraction of the runs; most claims need all.")
@click.option("--seed", type=SEED, help="Seed of the campaign.  [default: the experiment's]")
@click.option(
    "--model",
    type=FILE,
    help="vsl-2: file of a trained network of the paper's size, without which that is left out.",
)
@campaign_options
def paper(
    experiment: str | None,
    quick: bool,
    seed: int | None,
    model: Path | None,
    out: Path | None,
    no_report: bool,
    workers: int | None,
    scheduler: str | None,
) -> None:
    """Run a paper's EXPERIMENT."""
    for extra in ("campaigns", "reports"):
        require_extra(extra, "experiments of papers")
    from handover.scenarios.published.catalog import EXPERIMENTS  # its statistics take long to load

    if experiment is None:
        _list(EXPERIMENTS.values())
        return
    if experiment not in EXPERIMENTS:
        raise UsageError(f"no experiment {experiment!r}: {nearest(experiment, EXPERIMENTS)}")
    published = EXPERIMENTS[experiment]()
    if model is not None:
        try:
            published.take_model(model.absolute())
        except ValueError as e:
            raise UsageError(f"--model: {e}") from e
    plan = published.plan(quick)
    plan = plan if seed is None else replace(plan, seed=seed)
    finish = _Finish(published, report=not no_report)
    outcome = run_campaign_command(replace(plan, experiment=experiment), out, pool_config(workers, scheduler), finish)
    sys.exit(outcome.status)


class _Finish:
    """Prints claims, then writes figures and, unless --no-report, the page of a campaign."""

    def __init__(self, experiment: PublishedExperiment, report: bool) -> None:
        self._experiment, self._report = experiment, report

    def __call__(self, outcome: CampaignOutcome) -> None:
        folder, table = outcome.folder, outcome.table
        from handover.scenarios.cli.summaries.campaign import print_report_place
        from handover.scenarios.cli.summaries.claims import print_results
        from handover.scenarios.pages.campaign_report.campaign_page import write_campaign_report
        from handover.scenarios.published.published_experiment import PaperResults, draw_figures, write_claims

        try:
            results = PaperResults.of(self._experiment, table, folder.runs)
        except KeyError as e:
            fault = f"it is of another version of {self._experiment.name}: its runs have no {e.args[0]}"
            raise InvalidRunFolder(folder.path, fault) from e
        write_claims(results.claims, folder)
        print_results(self._experiment, results, table, folder)
        if self._report and not folder.is_reported:
            with doing("drawing figures, writing the report"):
                for line in write_campaign_report(folder, paper=results):
                    say(line)
        else:
            with doing("drawing figures"):
                draw_figures(self._experiment, table, folder.runs, folder.figures)
        print_report_place(folder)


def _list(experiments: Iterable[type[PublishedExperiment]]) -> None:
    rows = Table(box=None, padding=(0, 2), pad_edge=True)
    for heading in ("experiment", "runs", "quick", ""):
        rows.add_column(heading, justify="right" if heading in ("runs", "quick") else "left")
    for kind in experiments:
        full, quick = (str(kind().plan(q).size) for q in (False, True))
        rows.add_row(Text(kind.name), full, quick, Text(kind.title))
    open_console().print(rows)
