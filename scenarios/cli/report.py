"""The command `handover report`: writes the page of a run or of a campaign again."""

from pathlib import Path

import click

from handover.scenarios.cli.options import PATH, page_to_write, trust_option
from handover.scenarios.runs.campaign.folder import OF_NEITHER, CampaignFolder
from handover.scenarios.runs.execution.errors import UsageError, one_line_errors, require_extra
from handover.scenarios.runs.execution.progress import doing, say
from handover.scenarios.runs.results.run_folder import InvalidRunFolder, RunFolder, check_no_links, check_place

_HELP = """Write the page of the run or campaign in DIR again: one HTML file that opens offline.

The page is made of what is in DIR, also of a run that was interrupted or killed, or that another version wrote. A run's
record, or a campaign's table, is completed first, and the page shows what there is.

With --runs, each run of a campaign gets its page, too, to which the campaign's page links; each takes some 5 MB.
"""


@click.command("report", help=_HELP, short_help="Write the page of a run or of a campaign.")
@click.argument("folder", metavar="DIR", type=PATH)
@trust_option
@click.option("--figures", is_flag=True, help="Draw the figures again, too, as PNG and SVG, into DIR/figures.")
@click.option("--runs", is_flag=True, help="Write the pages of a campaign's runs, too, into DIR/runs/NAME.")
@click.option(
    "--out",
    "file",
    metavar="FILE",
    type=PATH,
    help="The page, a name that ends with .html; a file of that name is replaced.  [default: DIR/report.html]",
)
def report(folder: Path, figures: bool, runs: bool, file: Path | None) -> None:
    """Write the page of a run or of a campaign."""
    with one_line_errors():
        if not folder.is_dir():
            raise UsageError(f"{folder} is not a folder; name that of a run or of a campaign")
        page = page_to_write(folder, file)
        require_extra("reports", "the page")
        if figures:
            check_place(folder)
        campaign = CampaignFolder(folder)
        if campaign.is_there:
            with doing("drawing figures, writing the report" if figures else "writing the report"):
                _write_of_campaign(campaign, page, figures, runs)
        elif not RunFolder.of_run(folder).is_there:
            raise UsageError(f"{folder} {OF_NEITHER}")
        elif runs:
            raise UsageError(f"{folder} is the folder of a run; --runs is for that of a campaign")
        else:
            with doing("drawing figures, writing the report" if figures else "writing the report"):
                _write_of_run(RunFolder.of_run(folder), page, figures)
    click.echo(f"report: {page}")


def _write_of_campaign(campaign: CampaignFolder, page: Path, figures: bool, runs: bool) -> None:
    from handover.scenarios.pages.campaign_report.campaign_page import write_campaign_page, write_campaign_report
    from handover.scenarios.runs.campaign.table_writer import rebuild_table  # pyarrow is slow to import

    if runs:
        check_no_links(campaign.path, "runs", "runs/*")
    rebuild_table(campaign)
    if runs:
        _write_of_runs(campaign)
    for line in (write_campaign_report if figures else write_campaign_page)(campaign, page):
        say(line)


def _write_of_runs(campaign: CampaignFolder) -> None:
    """Write the pages of a campaign's runs; a line for each that cannot be made."""
    from handover.scenarios.runs.campaign.table import CampaignTable

    for name in CampaignTable.read(campaign.table).column("run").tolist():
        run = RunFolder.of_run(campaign.runs / name)
        if not run.is_there:  # it was lost
            continue
        try:
            _write_of_run(run, run.report, figures=False)
        except InvalidRunFolder as e:
            say(f"{name}: {e}")


def _write_of_run(run: RunFolder, page: Path, figures: bool) -> None:
    from handover.scenarios.runs.execution.resume import complete_signals
    from handover.scenarios.runs.reporting.run_figures import draw_run
    from handover.scenarios.runs.reporting.run_page import write_run_page
    from handover.scenarios.runs.results.run_facts import RunFacts

    with run.held():
        RunFacts.read(run)  # before anything is completed: it may be no run's folder at all
        complete_signals(run)
        faults = draw_run(run) if figures else []
        for line in [*faults, *write_run_page(run, page)]:
            say(line)
