"""Reads what is compared, campaigns or runs, and finds what makes them incomparable and in what they differ.

Nothing is written to their folders. All faults are found at once (`NotComparable`).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from pathlib import Path
from typing import Any, cast

from handover.cosim.record.reader import Record
from handover.scenarios.experiment.parameters import InvalidParameter, parse_parameters, text_of
from handover.scenarios.runs.campaign.folder import OF_NEITHER, CampaignFolder
from handover.scenarios.runs.campaign.results import CampaignResults, read_results
from handover.scenarios.runs.execution.request import is_file
from handover.scenarios.runs.results.run_facts import RunFacts, record_of
from handover.scenarios.runs.results.run_folder import InvalidRunFolder, RunFolder
from handover.scenarios.runs.results.tables import format_value, options_in_words

MAX_ENTRIES = 9
"""Campaigns or runs on one page: as many as there are colours."""


class NotComparable(ValueError):
    """Folders that cannot be compared; `faults` lists all reasons, a line each."""

    def __init__(self, faults: Sequence[str]) -> None:
        super().__init__("\n".join(faults))
        self.faults = tuple(faults)


@dataclass(frozen=True)
class CampaignEntry:
    """A campaign that is compared: the name that it has in the comparison, its folder, and its results."""

    name: str
    folder: Path
    results: CampaignResults

    @property
    def scenario(self) -> str:
        """Name of the scenario."""
        return self.results.scenario

    @property
    def metadata(self) -> Mapping[str, Any]:
        """Content of `campaign.json`."""
        return self.results.metadata

    @cached_property
    def parameters(self) -> Mapping[str, str]:
        """The texts of the parameters that its points share, varied or not, those at their defaults included."""
        points: Sequence[Mapping[str, str]] = self.results.metadata["points"]
        fixed: Mapping[str, str] = self.results.metadata["fixed"]
        shared = {n: text for n, text in points[0].items() if all(point.get(n) == text for point in points)}
        return full_parameters(self.results, {**fixed, **shared})


@dataclass(frozen=True)
class RunEntry:
    """A run that is compared: the name that it has in the comparison, its folder, what it says, and its record."""

    name: str
    folder: Path
    facts: RunFacts
    record: Record | None

    @property
    def scenario(self) -> str:
        """Name of the scenario."""
        return self.facts.scenario

    @property
    def metadata(self) -> Mapping[str, Any]:
        """Content of `run.json`."""
        return self.facts.run

    @cached_property
    def parameters(self) -> Mapping[str, str]:
        """The texts of its parameters, with units where the run's folder tells them; --stop is among the times."""
        given_stop = self.metadata.get("stop") is not None
        return {name: text for name, text, _ in self.facts.parameters if not (given_stop and name == "stop")}


Entry = CampaignEntry | RunEntry


def full_parameters(results: CampaignResults, given: Mapping[str, str]) -> dict[str, str]:
    """Return the texts of a scenario's parameters, those that are not given at their defaults.

    Texts that this version of the scenario does not take stay as they are. Of a scenario that is not to be had here
    defaults are those that the campaign's folder has.
    """
    experiment = results.experiment
    if experiment is None:
        return {**results.metadata.get("defaults", {}), **given}
    declared = experiment.parameters()
    known = {v.name for v in declared}
    try:
        parameters = parse_parameters(experiment, [f"{n}={text}" for n, text in given.items() if n in known])
    except InvalidParameter:
        return dict(given)
    return {**{v.name: text_of(v, getattr(parameters, v.name)) for v in declared}, **given}


def read_entries(
    folders: Sequence[Path], names: Sequence[str] = ()
) -> tuple[Sequence[CampaignEntry], Sequence[RunEntry]]:
    """Read campaigns or runs, one of the two sequences being empty.

    Args:
        folders: of campaigns, or of runs.
        names: of the entries, in the order of the folders; by default those of the folders.

    Raises:
        NotComparable: a folder is neither, or damaged; they are too few or too many, of both kinds, or of different
            scenarios, where files count as versions of one; or a name is given twice.
    """
    faults = [*_faults_of_folders(folders), *_faults_of_names(folders, names)]
    campaigns: list[CampaignEntry] = []
    runs: list[RunEntry] = []
    for name, folder in zip(names if len(names) == len(folders) else _names_of(folders), folders, strict=True):
        try:
            if CampaignFolder(folder).is_there:
                campaigns.append(CampaignEntry(name, folder, read_results(CampaignFolder(folder))))
            elif RunFolder.of_run(folder).is_there:
                run = RunFolder.of_run(folder)
                runs.append(RunEntry(name, folder, RunFacts.read(run), record_of(run)))
            else:
                what = OF_NEITHER if folder.is_dir() else "is not a folder"
                faults.append(f"{folder} {what}; name folders of runs, or of campaigns")
        except InvalidRunFolder as e:
            faults.append(f"{folder}: {e.fault}")
    faults += _faults_of_kinds(campaigns, runs)
    if faults:
        raise NotComparable(faults)
    return campaigns, runs


def _faults_of_folders(folders: Sequence[Path]) -> list[str]:
    faults: list[str] = []
    if len(folders) < 2:
        faults.append("there is nothing to compare it with; name at least two folders, of campaigns or of runs")
    if len(folders) > MAX_ENTRIES:
        faults.append(f"{len(folders)} folders; at most {MAX_ENTRIES} can be told apart on a page")
    absolute = [folder.resolve() for folder in folders]
    twice = [f for k, f in enumerate(folders) if absolute[k] in absolute[:k]]
    return faults + [f"{folder} is named twice; a comparison with itself says nothing" for folder in twice]


