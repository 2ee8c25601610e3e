"""The folder of a campaign: its plan, the FMUs that it uses, the folders of its runs, and their table.

`CampaignFolder.opened` makes the folder or resumes it, and keeps other commands from it; `default_folder` finds the one
to resume where the command names none. A command resumes a folder only if all of the campaign's identity is the same.
"""

import contextlib
import itertools
import json
import platform
import shutil
from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any, cast

from msgspec import Meta
from typing_extensions import NotRequired, TypedDict

from handover.cosim.blocks.variable import Kind
from handover.cosim.fmu.file.description import describe_fmu
from handover.cosim.typed_data import ExactSeconds, ExactTime, NotNegative, Seed
from handover.scenarios.experiment.parameters import text_of
from handover.scenarios.runs.campaign.plan import CampaignPlan, PlannedRun, safe_name
from handover.scenarios.runs.execution.file_experiment import settable_of
from handover.scenarios.runs.execution.unit_values import is_unit_value, split_parameters
from handover.scenarios.runs.results.folder_data import FileData, FmuData, MasterData, SourceData
from handover.scenarios.runs.results.run_folder import (
    UNFINISHED,
    InvalidRunFolder,
    check_no_links,
    check_place,
    dated_folder,
    disk_errors_reported,
    folder_claimed,
    folder_held,
    read_object,
    replacing,
    sha256_of,
    versions,
    write_whole,
)

_KINDS = {
    "units": "unit ",
    "master": "master's ",
    "versions": "version of ",
    "source": "scenario's ",
    "parameter_files": "content of ",
}
_MAX_LENGTH = 60
"""Characters of a value that a message shows."""


def _identity_of(plan: CampaignPlan, fmus: Mapping[str, Path]) -> dict[str, Any]:
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


_FILE = "campaign.json"

_BY_ANOTHER = "another command is running this campaign"

PARAMETER_UNITS = "parameter_units"
"""Key of the units of measurement of units' parameters, by `UNIT.NAME`, as their FMUs declare them."""

OF_NEITHER = f"is the folder of neither a run (no run.json) nor a campaign (no {_FILE})"
"""What is said of a folder where a run's or a campaign's is expected."""


class CampaignMasterData(MasterData):
    """Options of the runs' master; `call_limit` is in seconds of wall time, `pace` in simulated ones a second."""

    call_limit: NotRequired[NotNegative | None]
    pace: NotRequired[NotNegative | None]


class _OfSomeCampaigns(TypedDict, total=False):
    source: SourceData
    master: CampaignMasterData
    defaults: dict[str, str]
    platform: str
    start: ExactTime | None
    step: ExactSeconds | None
    recorded: list[str] | None
    parameter_units: dict[str, str]
    title: str
    headline: list[str]
    units: dict[str, FmuData]
    parameter_files: dict[str, FileData]
    versions: dict[str, str]
    experiment: str | None
    paired: bool
    stop: ExactTime | None
    scenes: list[str]
    varied_units: list[str]


class CampaignData(_OfSomeCampaigns):
    """What `campaign.json` holds: see `_identity_of`, and what is needed to show the campaign."""

    scenario: str
    points: Annotated[list[dict[str, str]], Meta(min_length=1)]
    fixed: dict[str, str]
    repetitions: Annotated[int, Meta(ge=1, le=10**6)]
    seed: Seed


