"""The gallery: a run of every scenario, and a small campaign of every published experiment, by the commands.

Both are those that tests keep (`support.kept_runs`): made again only when code, packages or arguments have changed.
"""

import json
import re
import shutil
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from urllib.parse import unquote

from PIL import Image
from support.commands import LOADED, forking
from support.in_process_pool import use_in_process_pool
from support.kept_runs import kept_run

from handover.cosim.exceptions import counted
from handover.scenarios.experiment.display_unit import unit_symbol
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.published.catalog import EXPERIMENTS
from handover.scenarios.published.published_experiment import (
    Claim,
    ComparisonTable,
    PaperResults,
    draw_figures,
    verdict_counts,
)
from handover.scenarios.runs.campaign.table import CampaignTable
from handover.scenarios.runs.reporting.graph import drawing_of
from handover.scenarios.runs.reporting.run_figures import draw_record
from handover.scenarios.runs.results.run_facts import RunFacts, record_of
from handover.scenarios.runs.results.run_folder import RunFolder
from handover.scenarios.runs.results.tables import format_metric
from handover.scenarios.runs.results.tolerated_faults import ToleratedFaults

_FIRST = ("scene", "pictures", "shape", "hand", "path", "error", "motion")
"""Names of figures that show most of a scenario, best first."""

_OF_CAMPAIGNS = ("cli.paper", "cli.campaign", "published.catalog", "runs.campaign.run_job", "experiment.plotting")
"""Modules that campaigns need besides."""

_POINTS: Mapping[str, Sequence[int]] = {
    "flyer-approaches": range(0, 500, 50),
    "flyer-controllers": (6, 8, 10, 74),
    "flyer-handover": (0, 3, 6, 9, 18, 21),
    "flyer-impedance": range(12),
    "flyer-navigation": (0, 2),
    "flyer-stability": range(30, 45, 3),
    "flyer-study": (20, 28),
    "helix-1": (8,),
    "helix-2": (5, 9),
    "helix-3": (4,),
    "helix-disturbances": (0, 4, 8, 12),
    "helix-improvements": (128, 208),
    "helix-places": range(0, 200, 40),
    "helix-reflex": range(9),
    "helix-workspace": range(0, 50, 4),
    "ir-convergence": range(0, 10, 2),
    "ir-limits": range(0, 125, 5),
    "ir-sensor": (9, 10, 11),
    "ir-table": range(40),
    "vsl-1": range(75),
    "vsl-2": (*range(12), 108, 109),
}
"""Points of each experiment's plan that are run, once each: so few that all of them take some minutes of CPU."""

_PIXELS_ON_PAPER = 96.0
"""Of a screen, by CSS, an inch."""


class EmptyTable(ValueError):
    """A table of an experiment in which none of the few runs shows anything."""


@dataclass(frozen=True)
class ShownFigure:
    """A figure in a page: its path relative to the site, its caption, and its size on paper, in a screen's pixels."""

    path: str
    caption: str
    width: int
    height: int


Figures = Mapping[str, ShownFigure]
"""Figures by name, in the order of a page."""


@dataclass(frozen=True)
class MetricRow:
    """A metric in a table: its unit, what it is, and its value in the run of the gallery, "" where that lacks it."""

    name: str
    unit: str
    description: str
    value: str = ""


@dataclass(frozen=True)
class GalleryRun:
    """What the gallery shows of a run.

    Attributes:
        success, reason: its verdict.
        figures: its figures.
        page: its report page.
        diagram: its system, as SVG.
        metrics: its metrics.
    """

    success: bool
    reason: str
    figures: Figures
    page: str
    diagram: str
    metrics: Sequence[MetricRow]

    @property
    def first(self) -> ShownFigure:
        """The figure that shows most."""
        known = [self.figures[name] for name in _FIRST if name in self.figures]
        return (known or list(self.figures.values()))[0]


@dataclass(frozen=True)
class GalleryExperiment:
    """What the gallery shows of a published experiment.

    Attributes:
        title: what was tried.
        doc: the experiment's docstring.
        scenario: whose runs these are.
        runs, quick, whole: number of its runs here, of its quick form, and of the whole experiment.
        claims: with their verdicts.
        tables: published values beside ours.
        figures: by name.
        metrics: of its runs.
    """

    title: str
    doc: str
    scenario: str
    runs: int
    quick: int
    whole: int
    claims: Sequence[Claim]
    tables: Sequence[ComparisonTable]
    figures: Figures
    metrics: Sequence[MetricRow]

    @property
    def extent(self) -> str:
        """How many runs there are here, of how many, as a sentence."""
        return f"Shown: {counted(self.runs, 'run')} of its {self.whole:,}; `--quick` makes {self.quick}."

    @property
    def verdicts(self) -> str:
        """How many claims have each verdict."""
        counts = [*verdict_counts(self.claims, beyond=False), *verdict_counts(self.claims, beyond=True)]
        return ", ".join(f"{n} {words}" for n, _, words in counts) or "none"


def warm_up() -> None:
    """Let the process from which commands are forked have loaded what campaigns need, before the first of them."""
    forking().set_forkserver_preload([*LOADED, *(f"handover.scenarios.{m}" for m in _OF_CAMPAIGNS)])