def _faults_of_names(folders: Sequence[Path], names: Sequence[str]) -> list[str]:
    faults: list[str] = []
    if names and len(names) != len(folders):
        given = "--name is given once" if len(names) == 1 else f"--name is given {len(names)} times"
        faults.append(f"{given}, for {len(folders)} folders; each takes one, in their order")
    faults += [f"name {name!r} is given twice" for name in dict.fromkeys(n for n in names if names.count(n) > 1)]
    return faults + ["a name is empty" for name in names if not name.strip()]


def _names_of(folders: Sequence[Path]) -> list[str]:
    """Return the folders' own names, with as many of the folders above them as tell them apart."""
    paths = [folder.resolve().parts for folder in folders]
    for depth in range(1, max(map(len, paths)) + 1):
        names = ["/".join(parts[-depth:]) for parts in paths]
        if len(set(names)) == len(names):
            return names
    return [str(folder) for folder in folders]


def _faults_of_kinds(campaigns: Sequence[CampaignEntry], runs: Sequence[RunEntry]) -> list[str]:
    if campaigns and runs:
        a, b = campaigns[0].folder, runs[0].folder
        return [f"{a} is a campaign, {b} a run: compare campaigns with campaigns, or runs with runs, as {a}/runs/..."]
    entries: Sequence[Entry] = campaigns or runs
    kinds = ["" if is_file(e.scenario) else e.scenario for e in entries]
    return [
        f"{e.folder} is of another scenario, {e.scenario}, than {entries[0].folder}, {entries[0].scenario}"
        for e, kind in zip(entries, kinds, strict=True)
        if kind != kinds[0]
    ]


@dataclass(frozen=True)
class Difference:
    """A setting in which entries differ: its name, its kind, and its text in each of them, "–" where it has none."""

    name: str
    kind: str
    values: tuple[str, ...]


def differences_of(entries: Sequence[Entry], varied: Sequence[str] = ()) -> list[Difference]:
    """Return in what entries differ: parameters, times, files that were read, units, and what else numbers depend on.

    Args:
        entries: what is compared.
        varied: parameters by which points are told apart, which are left out.
    """
    found = _of_kind(entries, "parameter", lambda e: {n: t for n, t in e.parameters.items() if n not in varied})
    found += _of_kind(entries, "times", _times)
    found += _of_kind(entries, "file", _files)
    found += _of_kind(entries, "unit", lambda e: {n: _fmu(u) for n, u in _part(e, "units").items()})
    found += _of_kind(entries, "scenario", _code)
    found += _of_kind(entries, "master", _options)
    found += _of_kind(entries, "seeds", _seeds)
    return found + _of_kind(entries, "version", lambda e: {n: str(v) for n, v in _part(e, "versions").items()})


def _of_kind(entries: Sequence[Entry], kind: str, texts: Callable[[Any], Mapping[str, str]]) -> list[Difference]:
    by_entry = [texts(entry) for entry in entries]
    names = dict.fromkeys(name for known in by_entry for name in known)
    rows = [Difference(n, kind, tuple(known.get(n, "–") for known in by_entry)) for n in names]
    return [row for row in rows if len(set(row.values)) > 1]


def _part(entry: Entry, name: str) -> Mapping[str, Any]:
    part: Any = entry.metadata.get(name)
    return cast(Mapping[str, Any], part) if isinstance(part, dict) else {}


def _fmu(unit: Any) -> str:
    if not isinstance(unit, dict):
        return str(unit)
    known = cast(Mapping[str, Any], unit)
    return _with_digest(known.get("fmu", ""), known.get("sha256", ""))


def _with_digest(name: object, sha256: object) -> str:
    return f"{name} ({str(sha256)[:12]})"


def _times(entry: Entry) -> dict[str, str]:
    """Return start, stop and step: of a campaign those that were asked for, of a run those that it had."""
    asked = {name: entry.metadata.get(name) for name in ("start", "stop", "step")}
    given: dict[str, Any] = {**asked, **_part(entry, "source"), **_part(entry, "experiment")}
    names = {"start": "start", "stop": "stop time", "step": "communication step"}
    known = {words: given.get(name) for name, words in names.items()}
    return {words: f"{float(Fraction(time)):g} s" for words, time in known.items() if time is not None}


def _files(entry: Entry) -> dict[str, str]:
    if isinstance(entry, CampaignEntry):
        files = _part(entry, "parameter_files")
        return {name: _with_digest(file["file"], file["sha256"]) for name, file in files.items()}
    source = _part(entry, "source")
    if "input" not in source:
        return {}
    return {"inputs": _with_digest(Path(source["input"]).name, source.get("input_sha256", ""))}


def _code(entry: Entry) -> dict[str, str]:
    source = _part(entry, "source")
    digest = str(source.get("sha256", "")) if "scenario" in source else ""  # a file is among the units
    return {"code of the scenario": digest[:12]} if digest else {}


def _seeds(entry: Entry) -> dict[str, str]:
    content = entry.metadata
    if isinstance(entry, RunEntry):
        return {"seed": str(content.get("seed"))}
    names = {"seed": "campaign's seed", "repetitions": "runs of each point", "paired": "points share seeds"}
    return {words: format_value(content.get(name)) for name, words in names.items()}


def _options(entry: Entry) -> dict[str, str]:
    options = options_in_words(_part(entry, "master"))
    return {name: "none" if value is None else format_value(value) for name, value in options.items()}
