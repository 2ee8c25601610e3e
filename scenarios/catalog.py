"""The catalog of robots and of their scenarios by name, and those of other packages and modules.

Scenarios are listed by import path, not imported: a run loads its own, and no other robot's. A package adds scenarios
by entry points of the group `handover.scenarios`; any other is named by its path, such as `my_scene:TwoLinkReach`.
"""

import functools
import inspect
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, is_dataclass
from importlib import import_module, metadata
from importlib.machinery import EXTENSION_SUFFIXES, SOURCE_SUFFIXES, ExtensionFileLoader, FileFinder, SourceFileLoader
from pathlib import Path
from types import CodeType
from typing import Any, cast

from handover.cosim.blocks.declarations import DeclarationError
from handover.cosim.exceptions import one_line
from handover.cosim.python_process import is_installed
from handover.fmus.catalog import UNITS, UnknownBlock, UnknownUnit, find_unit, import_class
from handover.scenarios.experiment.experiment import Experiment
from handover.scenarios.experiment.places import Place
from handover.scenarios.experiment.returned_types import Expected, WrongType, mapping_to, sequence_of

GROUP = "handover.scenarios"
"""The group of entry points that name scenarios; each is the path of a class."""


class InvalidScenario(ValueError):
    """What is named is not a scenario, or lacks what a scenario must have; `faults` lists all of it."""

    def __init__(self, path: str, faults: Sequence[str]) -> None:
        super().__init__(f"{path}: {'; '.join(faults)}")
        self.path, self.faults = path, tuple(faults)


@dataclass(frozen=True)
class ScenarioEntry:
    """A scenario of this package, as lists show it without importing it.

    Attributes:
        path: import path of its class.
        title: the one of its class.
    """

    path: str
    title: str


@dataclass(frozen=True)
class RobotSystem:
    """A published robot with its world.

    Attributes:
        title: what it is.
        package: name of the packages of its plants, controllers and scenarios.
        scenarios: its scenarios by name.
    """

    title: str
    package: str
    scenarios: Mapping[str, ScenarioEntry]

    @property
    def units(self) -> tuple[str, ...]:
        """Names of its catalogued units."""
        return tuple(name for name, unit in UNITS.items() if f".{self.package}." in unit.block)


