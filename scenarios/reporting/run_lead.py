"""What stands under the heading of a run's page: what ran, and how it ended."""

from markupsafe import Markup

from handover.scenarios.reporting.page import template
from handover.scenarios.reporting.run_facts import RunFacts

_VERSIONS = {"handover-cosim": "handover-cosim", "python": "Python"}


def run_lead(facts: RunFacts) -> Markup:
    """Return the verdict, what ran with which seed and versions, and what was told of a failure."""
    summary, versions = facts.summary, facts.run.get("versions", {})
    told = [facts.title] if facts.title else []
    if facts.run.get("seed") is not None:
        told.append(f"seed {facts.run['seed']}")
    told.append(_how_long(facts))
    told += [f"{name} {versions[key]}" for key, name in _VERSIONS.items() if key in versions]
    return Markup(
        template("run_lead.html").render(
            told=[t for t in told if t],
            verdict=_verdict(facts),
            good=summary["success"],
            reason=summary["reason"],
            to_go_on=facts.folder.checkpoint.exists(),
            failure={"log": (), "instance": None, **(summary.get("failure") or {})},
        )
    )


def _verdict(facts: RunFacts) -> str:
    if facts.summary["success"]:
        return "Succeeded"
    if not facts.ended:
        return "Not ended"
    return "Interrupted" if facts.summary["reason"].startswith("interrupted") else "Failed"


def _how_long(facts: RunFacts) -> str:
    simulated, wall = (facts.summary.get(f"{name}_seconds") for name in ("simulated", "wall"))
    if simulated is None:
        return ""
    return f"{simulated:.1f} s simulated" + ("" if wall is None else f" in {wall:.1f} s")
