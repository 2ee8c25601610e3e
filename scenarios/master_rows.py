"""How a run's units were coupled, and how that went, in rows that one reads."""

from collections.abc import Mapping
from typing import Any

from handover.cosim.master.pacing import PaceReport
from handover.cosim.stepping.options import Algorithm


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
    told = f"{steps['accepted']} accepted, {steps['rejected']} rejected"
    if not steps["accepted"]:
        return told
    return f"{told}, {steps['shortest'] * 1000:.3g} to {steps['longest'] * 1000:.3g} ms"
