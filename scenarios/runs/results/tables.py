"""Rows and texts of a run's tables: how units were coupled, unit conversions, values of parameters, metrics.

The command line and the report page show the same rows.
"""

from collections.abc import Collection, Mapping
from dataclasses import fields
from typing import Any, cast

from handover.cosim.exceptions import counted
from handover.cosim.master.pacing import PaceReport
from handover.cosim.stepping.options import Algorithm
from handover.cosim.system.conversion import LinearTransformation
from handover.cosim.system.system import System
from handover.scenarios.experiment.display_unit import display_unit
from handover.scenarios.runs.results.output_faults import not_finite_lines, out_of_range_lines


def master_rows(summary: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return name and value of the master's options and statistics, from what is in `summary.json`."""
    master, metrics = summary["master"], summary["metrics"]
    rows = [("algorithm", master["algorithm"]), ("extrapolation", master["extrapolation"])]
    if "iterations" in metrics or Algorithm(master["algorithm"]).iterates:
        rows.append(("tolerance of iterations", f"{master['tolerance']:g}, after at most {master['iterations']}"))
    mean, rollbacks = (metrics.get(name, {}).get("value") for name in ("iterations", "rollbacks"))
    if mean is not None and rollbacks is not None:
        rows.append(("iterations", f"{mean:.3g} a step, {rollbacks:.0f} rollbacks"))
    control = master["adaptive"]
    if control:
        tolerated = f"{control['relative']:g}, and {control['absolute']:g} of nominal values"
        rows.append(("tolerated step error", tolerated))
    if summary.get("steps"):
        rows.append(("steps", _steps(summary["steps"])))
    if master["repeat_discarded"]:
        rows.append(("steps that a unit discards", "repeated shorter by all"))
    return rows + pace_rows(summary)


def pace_rows(summary: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return name and value of how a run kept pace with real time; no rows if it was not paced."""
    if not summary.get("pace"):
        return []
    known = {f.name for f in fields(PaceReport)}
    report = PaceReport(**{k: v for k, v in summary["pace"].items() if k in known})
    if report.changed:
        rows = [("pace", f"changed on the way, {_pace(report.first)} at first, {_pace(report.pace)} at last")]
        return [*rows, ("deadlines missed at the last pace", str(report))] if report.deadlines else rows
    reached = "" if report.reached is None else f" asked for, {report.reached:.3g} x reached"
    return [("pace", f"{_pace(report.pace)}{reached}"), ("deadlines missed", str(report))]


def _pace(pace: float | None) -> str:
    return "as fast as it goes" if pace is None else f"{pace:g} x real time"


def warning_lines(summary: Mapping[str, Any]) -> list[str]:
    """Return what a run warned of, a line each, from what is in `summary.json`.

    These are the units of which calls answered Warning, then outputs that were not finite, or beyond their ranges.
    """
    warned = [_warning_line(warned) for warned in summary.get("warnings", [])]
    return [
        *warned,
        *not_finite_lines(summary.get("not_finite", [])),
        *out_of_range_lines(summary.get("out_of_range", [])),
    ]


def _warning_line(warned: Mapping[str, Any]) -> str:
    calls: Mapping[str, int] = warned["calls"]
    n, t = sum(calls.values()), f"t = {warned['time']:.6g} s"
    times = f"once, at {t}" if n == 1 else f"{n} times, first at {t}"
    if len(calls) > 1:
        times += f" ({', '.join(f'{call} {count}' for call, count in calls.items())})"
    which = f" from {next(iter(calls))}" if len(calls) == 1 else ""
    said = f"; last message: {warned['message']}" if warned["message"] else ""
    return f"unit {warned['instance']} returned Warning{which} {times}{said}"


def _steps(steps: Mapping[str, Any]) -> str:
    text = f"{steps['accepted']} accepted, {steps['rejected']} rejected"
    if not steps["accepted"]:
        return text
    return f"{text}, {steps['shortest'] * 1000:.3g} to {steps['longest'] * 1000:.3g} ms"


def conversions_of(system: System) -> list[dict[str, Any]]:
    """Return the connections that convert units, as JSON can hold them: both ends with their units, factor, offset."""
    entries: list[dict[str, Any]] = []
    for c in system.connections:
        conversion = system.transformation_of(c)
        if conversion is not None:
            source = system.units[c.source.unit].description.outputs[c.source.port]
            target = system.units[c.target.unit].description.inputs[c.target.port]
            ends = {"source": str(c.source), "unit": str(source.unit)}
            ends |= {"target": str(c.target), "target_unit": str(target.unit)}
            entries.append({**ends, "factor": conversion.factor, "offset": conversion.offset})
    return entries


def format_conversion(conversion: Mapping[str, Any]) -> tuple[str, str]:
    """Return both ends of a conversion with their units, and its formula."""
    source = _with_unit(conversion["source"], conversion["unit"])
    target = _with_unit(conversion["target"], conversion["target_unit"])
    return f"{source} -> {target}", str(LinearTransformation(conversion["factor"], conversion["offset"]))


def _with_unit(port: str, unit: str) -> str:
    return f"{port} ({unit})" if unit else port


LAST = "last_"
"""What the names of a file's metrics begin with that are the last value of an output."""


def headline_rows(metrics: Mapping[str, Any], headline: Collection[str]) -> list[tuple[str, str]]:
    """Return description and value of the metrics shown first; where these are last values, how many more there are."""
    rows = [(metrics[n].get("description") or n, format_metric(metrics[n])) for n in headline if n in metrics]
    if all(n.startswith(LAST) for n in headline):
        more = sum(n.startswith(LAST) and n not in headline for n in metrics)
        rows += [(f"and {counted(more, 'last value')} more", "in summary.json")] if more else []
    return rows


def format_value(value: Any) -> str:
    """Return a value of a parameter or an option as it is typed: numbers to six digits, true or false, or a text."""
    if isinstance(value, float):
        return f"{value:g}"
    return str(value).lower() if isinstance(value, bool) else str(value)


def options_in_words(options: Mapping[str, Any]) -> dict[str, Any]:
    """Return values of options by their names in words; one within another by both names."""
    flat: dict[str, Any] = {}
    for name, value in options.items():
        words = name.replace("_", " ")
        if isinstance(value, Mapping):
            flat |= {f"{words} {n}": v for n, v in options_in_words(cast(Mapping[str, Any], value)).items()}
        else:
            flat[words] = value
    return flat


def format_metric(metric: Mapping[str, Any]) -> str:
    """Return a metric of `summary.json` with its value in a display unit; a dash where it was not finite."""
    value, unit = float("nan") if metric["value"] is None else metric["value"], metric["unit"]
    return display_unit(unit, value).text(value)