class CampaignFolder:
    """The folder of a campaign: `campaign.json`, `fmus/`, `runs/NAME/`, `runs.parquet`, `report.html`.

    A paper's experiment adds `claims.json` and `figures/`.
    """

    def __init__(self, path: Path) -> None:
        self.path = path

    @property
    def runs(self) -> Path:
        """The folder of the runs' folders."""
        return self.path / "runs"

    @property
    def fmus(self) -> Path:
        """The folder of the FMUs that the runs use."""
        return self.path / "fmus"

    @property
    def table(self) -> Path:
        """The table of the runs."""
        return self.path / "runs.parquet"

    @property
    def report(self) -> Path:
        """The report page."""
        return self.path / "report.html"

    @property
    def figures(self) -> Path:
        """The folder of figures."""
        return self.path / "figures"

    @property
    def is_there(self) -> bool:
        """Whether a campaign has begun in it."""
        return (self.path / _FILE).is_file()

    def read(self) -> dict[str, Any]:
        """Return what `campaign.json` says.

        Raises:
            InvalidRunFolder: it is not the folder of a campaign, or damaged.
        """
        return read_object(self.path / _FILE, f"it is not the folder of a campaign: it has no {_FILE}", CampaignData)

    def check(self, plan: CampaignPlan, fmus: Mapping[str, Path]) -> None:
        """Check that a campaign can begin or be resumed here; nothing is written.

        Raises:
            InvalidRunFolder: it is of another campaign or of something else, damaged, or cannot be written to.
        """
        self._check_place()
        if not self.path.exists() or not any(self._counts(p) for p in self.path.iterdir()):
            return
        if not (self.path / _FILE).exists():
            raise InvalidRunFolder(self.path, f"it is not empty and has no {_FILE}; name a new folder, or a campaign's")
        differ = differences(self.read(), _identity_of(plan, fmus))
        if differ:
            raise InvalidRunFolder(self.path, f"it is of another campaign: {'; '.join(differ)}")
        self._check_names(plan)

    def check_free(self) -> None:
        """Check that no other command runs this campaign, if the folder is there.

        Raises:
            InvalidRunFolder: one is.
        """
        if self.path.is_dir():
            with self.held():
                pass

    @contextlib.contextmanager
    def opened(
        self, plan: CampaignPlan, fmus: Mapping[str, Path], check: Callable[[Path], None]
    ) -> Generator[dict[str, Path], None, None]:
        """Make the folder, or take the one that is there, and lock it; give the copies of the FMUs in it.

        `check` is called with the folder when a new one holds no more than `campaign.json`, by which another command
        finds it; if `check` raises, all is as it was.

        What runs that were killed have left is removed. A copy of an FMU has the name of the file; where two units have
        different files of one name, the unit's name stands before it.

        Raises:
            InvalidRunFolder: as by `check`; or another command has locked it, or it cannot be made.
            RecordNotWritten: it cannot be written to.
        """
        self._check_place()
        with folder_claimed(self.path, _BY_ANOTHER):
            self.check(plan, fmus)
            with self._written(plan, fmus):
                check(self.path)
            with disk_errors_reported(self.path):
                self.runs.mkdir(exist_ok=True)
                self.fmus.mkdir(exist_ok=True)
                self._remove_unfinished()
                copies = {unit: self._copy(unit, path, fmus) for unit, path in fmus.items()}
                if plan.inputs is not None:
                    self._copy("input", plan.inputs, fmus)
            yield copies

    def is_done(self, run: PlannedRun) -> bool:
        """Return whether a run's folder is there, with its summary; it has the run's name only when it is complete."""
        return (self.runs / run.name / "summary.json").is_file()

    def has_all(self, plan: CampaignPlan) -> bool:
        """Return whether all runs of a campaign are done."""
        return all(self.is_done(run) for run in plan.runs())

    @property
    def is_reported(self) -> bool:
        """Whether the report page is there and as new as the table."""
        try:
            return self.report.stat().st_mtime_ns >= self.table.stat().st_mtime_ns
        except OSError:
            return False

    def _check_place(self) -> None:
        if self.path.exists() and not self.path.is_dir():
            raise InvalidRunFolder(self.path, "there is a file of that name; name a new folder, or that of a campaign")
        check_place(self.path)

    def _check_names(self, plan: CampaignPlan) -> None:
        """Check that no folder stands where a file is to be, and no file where a folder."""
        check_no_links(self.path, "runs", "fmus")
        folders = [p for p in (self.table, self.report) if p.is_dir()]
        files = [p for p in (self.runs, *(self.runs / run.name for run in plan.runs())) if p.is_file()]
        if folders or files:
            place, form, right = (folders[0], "folder", "file") if folders else (files[0], "file", "folder")
            raise InvalidRunFolder(self.path, f"{place.relative_to(self.path)} is a {form}, not a {right}; remove it")

    def held(self) -> contextlib.AbstractContextManager[None]:
        """Lock the folder against other commands in a block.

        Raises:
            InvalidRunFolder: another command has locked it.
        """
        return folder_held(self.path, _BY_ANOTHER)

    def _counts(self, entry: Path) -> bool:
        """Return whether an entry counts: a command killed before it wrote `campaign.json` leaves some that do not."""
        return not entry.name.startswith(".")

    @contextlib.contextmanager
    def _written(self, plan: CampaignPlan, fmus: Mapping[str, Path]) -> Generator[None, None, None]:
        """Write `campaign.json` before the block, and remove it if the block fails; replace one after the block."""
        was_there = self.is_there
        if not was_there:
            self._write(plan, fmus)
        try:
            yield
        except BaseException:
            if not was_there:
                (self.path / _FILE).unlink(missing_ok=True)
            raise
        if was_there:
            self._write(plan, fmus)

    def _write(self, plan: CampaignPlan, fmus: Mapping[str, Path]) -> None:
        """Write `campaign.json`, before anything else is there: without it, the campaign could not be resumed."""
        experiment = plan.kind
        display: dict[str, Any] = {
            "title": experiment.title,
            "headline": list(experiment.headline),
            "platform": platform.platform(),
        }
        units = _parameter_units(plan, fmus)
        if plan.source is not None:  # whose code is not run to show the campaign
            declared = experiment.parameters()
            display["defaults"] = {v.name: text_of(v, v.start) for v in declared}
            units |= {v.name: v.unit.symbol for v in declared}
        content = {**_identity_of(plan, fmus), **display, PARAMETER_UNITS: units}
        if not (self.path / _FILE).exists() or self.read() != content:
            write_whole(self.path / _FILE, json.dumps(content, indent=2, allow_nan=False) + "\n")

    def _copy(self, unit: str, file: Path, fmus: Mapping[str, Path]) -> Path:
        namesakes = [other for other in fmus.values() if other.name == file.name]
        ambiguous = len({sha256_of(other) for other in namesakes}) > 1
        copy = self.fmus.absolute() / (safe_name(f"{unit}_{file.name}") if ambiguous else file.name)
        if not copy.is_file() or sha256_of(copy) != sha256_of(file):
            with replacing(copy) as unfinished:
                shutil.copyfile(file, unfinished)
        return copy

    def _remove_unfinished(self) -> None:
        """Remove what killed commands have left: unfinished files, and folders of runs whose names begin with a dot."""
        for file in itertools.chain(self.path.glob(UNFINISHED), self.fmus.glob(UNFINISHED)):
            file.unlink(missing_ok=True)
        for left in self.runs.iterdir():
            if left.name.startswith("."):
                shutil.rmtree(left, ignore_errors=True)