SYSTEMS = (
    RobotSystem(
        "Helix, a tendon-driven soft arm",
        "helix",
        {
            "helix_handover": ScenarioEntry(
                "handover.scenarios.robots.helix.helix_handover:HelixHandover",
                "the Helix takes a ball from a hand by visual servoing",
            ),
            "helix_reach": ScenarioEntry(
                "handover.scenarios.robots.helix.helix_reach:HelixReach",
                "how far the Helix reaches, with exact measurements instead of cameras",
            ),
            "helix_reflex_grasp": ScenarioEntry(
                "handover.scenarios.robots.helix.helix_reflex_grasp:HelixReflexGrasp",
                "the Helix comes to a ball by its cameras and centres its gripper by infrared fingers",
            ),
            "helix_use_case": ScenarioEntry(
                "handover.scenarios.robots.helix.helix_use_case:HelixUseCase",
                "the Helix takes a ball from a hand and drops it into a bowl",
            ),
        },
    ),
    RobotSystem(
        "VSL arm, with links of variable stiffness",
        "vsl",
        {
            "vsl_model_based": ScenarioEntry(
                "handover.scenarios.robots.vsl.path_experiments:VslModelBased",
                "an arm of soft links follows a path by rigid-link kinematics",
            ),
            "vsl_hybrid": ScenarioEntry(
                "handover.scenarios.robots.vsl.path_experiments:VslHybrid",
                "an arm of soft links follows a path by kinematics with learned corrections",
            ),
            "vsl_pick_and_place": ScenarioEntry(
                "handover.scenarios.robots.vsl.pick_and_place:VslPickAndPlace",
                "an arm of soft links picks an object up softly and carries it stiffly",
            ),
        },
    ),
    RobotSystem(
        "Free-flyer, in microgravity",
        "free_flyer",
        {
            "flyer_impedance": ScenarioEntry(
                "handover.scenarios.robots.free_flyer.push.impedance:FlyerImpedance",
                "a free-flyer yields to a push against its gripper and comes back",
            ),
            "flyer_arm_impedance": ScenarioEntry(
                "handover.scenarios.robots.free_flyer.push.arm_impedance:FlyerArmImpedance",
                "a free-flyer yields to a push against its gripper with base and arm",
            ),
            "flyer_robot_to_human": ScenarioEntry(
                "handover.scenarios.robots.free_flyer.handover.handovers:RobotToHuman",
                "a free-flyer fetches an object and gives it to a person",
            ),
            "flyer_human_to_robot": ScenarioEntry(
                "handover.scenarios.robots.free_flyer.handover.handovers:HumanToRobot",
                "a person gives an object to a free-flyer",
            ),
            "flyer_failed_reception": ScenarioEntry(
                "handover.scenarios.robots.free_flyer.handover.handovers:FailedReception",
                "a free-flyer closes its gripper on nothing, notices, and asks again",
            ),
            "flyer_collaborative": ScenarioEntry(
                "handover.scenarios.robots.free_flyer.handover.handovers:Collaborative",
                "a free-flyer gives an object to a person, waits, and takes it back",
            ),
            "flyer_handover": ScenarioEntry(
                "handover.scenarios.robots.free_flyer.handover.handovers:HandoverOfTask",
                "a free-flyer and a person hand an object over, in one of the four ways",
            ),
            "flyer_two_robots": ScenarioEntry(
                "handover.scenarios.robots.free_flyer.two_robots.two_robots:TwoRobots",
                "two free-flyers and a person with two hands hand a large object over",
            ),
        },
    ),
    RobotSystem(
        "IR grasp, a soft hand with infrared sensors",
        "ir_grasp",
        {
            "ir_grasp": ScenarioEntry(
                "handover.scenarios.robots.ir_grasp.ir_grasp:IrGrasp",
                "a soft hand grasps an object whose place is known roughly, by infrared reflexes",
            ),
            "ir_sensor": ScenarioEntry(
                "handover.scenarios.robots.ir_grasp.ir_sensor:IrSensor",
                "an infrared sensor on a soft hand approaches a face, as its curve is taken",
            ),
        },
    ),
)


class _Scenarios(Mapping[str, type[Experiment[Any]]]):
    """Scenarios by name, each imported on first access."""

    def __init__(self, entries: Mapping[str, ScenarioEntry]) -> None:
        self._entries = entries

    def __getitem__(self, name: str) -> type[Experiment[Any]]:
        module, _, experiment = self._entries[name].path.partition(":")
        scenario: type[Experiment[Any]] = getattr(import_module(module), experiment)
        return scenario

    def __contains__(self, name: object) -> bool:
        return name in self._entries

    def __iter__(self) -> Iterator[str]:
        return iter(self._entries)

    def __len__(self) -> int:
        return len(self._entries)


SCENARIOS: Mapping[str, type[Experiment[Any]]] = _Scenarios(
    {name: entry for system in SYSTEMS for name, entry in system.scenarios.items()}
)
"""Those of this package."""


@functools.cache
def installed_scenarios() -> Mapping[str, str]:
    """Return the paths of other packages' scenarios by name, sorted; a name of `SCENARIOS` stays this package's."""
    found = {e.name: e.value for e in metadata.entry_points(group=GROUP)}
    return {name: found[name] for name in sorted(found) if name not in SCENARIOS}


def named_scenario(name: str) -> type[Experiment[Any]]:
    """Return the scenario of a name, or of a path such as `my_scene:TwoLinkReach`, which Python's path finds.

    Raises:
        KeyError: no scenario has this name.
        InvalidScenario: what the path names is none, or is not complete.
    """
    if name in SCENARIOS:
        return SCENARIOS[name]
    path = name if ":" in name else installed_scenarios()[name]
    try:
        scenario = import_class(path)
    except UnknownBlock as e:
        raise InvalidScenario(path, [e.fault]) from e
    if faults := _faults_of(scenario):
        raise InvalidScenario(path, faults)
    return scenario


_OF_CLASSES: Mapping[str, Expected] = {
    "headline": sequence_of(str, '("distance",)'),
    "unit_files": sequence_of(str, '("controller.model",)'),
    "places": mapping_to(Place, '{"controller": Place(required={"tau": "joint 1 first"})}'),
}
"""Class attributes of a scenario whose other types would be taken for something else, as a text for its letters."""


