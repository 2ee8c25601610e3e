"""The page of a campaign, made of what is in its folder."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup

from cosim.exceptions import one_line
from scenarios.campaign.campaign_results import CampaignResults
from scenarios.campaign.campaign_table import CampaignTable
from scenarios.campaign.point_layout import layout_of
from scenarios.campaign.shown_unit import shown_unit
from scenarios.catalog import SCENARIOS
from scenarios.published.catalog import EXPERIMENTS
from scenarios.published.claim import Claim
from scenarios.reporting.claims_section import claims_section, comparison_section, verdict_html
from scenarios.reporting.failures_section import failures_section
from scenarios.reporting.page import write_page
from scenarios.reporting.pairs_section import pairs_section
from scenarios.reporting.points_section import points_section
from scenarios.reporting.runs_section import runs_section
from scenarios.reporting.section import Section
from scenarios.reporting.setting_section import setting_section
from scenarios.reporting.spread_section import spread_section
from scenarios.reporting.success_section import success_section
from scenarios.run_folder import BadRunFolder


def write_campaign_page(folder: Path) -> None:
    """Write `report.html` of a campaign, or of a paper's, into its folder; the campaign need not be complete.

    Raises:
        BadRunFolder: there is no campaign, or it is damaged.
        RecordNotWritten: the page cannot be written.
    """
    results = CampaignResults(_read(folder / "campaign.json"), CampaignTable.read(folder))
    claims = _claims(folder)
    experiment = EXPERIMENTS.get(str(results.told.get("experiment", "")))
    sections: list[Section | None] = [claims_section(claims)]
    if experiment is not None and len(results.table):
        sections.append(comparison_section(experiment().tables(results.table)))
    if results.points:
        layout = layout_of(results)
        sections += [success_section(results, layout), spread_section(results, layout)]
    sections += [
        points_section(results),
        pairs_section(results),
        failures_section(results, folder),
        runs_section(results, folder),
        setting_section(results),
    ]
    title = results.scenario if experiment is None else f"{experiment.name}: {experiment.title}"
    write_page(folder / "report.html", title, _lead(results, claims), [s for s in sections if s is not None])


def _read(file: Path) -> dict[str, Any]:
    try:
        content = json.loads(file.read_bytes())
    except OSError as e:
        raise BadRunFolder(file.parent, f"it is not the folder of a campaign: it has no {file.name}") from e
    except ValueError as e:
        raise BadRunFolder(file.parent, f"its {file.name} is damaged: {one_line(e)}") from e
    return content


def _claims(folder: Path) -> list[Claim]:
    file = folder / "claims.json"
    if not file.exists():
        return []
    try:
        return [Claim.from_data(entry) for entry in json.loads(file.read_bytes())]
    except (KeyError, TypeError, ValueError) as e:
        raise BadRunFolder(folder, f"its {file.name} is damaged: {one_line(e)}") from e


def _lead(results: CampaignResults, claims: list[Claim]) -> Markup:
    """Return what was run, and how it went."""
    scenario = SCENARIOS.get(results.scenario)
    lines = [
        Markup("<p class='soft'>{}</p>").format("" if scenario is None else f"{results.scenario}: {scenario.title}"),
        _verdict(results),
    ]
    if claims:
        counts = {c.verdict: sum(other.verdict is c.verdict for other in claims) for c in claims}
        told = Markup(", ").join(Markup("{} {}").format(n, verdict_html(v)) for v, n in counts.items())
        lines.append(Markup("<p>{}: {}.</p>").format("Claim" if len(claims) == 1 else "Claims", told))
    lines.append(Markup("<p class='soft'>{}</p>").format(_plan_told(results)))
    return Markup("\n").join(lines)


def _verdict(results: CampaignResults) -> Markup:
    table, ended, planned = results.table, len(results.table), results.planned
    status = table.column("status")
    done, failed, lost = (int(np.count_nonzero(status == s)) for s in ("done", "failed", "lost"))
    succeeded = sum(p.successes for p in results.points)
    told = [f"{succeeded} of {done} runs done succeeded"]
    told += [f"{failed} failed to run"] if failed else []
    told += [f"{lost} {'was' if lost == 1 else 'were'} lost"] if lost else []
    sentence = "; ".join(told) + "."
    if ended < planned:
        begun = Markup("<b>{} of {} runs so far</b>; the same call goes on.").format(ended, planned)
        return Markup("<p class='verdict'>{} {}</p>").format(begun, sentence)
    kind = " bad" if failed or lost else ""
    return Markup("<p class='verdict{}'><b>{} {}</b>: {}</p>").format(
        kind, planned, "run" if planned == 1 else "runs", sentence
    )


def _plan_told(results: CampaignResults) -> str:
    """Return what was varied, how often each point was run, and what it took."""
    told: Mapping[str, Any] = results.told
    table = results.table
    varied = [f"{name.replace('_', ' ')} ({_values_told(results, name)})" for name in results.varied]
    points, repetitions = len(told["points"]), int(told["repetitions"])
    parts = [f"Varied: {'; '.join(varied)}" if varied else "Nothing is varied"]
    runs = f"{points} points" if points != 1 else "one point"
    parts.append(f"{runs}, {repetitions} {'run' if repetitions == 1 else 'runs'} each; campaign's seed {told['seed']}")
    if told.get("paired"):
        parts.append("The points of a repetition share a seed")
    for name, words in (("cpu_seconds", "CPU time"), ("wall_seconds", "wall time, if run one after another")):
        total = float(np.nansum(table.column(name).astype(np.float64))) if len(table) else 0.0
        parts.append(f"Runs' {words}: {shown_unit('s', total).text(total)}")
    return ". ".join(parts) + "."


def _values_told(results: CampaignResults, name: str) -> str:
    texts = list(dict.fromkeys(values[name] for values in results.told["points"] if name in values))
    if results.is_number(name):
        unit = shown_unit(results.unit(name), [float(t) for t in texts])
        shown = [f"{float(t) * unit.factor:.4g}" for t in texts]
        symbol = f" {unit.symbol}" if unit.symbol else ""
    else:
        shown, symbol = [t.replace("_", " ") for t in texts], ""
    if len(shown) > 10:
        shown = [*shown[:4], "…", shown[-1]]
    return ", ".join(shown) + symbol
