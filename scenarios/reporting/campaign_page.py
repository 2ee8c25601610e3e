"""Writes the page of a campaign, of what is in its folder."""

import tempfile
from collections.abc import Sequence
from pathlib import Path

from markupsafe import Markup

from handover.scenarios.campaign.campaign_figures import draw_campaign
from handover.scenarios.campaign.campaign_folder import CampaignFolder
from handover.scenarios.campaign.campaign_results import CampaignResults
from handover.scenarios.campaign.point_layout import layout_of
from handover.scenarios.published.catalog import EXPERIMENTS
from handover.scenarios.published.claim import Claim
from handover.scenarios.published.comparison_table import ComparisonTable
from handover.scenarios.published.paper_results import PaperResults
from handover.scenarios.published.published_experiment import PublishedExperiment
from handover.scenarios.published.results import draw_figures
from handover.scenarios.reporting.campaign_facts import read_claims, read_results
from handover.scenarios.reporting.campaign_lead import campaign_lead
from handover.scenarios.reporting.claims_section import claims_section, comparison_section
from handover.scenarios.reporting.failures_section import failures_section
from handover.scenarios.reporting.figures_section import figures_section
from handover.scenarios.reporting.page import write_page
from handover.scenarios.reporting.pairs_section import pairs_section
from handover.scenarios.reporting.points_section import points_section
from handover.scenarios.reporting.runs_section import runs_section
from handover.scenarios.reporting.section import Section
from handover.scenarios.reporting.setting_section import setting_section
from handover.scenarios.reporting.spread_section import spread_section
from handover.scenarios.reporting.success_section import success_section
from handover.scenarios.run_folder import told_if_not_written


def write_campaign_page(folder: CampaignFolder, file: Path | None = None) -> None:
    """Write a campaign's, or a paper's, page; the campaign need not be complete, and nothing else is written.

    Args:
        folder: the campaign's.
        file: where the page goes; by default `report.html` in the folder, beside which the runs' pages are linked.

    Raises:
        BadRunFolder: it is not the folder of a campaign, or damaged; nothing is written.
        RecordNotWritten: there is no room.
    """
    with tempfile.TemporaryDirectory(prefix="handover-") as figures:
        _write(folder, read_results(folder), read_claims(folder), None, Path(figures), file)


def write_campaign_report(folder: CampaignFolder, file: Path | None = None, paper: PaperResults | None = None) -> None:
    """Write the page, and the figures of the campaign and of its paper into `figures/`.

    Args:
        folder: the campaign's.
        file: where the page goes, as of `write_campaign_page`.
        paper: what the runs say of the paper, if that is known already.

    Raises:
        BadRunFolder, RecordNotWritten: as `write_campaign_page`.
    """
    results = read_results(folder)
    claims, tables = (read_claims(folder), None) if paper is None else (paper.claims, paper.tables)
    with told_if_not_written(folder.figures):
        draw_campaign(results, folder.figures)
    _write(folder, results, claims, tables, folder.figures, file)


def _write(
    folder: CampaignFolder,
    results: CampaignResults,
    claims: Sequence[Claim],
    tables: Sequence[ComparisonTable] | None,
    figures: Path,
    file: Path | None,
) -> None:
    """Write the page; a paper's figures are drawn into a folder on the way, and its tables made if they are not."""
    named = EXPERIMENTS.get(str(results.told.get("experiment", "")))
    experiment = None if named is None else named()
    sections: list[Section | None] = [claims_section(claims)]
    if experiment is not None and results.points:
        sections += _published(experiment, tables, results, folder.runs, figures)
    if results.points:
        layout = layout_of(results)
        sections += [success_section(results, layout), spread_section(results, layout)]
    sections += [
        points_section(results),
        pairs_section(results),
        failures_section(results, folder.path),
        runs_section(results, folder.path),
        setting_section(results),
    ]
    title = results.scenario if experiment is None else f"{experiment.name}: {experiment.title}"
    write_page(file or folder.report, title, campaign_lead(results, claims), [s for s in sections if s is not None])


def _published(
    experiment: PublishedExperiment,
    tables: Sequence[ComparisonTable] | None,
    results: CampaignResults,
    runs: Path,
    figures: Path,
) -> Sequence[Section | None]:
    """Return published values beside ours, and the experiment's figures; a section that says why where it cannot."""
    try:
        tables = experiment.tables(results.table) if tables is None else tables
        drawn = draw_figures(experiment, results.table, runs, figures)
    except KeyError as e:
        html = Markup("<p>The campaign is of another version of {}, so this is left out: its runs have no {}.</p>")
        return [Section(anchor="comparison", title="Published and ours", html=html.format(experiment.name, e.args[0]))]
    return [comparison_section(tables), figures_section(drawn, figures)]
