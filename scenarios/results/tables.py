"""How a run's units were coupled, and how that went, in rows that one reads.

What a system's connections change on the way, as a run's folder keeps it and its user is told.

Writes values of parameters and options as one types them.

Writes figures of merit with units that read well.
"""

from collections.abc import Mapping
from typing import Any

from handover.cosim.master.pacing import PaceReport
from handover.cosim.stepping.options import Algorithm
from handover.cosim.system.conversion import LinearTransformation
from handover.cosim.system.system import System
from handover.scenarios.experiment.display_unit import display_unit


def master_rows(summary: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return name and value of what `summary.json` says of the master."""
    master, metrics = summary["master"], summary["metrics"]
    rows = [("algorithm", master["algorithm"]), ("extrapolation", master["extrapolation"])]
    if "iterations" in metrics or Algorithm(master["algorithm"]).iterates:
        rows.append(("tolerance of iterations", f"{master['tolerance']:g}, after at most {master['iterations']}"))
    if "iterations" in metrics:
        mean, rollbacks = (metrics[name]["value"] for name in ("iterations", "rollbacks"))
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
    """Return name and value of how a run kept its pace, if it was to keep one."""
    if not summary.get("pace"):
        return []
    report = PaceReport(**{k: v for k, v in summary["pace"].items() if k != "share"})
    reached = "" if report.reached is None else f" asked for, {report.reached:.3g} x reached"
    return [("pace", f"{report.pace:g} x real time{reached}"), ("deadlines missed", str(report))]


def _steps(steps: Mapping[str, Any]) -> str:
    text = f"{steps['accepted']} accepted, {steps['rejected']} rejected"
    if not steps["accepted"]:
        return text
    return f"{text}, {steps['shortest'] * 1000:.3g} to {steps['longest'] * 1000:.3g} ms"


def conversions_of(system: System) -> list[dict[str, Any]]:
    """Return, as JSON can hold it, the connections that change values: both ends with their units, and how."""
    entries: list[dict[str, Any]] = []
    for c in system.connections:
        change = system.change_by(c)
        if change is not None:
            source = system.units[c.source.unit].description.outputs[c.source.port]
            target = system.units[c.target.unit].description.inputs[c.target.port]
            ends = {"source": str(c.source), "unit": str(source.unit)}
            ends |= {"target": str(c.target), "target_unit": str(target.unit)}
            entries.append({**ends, "factor": change.factor, "offset": change.offset})
    return entries


def format_conversion(conversion: Mapping[str, Any]) -> tuple[str, str]:
    """Return a conversion as one reads it: from where to where, and how."""
    source = _with_unit(conversion["source"], conversion["unit"])
    target = _with_unit(conversion["target"], conversion["target_unit"])
    return f"{source} -> {target}", str(LinearTransformation(conversion["factor"], conversion["offset"]))


def _with_unit(port: str, unit: str) -> str:
    return f"{port} ({unit})" if unit else port


def format_value(value: Any) -> str:
    """Return a number to six digits, true or false, and else the text of a value."""
    if isinstance(value, float):
        return f"{value:g}"
    return str(value).lower() if isinstance(value, bool) else str(value)


def format_metric(metric: Mapping[str, Any]) -> str:
    """Write a metric, as `summary.json` has it, in the unit in which pages show such a value."""
    value, unit = metric["value"], metric["unit"]
    return "undefined" if value is None else display_unit(unit, value).text(value)