def gallery_run(name: str, files: Path) -> GalleryRun:
    """Run a scenario with its defaults, unless that is kept, and copy figures and page below the site's files."""
    run = kept_run("run", name)
    figures = _drawn(lambda folder: _figures_of_run(RunFolder.of_run(run), folder), files, f"gallery/{name}")
    page = f"gallery/{name}/report.html"
    for file in (f for f in run.iterdir() if f.is_file()):  # the page links them
        shutil.copyfile(file, files / f"gallery/{name}/{file.name}")
    drop_broken_links(files / page)
    summary = json.loads((run / "summary.json").read_text(encoding="utf-8"))
    content = json.loads((run / "run.json").read_text(encoding="utf-8"))
    metrics = {n: MetricRow(n, unit_symbol(m["unit"]), m["description"], format_metric(m))
               for n, m in summary["metrics"].items()}  # fmt: skip
    ordered = {n: metrics[n] for n in (*(n for n in content["headline"] if n in metrics), *metrics)}
    diagram = drawing_of(content["system"])
    return GalleryRun(bool(summary["success"]), summary["reason"], figures, page, diagram, [*ordered.values()])


def drop_broken_links(page: Path) -> None:
    """Replace a page's links to files that are not beside it by their text."""

    def linked(found: re.Match[str]) -> str:
        return found[0] if (page.parent / unquote(found[1])).exists() else found[2]

    html = page.read_text(encoding="utf-8")
    page.write_text(re.sub(r'<a href="([^":#]+)">(<code>[^<]*</code>)</a>', linked, html), encoding="utf-8")


def kept_campaign(name: str) -> Path:
    """Return the folder of few runs of an experiment."""
    return kept_run("paper", name, "--no-report", before=(plan_few_runs, name, tuple(_POINTS[name])))


def gallery_experiment(name: str, files: Path) -> GalleryExperiment:
    """Carry out an experiment with few runs, unless that is kept, and copy its figures below the site's files.

    Raises:
        EmptyTable: a table has no value.
    """
    experiment = EXPERIMENTS[name]()
    campaign = kept_campaign(name)
    table = CampaignTable.read(campaign)
    results = PaperResults.of(experiment, table, campaign / "runs")
    check_tables(name, results.tables)
    return GalleryExperiment(
        title=experiment.title,
        doc=experiment.__doc__ or "",
        scenario=experiment.scenario,
        runs=len(table),
        quick=experiment.plan(quick=True).size,
        whole=experiment.plan(quick=False).size,
        claims=results.claims,
        tables=results.tables,
        figures=_drawn(
            lambda folder: draw_figures(experiment, table, campaign / "runs", folder),
            files,
            f"gallery/experiments/{name}",
        ),
        metrics=[MetricRow(n, unit_symbol(table.unit(n)), table.description(n)) for n in table.metrics],
    )


def check_tables(name: str, tables: Iterable[ComparisonTable]) -> None:
    """Raise an error if an experiment's table has rows but no value beside their names.

    A table without rows lists what did not occur, such as failures: its page says so.

    Raises:
        EmptyTable: it names the table, and where the runs are chosen.
    """
    if empty := [table.title for table in tables if table.rows and not any(any(row[1:]) for row in table.rows)]:
        raise EmptyTable(f"{name}: no value in the table {'; '.join(empty)}: choose other points in _POINTS")


def plan_few_runs(name: str, points: Sequence[int]) -> None:
    """Let this process carry out some points of an experiment's plan, once each and by itself."""
    use_in_process_pool()
    whole = EXPERIMENTS[name]().plan(quick=False)
    few = replace(whole, points=[whole.points[i] for i in points], repetitions=1)
    EXPERIMENTS[name].plan = lambda *_given, **_named: few  # type: ignore


def metrics_of(run: GalleryRun, campaigns: Iterable[GalleryExperiment]) -> list[MetricRow]:
    """Return the metrics of a scenario's run, and those that only some of its runs in campaigns have."""
    rows = {row.name: row for row in run.metrics}
    for campaign in campaigns:
        for row in campaign.metrics:
            rows.setdefault(row.name, row)
    return list(rows.values())


def _figures_of_run(run: RunFolder, to: Path) -> Sequence[Figure]:
    faults, record = ToleratedFaults(), record_of(run)
    assert record is not None, f"{run.path} has no record"
    figures = draw_record(RunFacts.read(run), record, to, faults)
    assert not faults.lines, faults.lines
    return figures


def _drawn(draw: Callable[[Path], Iterable[Figure]], files: Path, name: str) -> Figures:
    """Draw figures with their captions into a folder that is made for them."""
    folder = files / name
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    shown: dict[str, ShownFigure] = {}
    with TemporaryDirectory() as drawn:
        for figure in draw(Path(drawn)):
            file = shutil.copy(Path(drawn) / f"{figure.name}.png", folder)
            with Image.open(file) as picture:
                per_inch = picture.info["dpi"][0]
                width, height = (round(_PIXELS_ON_PAPER * pixels / per_inch) for pixels in picture.size)
            shown[figure.name] = ShownFigure(f"{name}/{figure.name}.png", figure.caption, width, height)
    return shown
