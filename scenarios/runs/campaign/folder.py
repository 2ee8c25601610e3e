"""The folder of a campaign: its plan, the FMUs that it uses, the folders of its runs, and their table.

`CampaignFolder.opened` makes the folder or resumes it, and keeps other commands from it; `default_folder` finds the one
to resume where the command names none.
"""

import contextlib
import itertools
import json
import platform
import shutil
from collections.abc import Callable, Generator, Mapping
from pathlib import Path
from typing import Annotated, Any

from msgspec import Meta
from typing_extensions import NotRequired, TypedDict

from handover.cosim.fmu.file.description import describe_fmu
from handover.cosim.typed_data import ExactSeconds, ExactTime, NotNegative, Seed
from handover.scenarios.experiment.parameters import text_of
from handover.scenarios.runs.campaign.identity import differences, identity_of
from handover.scenarios.runs.campaign.plan import CampaignPlan, PlannedRun, safe_name
from handover.scenarios.runs.execution.file_experiment import settable_of
from handover.scenarios.runs.execution.unit_values import is_unit_value
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
    write_whole,
)

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
    """What `campaign.json` holds: see `identity_of`, and what is needed to show the campaign."""

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
        differ = differences(self.read(), identity_of(plan, fmus))
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
        content = {**identity_of(plan, fmus), **display, PARAMETER_UNITS: units}
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
    wanted = identity_of(plan, fmus)
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
