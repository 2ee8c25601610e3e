"""Compares folders, and writes the comparison: `report.html`, `comparison.csv`, `comparison.json`, `figures/`."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from markupsafe import Markup

from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.plotting import PRINTED_FORMATS, draw_time_figures
from handover.scenarios.experiment.time_plot import TimeFigure
from handover.scenarios.pages.campaign_report.figures import draw_campaign
from handover.scenarios.pages.campaign_report.points import points_section, success_section
from handover.scenarios.pages.campaign_report.spread_section import spread_section
from handover.scenarios.pages.comparison.campaigns import ComparedCampaigns
from handover.scenarios.pages.comparison.entries import (
    CampaignEntry,
    Difference,
    Entry,
    NotComparable,
    RunEntry,
    differences_of,
    read_entries,
)
from handover.scenarios.pages.comparison.runs import MetricRow, Overlay, metric_rows, overlaid
from handover.scenarios.pages.comparison.sections import (
    campaign_outcome,
    differences_section,
    entries_section,
    files_section,
    metrics_section,
    tests_section,
)
from handover.scenarios.pages.comparison.tables import campaigns_csv, campaigns_data, runs_csv, runs_data
from handover.scenarios.runs.reporting.page import Section, write_page
from handover.scenarios.runs.reporting.time_plots import time_plots_section
from handover.scenarios.runs.results.run_folder import RunFolder, disk_errors_reported, write_whole
from handover.scenarios.runs.results.tolerated_faults import ToleratedFaults, drawing


@dataclass(frozen=True)
class CampaignComparison:
    """Campaigns beside each other."""

    results: ComparedCampaigns
    differences: Sequence[Difference]

    @property
    def entries(self) -> Sequence[CampaignEntry]:
        """What is compared."""
        return self.results.entries

    @property
    def data(self) -> dict[str, Any]:
        """The comparison as JSON can hold it."""
        return campaigns_data(self.results, self.differences)

    @property
    def csv(self) -> str:
        """Its table of points."""
        return campaigns_csv(self.results)

    def draw(self, folder: Path, faults: ToleratedFaults) -> Sequence[Figure]:
        """Draw its figures for papers into a folder."""
        return draw_campaign(self.results, folder, faults, self.results.layout) if self.results.points else ()

    def sections(self, page: Path, figures: Sequence[Figure]) -> Sequence[Section | None]:
        """Return the sections of its page."""
        results = self.results
        shown: list[Section | None] = []
        if results.points:
            layout = results.layout
            if layout.fits_a_page:
                shown += [success_section(results, layout), spread_section(results, layout)]
            shown.append(points_section(results, layout))
        return [
            entries_section(self.entries, page),
            differences_section(self.entries, self.differences),
            *shown,
            tests_section(results),
            files_section(figures),
        ]

    @property
    def header(self) -> Markup:
        """What stands under the page's heading."""
        lines = [Markup("<b>{}</b>: {}").format(e.name, campaign_outcome(e)) for e in self.entries]
        return Markup("<p class='verdict'>{}</p>").format(Markup("<br>").join(lines))


@dataclass(frozen=True)
class RunComparison:
    """Runs beside each other."""

    entries: Sequence[RunEntry]
    differences: Sequence[Difference]
    metrics: Sequence[MetricRow]
    overlay: Overlay

    @property
    def data(self) -> dict[str, Any]:
        """The comparison as JSON can hold it."""
        return runs_data(self.entries, self.metrics, self.differences, [p.title for p in self.overlay.plots])

    @property
    def csv(self) -> str:
        """Its table of metrics."""
        return runs_csv(self.entries, self.metrics)

    def draw(self, folder: Path, faults: ToleratedFaults) -> Sequence[Figure]:
        """Draw its figures for papers into a folder."""
        plots = self.overlay.plots
        if not plots:
            return ()
        names = ", ".join(e.name for e in self.entries)
        caption = f"{'; '.join(p.title for p in plots)}; of {names}."
        folder.mkdir(parents=True, exist_ok=True)
        with faults.tolerated("figure curves could not be drawn"):
            spec = TimeFigure(name="curves", caption=caption, plots=plots)
            return draw_time_figures([spec], self.overlay.time, folder, as_printed=True)
        return ()

    def sections(self, page: Path, figures: Sequence[Figure]) -> Sequence[Section | None]:
        """Return the sections of its page."""
        return [
            entries_section(self.entries, page),
            differences_section(self.entries, self.differences),
            time_plots_section(self.overlay.plots, self.overlay.time),
            metrics_section(self.entries, self.metrics),
            files_section(figures),
        ]

    @property
    def header(self) -> Markup:
        """What stands under the page's heading."""
        verdicts = [(e.name, "succeeded" if e.facts.summary["success"] else "failed") for e in self.entries]
        lines = [Markup("<b>{}</b> {}").format(name, verdict) for name, verdict in verdicts]
        left_out = [Markup("<p class='soft'>{}.</p>").format(line) for line in self.overlay.left_out]
        return Markup("<p class='verdict'>{}</p>").format(Markup("<br>").join(lines)) + Markup("").join(left_out)


Comparison = CampaignComparison | RunComparison


@drawing
def compare(
    folders: Sequence[Path], names: Sequence[str] = (), signals: Sequence[str] = (), metrics: Sequence[str] = ()
) -> Comparison:
    """Compare campaigns, or runs; nothing is written.

    Args:
        folders: of the campaigns, or of the runs.
        names: of what is compared, in the folders' order; by default the folders' own.
        signals: of runs, whose curves are laid over each other; by default the first of the scenario's plots.
        metrics: of campaigns, for tables and figures; by default the first of the headline.

    Raises:
        NotComparable: they cannot be compared; all faults are listed.
    """
    campaigns, runs = read_entries(folders, names)
    faults: list[str] = []
    if campaigns and signals:
        faults.append(
            f"--signal {signals[0]}: a campaign has no curves; name folders of runs, as in {folders[0]}/runs/"
        )
    if runs and metrics:
        faults.append(f"--metric {metrics[0]}: of runs all metrics are shown; it is for campaigns")
    if faults:
        raise NotComparable(faults)
    if campaigns:
        results = ComparedCampaigns(campaigns, metrics)
        return CampaignComparison(results, differences_of(campaigns, results.keys))
    return RunComparison(runs, differences_of(runs), metric_rows(runs), overlaid(runs, signals))


@drawing
def write_comparison(comparison: Comparison, folder: RunFolder) -> dict[str, Any]:
    """Write page, table, data and figures into a new folder, and return what `comparison.json` holds.

    Figures that cannot be drawn are named in its `left_out`, a line each.

    Raises:
        InvalidRunFolder: it cannot be made.
        RecordNotWritten: the disk is full.
    """
    folder.make()
    faults = ToleratedFaults()
    with disk_errors_reported(folder.figures):
        figures = comparison.draw(folder.figures, faults)
    drawn = [f"figures/{f.name}.{end}" for f in figures for end in PRINTED_FORMATS]
    data = {**comparison.data, "figures": drawn, **({"left_out": faults.lines} if faults.lines else {})}
    write_whole(folder.path / "comparison.json", json.dumps(data, indent=2, allow_nan=False) + "\n")
    write_whole(folder.path / "comparison.csv", comparison.csv)
    entries: Sequence[Entry] = comparison.entries
    names = [e.name for e in entries]
    title = f"{entries[0].scenario}: {', '.join(names[:-1])} and {names[-1]}"
    sections = comparison.sections(folder.report, figures)
    write_page(folder.report, title, comparison.header, [s for s in sections if s is not None])
    return data