PLACE = Path("campaigns")
"""Where campaigns' folders are if the command names none."""


def default_folder(plan: CampaignPlan, fmus: Mapping[str, Path], opened: contextlib.ExitStack) -> CampaignFolder:
    """Return the newest folder of this very campaign in `campaigns/` if it lacks runs, else a new one.

    The new one is made; `opened` removes it if it is still empty then. So a command that was interrupted resumes where
    it stopped, and one that was complete begins a new campaign. The plan is a checked one.
    """
    wanted = _identity_of(plan, fmus)
    for path in sorted(PLACE.glob(f"*_{_stem(plan)}*/"), reverse=True):
        folder = CampaignFolder(path)
        try:
            stored = folder.read()
        except InvalidRunFolder:
            continue
        if all(stored.get(key) == value for key, value in wanted.items()):
            if not folder.has_all(plan):
                return folder
            break
    return CampaignFolder(opened.enter_context(dated_folder(PLACE, _stem(plan))))


def _stem(plan: CampaignPlan) -> str:
    return plan.experiment or Path(plan.kind.name).stem


def _parameter_units(plan: CampaignPlan, fmus: Mapping[str, Path]) -> dict[str, str]:
    """Return the units of measurement of the units' parameters that a plan sets, of any FMU in the unit's place."""
    kind = plan.kind
    names = dict.fromkeys(n for values in (*plan.points, plan.fixed) for n in values if is_unit_value(kind, n))
    if (settable := settable_of(kind)) is not None:
        return {name: port.unit.symbol for name in names if (port := settable.port(name)) is not None}
    units: dict[str, str] = {}
    for name in names:
        unit, _, parameter = name.partition(".")
        for path in (path for key, path in fmus.items() if key.partition("=")[0] == unit):
            if port := describe_fmu(path).parameters.get(parameter):
                units.setdefault(name, port.unit.symbol)
    return units
