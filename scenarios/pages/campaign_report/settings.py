"""The settings of a campaign, as fixed parameters, options of the master, versions and FMUs; and its figures."""

import base64
from collections.abc import Mapping, Sequence
from pathlib import Path

from markupsafe import Markup

from handover.scenarios.experiment.display_unit import display_unit
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.runs.campaign.results import CampaignResults
from handover.scenarios.runs.execution.request import is_file
from handover.scenarios.runs.reporting.html import rows_table
from handover.scenarios.runs.reporting.page import Section
from handover.scenarios.runs.results.tables import format_value, options_in_words


def setting_section(results: CampaignResults) -> Section:
    """Return tables of what is set for all runs; other parameters have the scenario's defaults."""
    metadata = results.metadata
    options = options_in_words(metadata.get("master", {}))
    parts = [
        _part("Fixed parameters", {n: _value(results, n, v) for n, v in metadata["fixed"].items()}),
        _part("Master", {n: format_value(v) for n, v in options.items() if v is not None}),
        _part("Versions", {n: str(v) for n, v in metadata.get("versions", {}).items()}),
        _fmus(metadata.get("units", {})),
    ]
    others = "Parameters that are neither varied nor fixed have"
    defaults = f"{others} the scenario's defaults; each run's run.json has all."
    if is_file(results.scenario):
        defaults = f"{others} the values that the file gives."
    html = Markup("<div class='columns'>{}</div><p class='soft'>{}</p>").format(Markup().join(parts), defaults)
    return Section(anchor="setting", title="Setting", html=html)


def _part(title: str, rows: Mapping[str, str]) -> Markup:
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


def _value(results: CampaignResults, name: str, text: str) -> str:
    if results.is_number(name):
        return display_unit(results.unit(name), float(text)).text(float(text))
    unit = results.unit(name)
    return text if unit == "1" else f"{text} {unit}"


def figures_section(figures: Sequence[Figure], folder: Path) -> Section | None:
    """Return figures with their captions, None if there are none; `folder` has them as PNG."""
    if not figures:
        return None
    html = Markup("\n").join(_html(f, folder / f"{f.name}.png") for f in figures)
    return Section(anchor="figures", title="Figures", html=html)


def _html(figure: Figure, file: Path) -> Markup:
    data = base64.b64encode(file.read_bytes()).decode()
    return Markup(
        "<figure><div class='scroll'><img class='paper' alt='{}' src='data:image/png;base64,{}'></div>"
        "<figcaption>{}</figcaption></figure>"
    ).format(figure.name.replace("_", " "), data, figure.caption)
