"""Writes the page of a campaign from its folder: header, claims, settings, and the sections of other modules."""

import base64
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup

from handover.cosim.exceptions import counted, one_line
from handover.cosim.files import scratch_folder
from handover.cosim.typed_data import read_typed
from handover.scenarios.experiment.display_unit import display_unit
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.pages.campaign_report.figures import draw_campaign
from handover.scenarios.pages.campaign_report.pairs_section import pairs_section
from handover.scenarios.pages.campaign_report.point_layout import layout_of
from handover.scenarios.pages.campaign_report.points import points_section, success_section
from handover.scenarios.pages.campaign_report.runs import failures_section, runs_section
from handover.scenarios.pages.campaign_report.spread_section import spread_section
from handover.scenarios.published.catalog import EXPERIMENTS
from handover.scenarios.published.published_experiment import (
    Claim,
    ComparisonTable,
    PaperResults,
    PublishedExperiment,
    Verdict,
    draw_figures,
    verdict_counts,
)
from handover.scenarios.runs.campaign.folder import CampaignFolder
from handover.scenarios.runs.campaign.results import CampaignResults, read_results
from handover.scenarios.runs.execution.request import is_file
from handover.scenarios.runs.reporting.html import rows_table
from handover.scenarios.runs.reporting.page import Section, write_page
from handover.scenarios.runs.results.run_folder import InvalidRunFolder, disk_errors_reported
from handover.scenarios.runs.results.tables import format_value, options_in_words
from handover.scenarios.runs.results.tolerated_faults import ToleratedFaults


def _setting_section(results: CampaignResults) -> Section:
    """Return tables of what is set for all runs; other parameters have the scenario's defaults."""
    metadata = results.metadata
    options = options_in_words(metadata.get("master", {}))
    parts = [
        _settings_table("Fixed parameters", {n: _setting_text(results, n, v) for n, v in metadata["fixed"].items()}),
        _settings_table("Master", {n: format_value(v) for n, v in options.items() if v is not None}),
        _settings_table("Versions", {n: str(v) for n, v in metadata.get("versions", {}).items()}),
        _fmus(metadata.get("units", {})),
    ]
    others = "Parameters that are neither varied nor fixed have"
    defaults = f"{others} the scenario's defaults; each run's run.json has all."
    if is_file(results.scenario):
        defaults = f"{others} the values that the file gives."
    html = Markup("<div class='columns'>{}</div><p class='soft'>{}</p>").format(Markup().join(parts), defaults)
    return Section(anchor="setting", title="Setting", html=html)


def _settings_table(title: str, rows: Mapping[str, str]) -> Markup:
    if not rows:
        return Markup()
    return Markup("<div><h3>{}</h3>{}</div>").format(
        title, rows_table(("name", "value"), list(rows.items()), numbers=(1,))
    )


def _fmus(units: Mapping[str, Mapping[str, str]]) -> Markup:
    if not units:
        return Markup()
    rows = [
        (
            Markup("<span class='name'>{}</span>").format(name),
            Markup("<span class='name'>{}</span>").format(u["fmu"]),
            Markup("<code>{}</code>").format(u["sha256"][:12]),
        )
        for name, u in units.items()
    ]
    return Markup("<div class='across'><h3>FMUs</h3>{}</div>").format(rows_table(("unit", "file", "sha256"), rows))


def _setting_text(results: CampaignResults, name: str, text: str) -> str:
    if results.is_number(name):
        return display_unit(results.unit(name), float(text)).text(float(text))
    unit = results.unit(name)
    return text if unit == "1" else f"{text} {unit}"


def _figures_section(figures: Sequence[Figure], folder: Path) -> Section | None:
    """Return figures with their captions, None if there are none; `folder` has them as PNG."""
    if not figures:
        return None
    html = Markup("\n").join(_figure_html(f, folder / f"{f.name}.png") for f in figures)
    return Section(anchor="figures", title="Figures", html=html)


def _figure_html(figure: Figure, file: Path) -> Markup:
    data = base64.b64encode(file.read_bytes()).decode()
    return Markup(
        "<figure><div class='scroll'><img class='paper' alt='{}' src='data:image/png;base64,{}'></div>"
        "<figcaption>{}</figcaption></figure>"
    ).format(figure.name.replace("_", " "), data, figure.caption)


_HEADER = ("claim", "published", "ours", "95 % interval", "verdict")
_HEADER_BEYOND = tuple(name for name in _HEADER if name != "published")
_VERDICT_COLOURS = {Verdict.REPRODUCED: "good", Verdict.NOT_REPRODUCED: "bad", Verdict.NOT_COMPARABLE: "soft"}


def _claims_section(claims: Sequence[Claim]) -> Section | None:
    """Return the table of claims with their verdicts, this project's own below; None if there are none."""
    parts: list[Markup] = []
    for beyond, title, header in ((False, "", _HEADER), (True, "Beyond the paper", _HEADER_BEYOND)):
        rows = [_claim_rows(c, header) for c in claims if c.beyond is beyond]
        if rows:
            heads = Markup().join(Markup("<th scope='col'>{}</th>").format(h) for h in header)
            heading = Markup("<h3>{}</h3>").format(title) if title else Markup()
            table = Markup("<table class='cards claims'><thead><tr>{}</tr></thead><tbody>\n{}\n</tbody></table>")
            parts.append(heading + table.format(heads, Markup("\n").join(rows)))
    return Section(anchor="claims", title="Claims", html=Markup("\n").join(parts)) if parts else None