def _faults_of(named: type[Any]) -> list[str]:
    """Return what keeps a class from being a scenario that runs."""
    if not issubclass(named, Experiment):
        return [f"{named.__name__} is not a scenario: it must be a subclass of Experiment"]
    scenario: type[Experiment[Any]] = named
    faults = [f"it has no method {name!r}" for name in sorted(getattr(scenario, "__abstractmethods__", ()))]
    try:
        if not is_dataclass(scenario.parameters_type):
            right = "write @dataclass(frozen=True, kw_only=True) in the line above its class"
            raise TypeError(f"{scenario.parameters_type} is not a dataclass; {right}")
        scenario.parameters()
    except (DeclarationError, TypeError) as e:
        faults.append(f"its parameters are invalid: {one_line(e)}")
    if scenario.name in SCENARIOS and scenario is not SCENARIOS[scenario.name]:
        faults.append(f"its name {scenario.name!r} is that of a scenario of this package; give it another")
    for name, expected in _OF_CLASSES.items():
        try:
            expected.check(f"its {name!r} is", getattr(scenario, name))
        except WrongType as e:
            faults.append(str(e))
    units: Any = getattr(scenario, "units", None)
    if not isinstance(units, Mapping):
        return [*faults, "it has no 'units', a mapping such as {'arm': 'my_arm:MyArm'}"]
    for place, unit in cast(Mapping[str, str], units).items():
        try:
            find_unit(unit)
        except (UnknownUnit, UnknownBlock) as e:
            faults.append(f"its unit {place!r}: {e}")
    return faults


@dataclass(frozen=True)
class ScenarioSource:
    """Where a scenario that is not this package's is found again.

    Attributes:
        scenario: its name, as installed packages have it, or its path, such as `my_scene:TwoLinkReach`.
        folder: from which its module was imported; "" if it is installed.
        sha256: of its module and of the modules beside it that this imports.
    """

    scenario: str
    folder: str
    sha256: str

    @classmethod
    def of(cls, name: str) -> "ScenarioSource | None":
        """Return that of a scenario by its name or path; None for those of this package."""
        if name in SCENARIOS:
            return None
        from handover.fmus.sources import carried_digest  # of own scenarios alone

        scenario = named_scenario(name)
        return cls(name, _folder_of(scenario), carried_digest(f"{scenario.__module__}:{scenario.__qualname__}"))

    @property
    def path(self) -> str:
        """The path of its class.

        Raises:
            KeyError: no installed package has a scenario of its name.
        """
        return self.scenario if ":" in self.scenario else installed_scenarios()[self.scenario]

    def unchanged_file(self) -> Path:
        """Return the file of its module, whose code is compared with what it was, and not run.

        Raises:
            KeyError: no installed package has a scenario of its name.
            InvalidScenario: its code is not here, or is not what it was.
        """
        from handover.fmus.sources import carried_digest, source_file  # of own scenarios alone

        import_from_source(self.folder)
        try:
            file, here = source_file(self.path), carried_digest(self.path)
        except UnknownBlock as e:
            raise InvalidScenario(self.scenario, [e.fault]) from e
        if here != self.sha256:
            raise InvalidScenario(self.scenario, [f"its code, {file}, is not what the run had"])
        return file


_TRUSTED: set[str] = set()
"""Modules of files that somebody has named for their code to be run, whatever folder says so."""


def scenario_of(name: str, source: Mapping[str, Any]) -> type[Experiment[Any]] | None:
    """Return the scenario of a run or campaign as its folder names it; no code is run because a folder names it.

    It is this package's or an installed package's, by its name; or the class of a module that this process has imported
    already, as the command did that runs it, or `trust_file`. None where it is none of these.

    Args:
        name: the scenario's.
        source: a `ScenarioSource` as data; what else a run was of, an SSP or an FMU; or nothing, for this package's.
    """
    if not source:
        return SCENARIOS.get(name)
    path = source.get("scenario")
    if not isinstance(path, str):
        return None
    if path in installed_scenarios():
        try:
            return named_scenario(path)
        except InvalidScenario:
            return None
    module, _, class_name = path.partition(":")
    found = vars(sys.modules[module]).get(class_name) if module in sys.modules else None
    if not isinstance(found, type) or not issubclass(found, Experiment):
        return None
    scenario = cast(type[Experiment[Any]], found)
    return scenario if module in _TRUSTED or _folder_of(scenario) == source.get("folder") else None


