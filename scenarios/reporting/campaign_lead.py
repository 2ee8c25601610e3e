"""What stands under the heading of a campaign's page: what was run, how it went, what it took."""

from collections.abc import Sequence

import numpy as np
from markupsafe import Markup

from handover.scenarios.campaign.campaign_results import CampaignResults
from handover.scenarios.catalog import SCENARIOS
from handover.scenarios.experiment.display_unit import shown_unit
from handover.scenarios.published.claim import Claim, verdict_counts
from handover.scenarios.reporting.claims_section import verdict_html

_MOST_VALUES = 10


def campaign_lead(results: CampaignResults, claims: Sequence[Claim]) -> Markup:
    """Return what was run, verdict, claims by verdict, and the plan in sentences."""
    lines = [Markup("<p class='soft'>{}</p>").format(_scenario(results)), _verdict(results)]
    for beyond, heading in ((False, "The paper's claims"), (True, "Beyond the paper")):
        counts = verdict_counts(claims, beyond)
        if counts:
            told = Markup(", ").join(Markup("{} {}").format(n, verdict_html(v, words)) for n, v, words in counts)
            lines.append(Markup("<p>{}: {}.</p>").format(heading, told))
    lines.append(Markup("<p class='soft'>{}</p>").format(f"{_plan(results)} {_cost(results)}".strip()))
    return Markup("\n").join(lines)


def _scenario(results: CampaignResults) -> str:
    """Tell of the scenario what the page's title does not: its name below a paper's, else what it does."""
    if results.told.get("experiment"):
        return f"Runs of the scenario {results.scenario}."
    scenario = SCENARIOS.get(results.scenario)
    return str(results.told.get("title", "" if scenario is None else scenario.title))


def _verdict(results: CampaignResults) -> Markup:
    ended, planned, status = len(results.table), results.planned, results.table.column("status")
    done, failed, lost = (int(np.count_nonzero(status == s)) for s in ("done", "failed", "lost"))
    succeeded = sum(p.successes for p in results.points)
    told = [f"in {succeeded} of {done} runs done the task succeeded"]
    told += [f"{failed} failed to run"] if failed else []
    told += [f"{lost} {'was' if lost == 1 else 'were'} lost"] if lost else []
    sentence = "; ".join(told) + "."
    if ended < planned:
        begun = Markup("<b>{} of {} runs so far</b>; the same call goes on.").format(ended, planned)
        return Markup("<p class='verdict'>{} {}</p>").format(begun, sentence[0].upper() + sentence[1:])
    kind = " bad" if failed or lost else ""
    number = "1 run" if planned == 1 else f"{planned} runs"
    return Markup("<p class='verdict{}'><b>{}</b>: {}</p>").format(kind, number, sentence)


def _plan(results: CampaignResults) -> str:
    """Tell what was varied and how often each point was run."""
    told = results.told
    varied = [f"{name.replace('_', ' ')} ({_values(results, name)})" for name in results.varied]
    points, repetitions = len(told["points"]), int(told["repetitions"])
    parts = [f"Varied: {'; '.join(varied)}" if varied else "Nothing is varied"]
    number = f"{points} points" if points != 1 else "One point"
    parts.append(
        f"{number}, {repetitions} {'run' if repetitions == 1 else 'runs'} each; campaign's seed {told['seed']}"
    )
    if told.get("paired"):
        parts.append("Runs of a repetition share a seed, so that points can be compared run by run")
    return ". ".join(parts) + "."


def _cost(results: CampaignResults) -> str:
    """Tell what the runs took, one added to another."""
    if not len(results.table):
        return ""
    cpu, wall = (float(np.nansum(results.table.column(n).astype(np.float64))) for n in ("cpu_seconds", "wall_seconds"))
    took = [shown_unit("s", seconds).text(seconds) for seconds in (cpu, wall)]
    return f"The runs took {took[0]} of CPU time, and {took[1]} from begin to end, added up."


def _values(results: CampaignResults, name: str) -> str:
    texts = list(dict.fromkeys(values[name] for values in results.told["points"] if name in values))
    if results.is_number(name):
        unit = shown_unit(results.unit(name), [float(t) for t in texts])
        shown = [f"{float(t) * unit.factor:.4g}" for t in texts]
        symbol = f" {unit.symbol}" if unit.symbol else ""
    else:
        shown, symbol = [t.replace("_", " ") for t in texts], ""
    if len(shown) > _MOST_VALUES:
        shown = [*shown[:4], "…", shown[-1]]
    return ", ".join(shown) + symbol
