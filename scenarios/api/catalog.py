"""What there is: units and systems by name, FMUs by file, and the results of former runs by folder."""

import contextlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

from handover.cosim.fmu.file.description import FmuDescription, describe_fmu
from handover.cosim.system.system import System
from handover.fmus.build import cached
from handover.fmus.catalog import UnknownBlock, UnknownUnit
from handover.fmus.contents.fmi2_description import NoFmi2Form
from handover.scenarios.api.arguments import (
    InvalidInput,
    errors_for_python,
    merged,
    of_type,
    path_of,
    texts_of,
    unit_texts,
    whole_number,
)
from handover.scenarios.api.campaign_result import Campaign
from handover.scenarios.api.run_result import Run
from handover.scenarios.catalog import search_folder
from handover.scenarios.experiment.experiment import Experiment
from handover.scenarios.runs.campaign.folder import OF_NEITHER, CampaignFolder
from handover.scenarios.runs.execution.request import RunRequest
from handover.scenarios.runs.execution.selection import nothing_at
from handover.scenarios.runs.results.run_folder import RunFolder


def unit(name: str, fmi: Literal[2, 3] = 3) -> Path:
    """Return the FMU of a unit, for `System.add`; it is built where it is not yet.

    Args:
        name: a unit of the catalog or of an installed package, such as "TendonArm"; or the path of a block, such as
            "my_arm:MyArm". Its module is looked for in the working directory, too.
        fmi: 2 or 3.

    Raises:
        InvalidInput: there is no such unit, or it cannot be built in this standard.
    """
    of_type("name", name, str, "the name of a unit, or the path of a block such as 'my_arm:MyArm'")
    if fmi not in (2, 3):
        raise InvalidInput(f"fmi = {fmi!r:.60}: expected 2 or 3")
    if ":" in name:
        search_folder(Path.cwd())
    try:
        with errors_for_python():
            return cached(name, fmi)
    except (UnknownUnit, UnknownBlock, NoFmi2Form) as e:
        raise InvalidInput(str(e)) from e


def describe(fmu: str | Path) -> FmuDescription:
    """Return what an FMU declares, which a notebook shows as a table: of a file, or of a unit as `unit` takes it.

    Raises:
        InvalidInput: it is not a valid FMU, or no unit of that name.
    """
    with errors_for_python():
        path = path_of("fmu", fmu)
        return describe_fmu(path if path.suffix.lower() == ".fmu" else unit(str(fmu)))


def system(
    scenario: str | type[Experiment[Any]],
    /,
    *,
    seed: int = 0,
    units: Mapping[str, Path | str] | None = None,
    parameters: Mapping[str, Any] | None = None,
    **named: Any,
) -> System:
    """Return the system that a scenario wires with such parameters, which a notebook shows as a graph.

    It may be changed and run: `handover.run(system, stop=10)`. For the arguments see `handover.run`.

    Raises:
        InvalidInput: there is no such scenario, or parameters or units do not fit it.
    """
    texts = texts_of(merged(parameters, named))
    with errors_for_python(), contextlib.ExitStack() as opened:
        checked = whole_number("seed", seed)
        request = RunRequest(subject=scenario, parameters=texts, seed=checked, units=unit_texts(units))
        request.check_options()
        asked = request.open(opened)
        return request.system(asked, request.seed, request.fmus(asked.experiment))


def load(folder: Path | str) -> Run | Campaign:
    """Return the run or the campaign that a folder is of, also of one that was interrupted.

    No code is run that the folder names: plots and replay of a scenario of your own need its module imported before.

    Raises:
        InvalidInput: it is the folder of neither.
    """
    path = path_of("folder", folder)
    if CampaignFolder(path).is_there:
        return Campaign(path)
    if path.is_file():
        raise InvalidInput(
            f"{path}: it is a file; expected the folder of a run or of a campaign, such as {path.parent}"
        )
    if not _has_results(path):
        raise InvalidInput(f"{path} {OF_NEITHER}" if path.is_dir() else f"{path}: {nothing_at(path, _has_results)}")
    return Run(path)


def _has_results(path: Path) -> bool:
    return CampaignFolder(path).is_there or RunFolder.of_run(path).is_there