def _verdict_html(verdict: Verdict, words: str) -> Markup:
    """Return the words of a verdict in its colour."""
    return Markup("<b class='{}'>{}</b>").format(_VERDICT_COLOURS[verdict], words)


def _claim_rows(claim: Claim, header: Sequence[str]) -> Markup:
    where = Markup("<br><span class='soft'>{}</span>").format(claim.where) if claim.where else Markup()
    verdict = _verdict_html(claim.verdict, claim.verdict_text)
    cells = {
        "claim": Markup("{}{}").format(claim.claim, where),
        "published": claim.published,
        "ours": claim.measured,
        "95 % interval": claim.interval_text,
        "verdict": verdict,
    }
    text = Markup().join(
        Markup("<td data-label='{}'{}>{}</td>").format(
            name, Markup() if cells[name] else Markup(" class='empty'"), cells[name]
        )
        for name in header
    )
    why = Markup("<tr class='why'><td colspan='{}'>{}</td></tr>").format(len(header), claim.reason)
    return Markup("<tr>{}</tr>").format(text) + why


def _comparison_section(tables: Sequence[ComparisonTable]) -> Section | None:
    """Return published values beside ours; None if there are none."""
    note = Markup("<p class='soft'>{}</p>")
    parts = [
        Markup("<h3>{}</h3>").format(t.title)
        + rows_table(t.header, t.rows)
        + (note.format(t.note) if t.note else Markup())
        for t in tables
    ]
    if not parts:
        return None
    return Section(anchor="comparison", title="Published and ours", html=Markup("\n").join(parts))


_MAX_VALUES = 10


def campaign_header(results: CampaignResults, claims: Sequence[Claim]) -> Markup:
    """Return the page's header: what was run, how it went, claims by verdict, and the plan in sentences."""
    lines = [Markup("<p class='soft'>{}</p>").format(_scenario(results)), _verdict(results)]
    for beyond, heading in ((False, "The paper's claims"), (True, "Beyond the paper")):
        counts = verdict_counts(claims, beyond)
        if counts:
            verdicts = Markup(", ").join(Markup("{} {}").format(n, _verdict_html(v, words)) for n, v, words in counts)
            lines.append(Markup("<p>{}: {}.</p>").format(heading, verdicts))
    lines.append(Markup("<p class='soft'>{}</p>").format(f"{_plan(results)} {_cost(results)}".strip()))
    return Markup("\n").join(lines)


def _scenario(results: CampaignResults) -> str:
    """Describe the scenario by what the page's title lacks: below a paper's title its name, else what it does."""
    if name := results.metadata.get("experiment"):
        known = EXPERIMENTS.get(str(name))
        whole = 0 if known is None else known().plan(quick=False).size
        some = f": a quick plan, of which the whole one has {counted(whole, 'run')}" if results.planned < whole else ""
        return f"Runs of the scenario {results.scenario}{some}."
    scenario = results.experiment
    return str(results.metadata.get("title", "" if scenario is None else scenario.title))


def _verdict(results: CampaignResults) -> Markup:
    ended, planned, status = len(results.table), results.planned, results.table.column("status")
    done, failed, lost = (int(np.count_nonzero(status == s)) for s in ("done", "failed", "lost"))
    parts = [f"in {results.successes} of {counted(done, 'run')} done the task succeeded"]
    parts += [f"{failed} failed to run"] if failed else []
    parts += [f"{counted(lost, 'was', 'were')} lost"] if lost else []
    sentence = "; ".join(parts) + "."
    if ended < planned:
        so_far = Markup("<b>{} of {} runs so far</b>; run the same command again to resume.").format(ended, planned)
        return Markup("<p class='verdict'>{} {}</p>").format(so_far, sentence[0].upper() + sentence[1:])
    kind = " bad" if failed or lost else ""
    return Markup("<p class='verdict{}'><b>{}</b>: {}</p>").format(kind, counted(planned, "run"), sentence)


def _plan(results: CampaignResults) -> str:
    """Describe what was varied and how often each point was run."""
    metadata = results.metadata
    varied = [f"{name.replace('_', ' ')} ({_values(results, name)})" for name in results.varied]
    points, repetitions = len(metadata["points"]), int(metadata["repetitions"])
    parts = [f"Varied: {'; '.join(varied)}" if varied else "Nothing is varied"]
    parts.append(f"{counted(points, 'point')}, {counted(repetitions, 'run')} each; campaign's seed {metadata['seed']}")
    if metadata.get("paired"):
        parts.append("Runs of a repetition share a seed, so that points can be compared run by run")
    return ". ".join(parts) + "."


