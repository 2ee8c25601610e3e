"""The tables of a run's page: figures of merit, parameters, the master, files."""

from collections.abc import Mapping, Sequence
from typing import Any

from markupsafe import Markup

from handover.scenarios.conversions import told_conversion
from handover.scenarios.master_rows import master_rows
from handover.scenarios.reporting.page import template
from handover.scenarios.reporting.run_facts import RunFacts
from handover.scenarios.reporting.section import Section
from handover.scenarios.reporting.told_metric import told
from handover.scenarios.run_folder import BadRunFolder

_IN_TABLES = ("cpu_", "pace_", "iterations", "rollbacks")
"""Metrics that have a place in other tables."""

_FILES = {
    "summary.json": "verdict and figures of the run",
    "signals.parquet": "all signals over time, with units",
    "run.json": "configuration, versions and hashes",
    "checkpoint.zip": "where it can go on",
    "figures": "figures as PNG and SVG",
    "pictures": "pictures of the cameras",
}


def metrics_section(facts: RunFacts) -> Section | None:
    """Return the figures of merit, those of the headline first."""
    metrics: Mapping[str, Any] = facts.summary["metrics"]
    first = [n for n in facts.headline if n in metrics]
    others = [n for n in metrics if n not in first and not n.startswith(_IN_TABLES)]
    rows = [(metrics[n].get("description") or n, told(metrics[n]), n) for n in first + others]
    return _table("figures", "Figures of the run", rows, first=len(first))


def parameters_section(facts: RunFacts) -> Section | None:
    """Return the parameters, with what they are where the run tells it."""
    return _table("parameters", "Parameters", [(description, value, n) for n, value, description in facts.parameters])


def master_section(facts: RunFacts) -> Section | None:
    """Return how the units were coupled, and which units of measure were converted.

    Raises:
        BadRunFolder: what the folder tells of it is damaged.
    """
    try:
        rows = master_rows(facts.summary) if "master" in facts.summary else []
        conversions = [told_conversion(c) for c in facts.run.get("conversions", [])]
    except (KeyError, TypeError, ValueError) as e:
        fault = f"what it tells of its master is damaged: {type(e).__name__} {e}"
        raise BadRunFolder(facts.folder.path, fault) from e
    if not rows and not conversions:
        return None
    html = template("run_master.html").render(rows=rows, conversions=conversions)
    return Section(anchor="master", title="Master", html=Markup(html))


def files_section(facts: RunFacts) -> Section:
    """Return what is in the run's folder, and the versions that it ran with."""
    path = facts.folder.path
    there = [(name, what) for name, what in _FILES.items() if _is_something(path / name)]
    versions, units = facts.run.get("versions", {}), facts.run.get("units", {})
    html = template("run_files.html").render(files=there, units=units, versions=versions)
    return Section(anchor="files", title="Files", html=Markup(html))


def _is_something(path: Any) -> bool:
    return any(path.iterdir()) if path.is_dir() else path.exists()


def _table(anchor: str, title: str, rows: Sequence[tuple[str, str, str]], first: int = 0) -> Section | None:
    if not rows:
        return None
    html = template("run_table.html").render(rows=rows, first=first)
    return Section(anchor=anchor, title=title, html=Markup(html))
