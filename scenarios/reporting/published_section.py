"""A run's figures beside what its paper tells of them."""

from collections.abc import Mapping, Sequence
from typing import Any

from markupsafe import Markup

from handover.scenarios.catalog import SCENARIOS
from handover.scenarios.experiment.paper import PublishedValue
from handover.scenarios.experiment.parameters import BadParameter, parameters_of
from handover.scenarios.reporting.rows_table import rows_table
from handover.scenarios.reporting.section import Section
from handover.scenarios.reporting.told_metric import told


def published_section(summary: Mapping[str, Any], run: Mapping[str, Any]) -> Section | None:
    """Return the run's figures that the paper has too, for parameters near the published ones; None if there are none.

    Args:
        summary: what is in `summary.json`.
        run: what is in `run.json`.
    """
    values = [v for v in _values(run) if v.metric in summary["metrics"]]
    if not values:
        return None
    rows = [_row(v, summary["metrics"][v.metric]) for v in values]
    note = "One run is no trial of what was published: it does not tell how its figures vary."
    html = rows_table(("figure", "this run", "published", "where"), rows, numbers=(1, 2), cards=True)
    return Section(
        anchor="published", title="Published values", html=html + Markup("<p class='soft'>{}</p>").format(note)
    )


def _values(run: Mapping[str, Any]) -> Sequence[PublishedValue]:
    experiment = SCENARIOS.get(run["scenario"])
    if experiment is None:
        return ()
    try:
        return experiment().published(parameters_of(experiment, run["parameters"]))
    except BadParameter:  # of another version: the page tells it where it leaves plots out
        return ()


def _row(value: PublishedValue, metric: Mapping[str, Any]) -> tuple[str | Markup, ...]:
    unit = {"unit": metric["unit"]}
    shown = f"{value.relation} {told({**unit, 'value': value.value})}".lstrip()
    if value.limits is not None:
        shown += " ({} to {})".format(*(told({**unit, "value": x}) for x in value.limits))
    status = "" if value.status == "stated" else f" ({value.status})"
    where = Markup("{}{}").format(value.where, status)
    if value.note:
        where += Markup("<br><span class='soft'>{}</span>").format(value.note)
    return metric["description"] or value.metric, told(metric), shown, where