def _cost(results: CampaignResults) -> str:
    """Describe the time that all runs took together."""
    if not len(results.table):
        return ""
    cpu, wall = (float(np.nansum(results.table.column(n).astype(np.float64))) for n in ("cpu_seconds", "wall_seconds"))
    times = [display_unit("s", seconds).text(seconds) for seconds in (cpu, wall)]
    return f"The runs took {times[0]} of CPU time, and {times[1]} from beginning to end, added up."


def _values(results: CampaignResults, name: str) -> str:
    texts = list(dict.fromkeys(values[name] for values in results.metadata["points"] if name in values))
    if results.is_number(name):
        unit = display_unit(results.unit(name), [float(t) for t in texts])
        shown = [f"{float(t) * unit.factor:.4g}" for t in texts]
        symbol = f" {unit.symbol}" if unit.symbol else ""
    else:
        shown, symbol = [results.words(name, t) for t in texts], ""
    if len(shown) > _MAX_VALUES:
        shown = [*shown[:4], "…", shown[-1]]
    return ", ".join(shown) + symbol


def read_claims(folder: CampaignFolder) -> Sequence[Claim]:
    """Read a paper's claims with their verdicts; none if the campaign is of no paper, or not complete.

    Raises:
        InvalidRunFolder: the file is damaged.
    """
    file = folder.path / "claims.json"
    if not file.exists():
        return ()
    try:
        return [Claim.from_data(entry) for entry in read_typed(file, list[dict[str, Any]])]
    except (OSError, KeyError, TypeError, ValueError) as e:
        fault = f"its {file.name} is damaged: {one_line(e)}; run the same `handover paper` command again to rewrite it"
        raise InvalidRunFolder(folder.path, fault) from e


def write_campaign_page(folder: CampaignFolder, file: Path | None = None) -> list[str]:
    """Write a campaign's, or a paper's, page; the campaign need not be complete, and nothing else is written.

    Returns what could not be drawn, a line each.

    Args:
        folder: the campaign's.
        file: where the page goes; by default `report.html` in the folder, beside which the runs' pages are linked.

    Raises:
        InvalidRunFolder: it is not the folder of a campaign, or damaged; nothing is written.
        RecordNotWritten: the disk is full.
    """
    faults = ToleratedFaults(KeyError)
    with scratch_folder("figures") as figures:
        _write(folder, read_results(folder), read_claims(folder), None, figures, file, faults)
    return faults.lines


def write_campaign_report(
    folder: CampaignFolder, file: Path | None = None, paper: PaperResults | None = None
) -> list[str]:
    """Write the page, and the figures of the campaign and of its paper into `figures/`.

    Returns what could not be drawn, a line each.

    Args:
        folder: the campaign's.
        file: where the page goes, as of `write_campaign_page`.
        paper: the paper's claims and tables for these runs, if they are made already; else they are read.

    Raises:
        InvalidRunFolder, RecordNotWritten: as `write_campaign_page`.
    """
    results = read_results(folder)
    claims, tables = (read_claims(folder), None) if paper is None else (paper.claims, paper.tables)
    faults = ToleratedFaults(KeyError)
    with disk_errors_reported(folder.figures):
        draw_campaign(results, folder.figures, faults)
    _write(folder, results, claims, tables, folder.figures, file, faults)
    return faults.lines


def _write(
    folder: CampaignFolder,
    results: CampaignResults,
    claims: Sequence[Claim],
    tables: Sequence[ComparisonTable] | None,
    figures: Path,
    file: Path | None,
    faults: ToleratedFaults,
) -> None:
    """Write the page; a paper's figures are drawn into a folder, and its tables are made unless they are given."""
    experiment_type = EXPERIMENTS.get(str(results.metadata.get("experiment", "")))
    experiment = None if experiment_type is None else experiment_type()
    sections: list[Section | None] = [_claims_section(claims)]
    if experiment is not None and results.points:
        with faults.tolerated("what the paper has published could not be shown"):
            sections += _published(experiment, tables, results, folder.runs, figures)
    layout = layout_of(results) if results.points else None
    if layout is not None and layout.fits_a_page:
        sections += [success_section(results, layout), spread_section(results, layout)]
    sections += [
        points_section(results, layout),
        pairs_section(results),
        failures_section(results, folder.path),
        runs_section(results, folder.path),
        _setting_section(results),
    ]
    title = results.scenario if experiment is None else f"{experiment.name}: {experiment.title}"
    write_page(file or folder.report, title, campaign_header(results, claims), [s for s in sections if s is not None])


def _published(
    experiment: PublishedExperiment,
    tables: Sequence[ComparisonTable] | None,
    results: CampaignResults,
    runs: Path,
    figures: Path,
) -> Sequence[Section | None]:
    """Return published values beside ours, and the figures, or a section that says why there are none."""
    try:
        tables = experiment.tables(results.table) if tables is None else tables
        drawn = draw_figures(experiment, results.table, runs, figures)
    except KeyError as e:
        html = Markup("<p>The campaign is of another version of {}, so this is left out: its runs have no {}.</p>")
        return [Section(anchor="comparison", title="Published and ours", html=html.format(experiment.name, e.args[0]))]
    return [_comparison_section(tables), _figures_section(drawn, figures)]