def untrusted_code(source: Mapping[str, Any]) -> str:
    """Return that the own scenario's code is not run which a folder names, and what would run it; "" of all others."""
    path, folder = source.get("scenario"), source.get("folder")
    if not isinstance(path, str) or not isinstance(folder, str):
        return ""
    module, colon, _ = path.partition(":")
    if not colon:
        return f"its scenario {path} is not installed here"
    file = Path(folder, f"{module.replace('.', '/')}.py")
    named = file if folder and file.is_file() else f"{module.rpartition('.')[2]}.py"
    return f"its scenario {path} draws them by its own code, which is run only if you name it: --trust {named}"


def trust_file(file: Path) -> None:
    """Import a file, of a scenario of somebody's own, so that `scenario_of` finds what is in it.

    Raises:
        InvalidScenario: there is no such file, it cannot be imported, or another module of its name comes before it.
    """
    from handover.fmus.sources import source_file  # of own scenarios alone

    file = file.absolute()
    if file.suffix != ".py" or not file.is_file():
        raise InvalidScenario(str(file), ["there is no such file of Python, as my_scene.py"])
    folder, parts = file.parent, [] if file.name == "__init__.py" else [file.stem]
    while (folder / "__init__.py").is_file():
        folder, parts = folder.parent, [folder.name, *parts]
    module = ".".join(parts)
    import_from_source(folder)
    try:
        if not (there := source_file(module)).samefile(file):
            raise InvalidScenario(str(file), [f"the module {module} is {there}: rename the file"])
        import_module(module)
    except InvalidScenario:
        raise
    except (Exception, SystemExit) as e:  # a module may raise anything while it is loaded
        raise InvalidScenario(str(file), [f"it cannot be loaded: {type(e).__name__}: {one_line(e)}"]) from e
    _TRUSTED.add(module)


class _SourceLoader(SourceFileLoader):
    """Loads a module from its source alone."""

    def get_code(self, fullname: str) -> CodeType:
        """Return the code of the source, whatever is in `__pycache__`."""
        path = self.get_filename(fullname)
        return self.source_to_code(self.get_data(path), path)  # type: ignore


_FROM_SOURCE: set[Path] = set()


def import_from_source(folder: Path | str) -> None:
    """Search a folder as `search_folder` does; bytecode in it is not run, which need not be that of the source there.

    So what a person has read, or a hash was compared of, is what runs.
    """
    if not folder:
        return
    if not _FROM_SOURCE:
        sys.path_hooks.insert(0, _finder_of_source)
    _FROM_SOURCE.add(Path(folder).absolute())
    for path in [*sys.path_importer_cache]:
        if _is_from_source(path):
            del sys.path_importer_cache[path]
    search_folder(folder)


def _is_from_source(path: str) -> bool:
    place = Path(path).absolute()
    return not is_installed(place) and any(place.is_relative_to(folder) for folder in _FROM_SOURCE)


def _finder_of_source(path: str) -> FileFinder:
    if not _is_from_source(path) or not Path(path).is_dir():
        raise ImportError(path)
    return FileFinder(path, (ExtensionFileLoader, EXTENSION_SUFFIXES), (_SourceLoader, SOURCE_SUFFIXES))


def search_folder(folder: Path | str) -> None:
    """Let Python find modules in a folder, after all others: a file `json.py` there is not taken for Python's own.

    It is called for modules that the user names, and never else; `""` names none.
    """
    if folder and str(folder) not in sys.path:
        sys.path.append(str(folder))


def _folder_of(scenario: type[Any]) -> str:
    """Return the folder from which a class's module was imported, "" if that is where packages are installed."""
    file = Path(inspect.getfile(scenario)).absolute()
    depth = scenario.__module__.count(".") + (file.name == "__init__.py")
    return "" if is_installed(file) else str(file.parents[depth])
