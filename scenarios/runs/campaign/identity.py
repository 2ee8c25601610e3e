"""The identity of a campaign: a command resumes a folder only if all of it is the same."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, cast

from handover.cosim.blocks.variable import Kind
from handover.scenarios.runs.campaign.plan import CampaignPlan
from handover.scenarios.runs.execution.unit_values import split_parameters
from handover.scenarios.runs.results.run_folder import sha256_of, versions

_KINDS = {
    "units": "unit ",
    "master": "master's ",
    "versions": "version of ",
    "source": "scenario's ",
    "parameter_files": "content of ",
}
_MAX_LENGTH = 60
"""Characters of a value that a message shows."""


def identity_of(plan: CampaignPlan, fmus: Mapping[str, Path]) -> dict[str, Any]:
    """Return all that a campaign's numbers depend on, as JSON data; the plan is a checked one."""
    source = plan.source
    options = {**plan.options.as_data(), "call_limit": plan.options.call_limit, "pace": plan.options.pace}
    files = _parameter_files(plan)
    return {
        "experiment": plan.experiment,
        "scenario": plan.scenario if plan.file is None else plan.file.name,
        **({} if source is None else {"source": asdict(source)}),
        "points": [dict(point) for point in plan.points],
        "fixed": dict(plan.fixed),
        "repetitions": plan.repetitions,
        "seed": plan.seed,
        "paired": plan.paired,
        "start": None if plan.start is None else str(plan.start),
        "stop": None if plan.stop is None else str(plan.stop),
        "step": None if plan.step is None else str(plan.step),
        "recorded": list(plan.recorded) or None,
        "scenes": list(plan.scenes),
        **({"varied_units": list(plan.varied_units)} if plan.varied_units else {}),
        "units": {name: {"fmu": path.name, "sha256": sha256_of(path)} for name, path in fmus.items()},
        **({"parameter_files": files} if files else {}),
        "master": options,
        "versions": versions(),
    }


def _parameter_files(plan: CampaignPlan) -> dict[str, dict[str, str]]:
    """Return names and hashes of all files that runs read besides FMUs, by their paths as they are given."""
    experiment = plan.kind()
    # Names of files are texts, of which even many points have few: all others need not be parsed.
    of_text = {v.name for v in experiment.parameters() if v.kind is Kind.STRING} | {*experiment.unit_files}
    given = ({**plan.fixed, **point} for point in plan.points)
    texts = {tuple(f"{n}={text}" for n, text in values.items() if n in of_text) for values in given}
    files: set[Path] = set() if plan.inputs is None else {plan.inputs}
    for values in texts - {()}:
        files.update(experiment.files_read(*split_parameters(type(experiment), values)).values())
    there = [file for file in sorted(files) if file.is_file()]
    return {str(file): {"file": file.name, "sha256": sha256_of(file)} for file in there}


def differences(stored: Mapping[str, Any], requested: Mapping[str, Any]) -> list[str]:
    """Return in what the campaign of a folder and that of the command differ, with both values.

    A larger number of repetitions is not a difference: it adds runs to the same campaign.
    """
    different: list[str] = []
    for key, value in requested.items():
        known = stored.get(key)
        if known == value or (key == "repetitions" and isinstance(known, int) and known < value):
            continue
        if key == "repetitions" and isinstance(known, int):
            different.append(f"{_both(key, known, value)} (a larger number adds runs, a smaller one takes none away)")
        elif key == "points":
            different += _of_points(known, value)
        elif isinstance(value, dict) and isinstance(known, dict):
            different += _of_entries(key, cast(dict[str, Any], known), cast(dict[str, Any], value))
        else:
            different.append(_both(key, known, value))
    return different


def _of_entries(key: str, stored: Mapping[str, Any], requested: Mapping[str, Any]) -> list[str]:
    names = [*requested, *(name for name in stored if name not in requested)]
    kind = _KINDS.get(key, "")
    differ = [name for name in names if stored.get(name) != requested.get(name)]
    return [_both(f"{kind}{name}", stored.get(name), requested.get(name)) for name in differ]


def _of_points(stored: Any, requested: Sequence[Mapping[str, str]]) -> list[str]:
    try:
        before, asked = _values(stored), _values(requested)
    except (TypeError, AttributeError):
        return ["its points cannot be read"]
    names = [*asked, *(name for name in before if name not in asked)]
    differ = [_both(name, before.get(name), asked.get(name)) for name in names if before.get(name) != asked.get(name)]
    return differ or [
        f"the values are combined to {len(stored)} points there, to others, {len(requested)}, in this command"
    ]


def _values(points: Sequence[Mapping[str, str]]) -> dict[str, list[str]]:
    """Return the values that each parameter takes."""
    values: dict[str, dict[str, None]] = {}
    for point in points:
        for name, value in point.items():
            values.setdefault(name, {})[value] = None
    return {name: list(taken) for name, taken in values.items()}


def _both(what: str, stored: Any, requested: Any) -> str:
    return f"{what} is {_text(stored)} there, {_text(requested)} in this command"


def _text(value: Any) -> str:
    if value is None or value == "" or value == []:
        return "not given"
    if isinstance(value, dict) and "sha256" in value:
        file = cast(dict[str, str], value)
        return f"{file.get('fmu') or file.get('file')} (sha256 {file['sha256'][:12]})"
    text = ",".join(map(str, cast(list[Any], value))) if isinstance(value, list) else str(cast(Any, value))
    return text if len(text) <= _MAX_LENGTH else text[: _MAX_LENGTH - 3] + "..."
