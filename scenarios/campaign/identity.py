"""What makes a campaign the one that it is: a call goes on with a folder only if all of it is the same."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, cast

from handover.scenarios.campaign.plan import CampaignPlan
from handover.scenarios.results.run_folder import sha256_of, versions

_MAX_LENGTH = 60
"""Characters of a value that are told."""


def identity_of(plan: CampaignPlan, fmus: Mapping[str, Path]) -> dict[str, Any]:
    """Return what a campaign's numbers follow from, as JSON can hold it; the plan is a checked one."""
    options = {**plan.options.as_data(), "call_limit": plan.options.call_limit, "pace": plan.options.pace}
    return {
        "experiment": plan.experiment,
        "scenario": plan.scenario,
        "points": [dict(point) for point in plan.points],
        "fixed": dict(plan.fixed),
        "repetitions": plan.repetitions,
        "seed": plan.seed,
        "paired": plan.paired,
        "scenes": list(plan.scenes),
        "units": {name: {"fmu": path.name, "sha256": sha256_of(path)} for name, path in fmus.items()},
        "master": options,
        "versions": versions(),
    }


def differences(there: Mapping[str, Any], called: Mapping[str, Any]) -> list[str]:
    """Return in what the campaign of a folder and the one that is called for differ, with both values.

    More repetitions than there are make no other campaign.
    """
    entries: list[str] = []
    for key, value in called.items():
        known = there.get(key)
        if known == value or (key == "repetitions" and isinstance(known, int) and known < value):
            continue
        if key == "repetitions" and isinstance(known, int):
            entries.append(f"{_both(key, known, value)} (a larger number adds runs, a smaller one takes none away)")
        elif key == "points":
            entries += _of_points(known, value)
        elif isinstance(value, dict) and isinstance(known, dict):
            entries += _of_entries(key, cast(dict[str, Any], known), cast(dict[str, Any], value))
        else:
            entries.append(_both(key, known, value))
    return entries


def _of_entries(key: str, there: Mapping[str, Any], called: Mapping[str, Any]) -> list[str]:
    names = [*called, *(name for name in there if name not in called)]
    kind = {"units": "unit ", "fixed": "", "master": "master's ", "versions": "version of "}.get(key, "")
    differ = [name for name in names if there.get(name) != called.get(name)]
    return [_both(f"{kind}{name}", there.get(name), called.get(name)) for name in differ]


def _of_points(there: Any, called: Sequence[Mapping[str, str]]) -> list[str]:
    try:
        before, asked = _values(there), _values(called)
    except (TypeError, AttributeError):
        return ["its points cannot be read"]
    names = [*asked, *(name for name in before if name not in asked)]
    differ = [_both(name, before.get(name), asked.get(name)) for name in names if before.get(name) != asked.get(name)]
    return differ or [f"the values are combined to {len(there)} points there, to others, {len(called)}, in this call"]


def _values(points: Sequence[Mapping[str, str]]) -> dict[str, list[str]]:
    """Return the values that each parameter takes."""
    values: dict[str, dict[str, None]] = {}
    for point in points:
        for name, value in point.items():
            values.setdefault(name, {})[value] = None
    return {name: list(taken) for name, taken in values.items()}


def _both(what: str, there: Any, called: Any) -> str:
    return f"{what} is {_text(there)} there, {_text(called)} in this call"


def _text(value: Any) -> str:
    if value is None or value == "" or value == []:
        return "not given"
    if isinstance(value, dict) and "sha256" in value:
        fmu = cast(dict[str, str], value)
        return f"{fmu['fmu']} (sha256 {fmu['sha256'][:12]})"
    entries = ",".join(map(str, cast(list[Any], value))) if isinstance(value, list) else str(cast(Any, value))
    return entries if len(entries) <= _MAX_LENGTH else entries[: _MAX_LENGTH - 3] + "..."
