"""The catalog of robots and of their scenarios by name, and those of other packages and modules.

Scenarios are listed by import path, not imported: a run loads its own, and no other robot's. A package adds scenarios
by entry points of the group `handover.scenarios`; any other is named by its path, such as `my_scene:TwoLinkReach`.
"""

import functools
import inspect
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module, metadata
from pathlib import Path
from typing import Any, cast

from handover.cosim.blocks.declarations import DeclarationError
from handover.cosim.exceptions import one_line
from handover.fmus.catalog import UNITS, UnknownBlock, UnknownUnit, find_unit, import_class
from handover.scenarios.experiment.experiment import Experiment

GROUP = "handover.scenarios"
"""The group of entry points that name scenarios; each is the path of a class."""


class InvalidScenario(ValueError):
    """What is named is no scenario, or lacks what a scenario must have; `faults` lists all of it."""

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
                "handover.scenarios.helix.helix_handover:HelixHandover",
                "the Helix takes a ball from a hand by visual servoing",
            ),
            "helix_reach": ScenarioEntry(
                "handover.scenarios.helix.helix_reach:HelixReach",
                "how far the Helix reaches, with exact measurements instead of cameras",
            ),
            "helix_reflex_grasp": ScenarioEntry(
                "handover.scenarios.helix.helix_reflex_grasp:HelixReflexGrasp",
                "the Helix comes to a ball by its cameras and centres its gripper by infrared fingers",
            ),
            "helix_use_case": ScenarioEntry(
                "handover.scenarios.helix.helix_use_case:HelixUseCase",
                "the Helix takes a ball from a hand and drops it into a bowl",
            ),
        },
    ),
    RobotSystem(
        "VSL arm, with links of variable stiffness",
        "vsl",
        {
            "vsl_model_based": ScenarioEntry(
                "handover.scenarios.vsl.path_experiments:VslModelBased",
                "an arm of soft links follows a path by rigid-link kinematics",
            ),
            "vsl_hybrid": ScenarioEntry(
                "handover.scenarios.vsl.path_experiments:VslHybrid",
                "an arm of soft links follows a path by kinematics with learned corrections",
            ),
            "vsl_pick_and_place": ScenarioEntry(
                "handover.scenarios.vsl.pick_and_place:VslPickAndPlace",
                "an arm of soft links picks an object up softly and carries it stiffly",
            ),
        },
    ),
    RobotSystem(
        "Free-flyer, in microgravity",
        "free_flyer",
        {
            "flyer_impedance": ScenarioEntry(
                "handover.scenarios.free_flyer.push.impedance:FlyerImpedance",
                "a free-flyer yields to a push against its gripper and comes back",
            ),
            "flyer_arm_impedance": ScenarioEntry(
                "handover.scenarios.free_flyer.push.arm_impedance:FlyerArmImpedance",
                "a free-flyer yields to a push against its gripper with base and arm",
            ),
            "flyer_robot_to_human": ScenarioEntry(
                "handover.scenarios.free_flyer.handover.handovers:RobotToHuman",
                "a free-flyer fetches an object and gives it to a person",
            ),
            "flyer_human_to_robot": ScenarioEntry(
                "handover.scenarios.free_flyer.handover.handovers:HumanToRobot",
                "a person gives an object to a free-flyer",
            ),
            "flyer_failed_reception": ScenarioEntry(
                "handover.scenarios.free_flyer.handover.handovers:FailedReception",
                "a free-flyer closes its gripper on nothing, notices, and asks again",
            ),
            "flyer_collaborative": ScenarioEntry(
                "handover.scenarios.free_flyer.handover.handovers:Collaborative",
                "a free-flyer gives an object to a person, waits, and takes it back",
            ),
            "flyer_handover": ScenarioEntry(
                "handover.scenarios.free_flyer.handover.handovers:HandoverOfTask",
                "a free-flyer and a person hand an object over, in one of the four ways",
            ),
            "flyer_two_robots": ScenarioEntry(
                "handover.scenarios.free_flyer.two_robots.two_robots:TwoRobots",
                "two free-flyers and a person with two hands hand a large object over",
            ),
        },
    ),
    RobotSystem(
        "IR grasp, a soft hand with infrared sensors",
        "ir_grasp",
        {
            "ir_grasp": ScenarioEntry(
                "handover.scenarios.ir_grasp.ir_grasp:IrGrasp",
                "a soft hand grasps an object whose place is known roughly, by infrared reflexes",
            ),
            "ir_sensor": ScenarioEntry(
                "handover.scenarios.ir_grasp.ir_sensor:IrSensor",
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


def _faults_of(named: type[Any]) -> list[str]:
    """Return what keeps a class from being a scenario that runs."""
    if not issubclass(named, Experiment):
        return [f"{named.__name__} is no scenario: it must be a subclass of Experiment"]
    scenario = cast(type[Experiment[Any]], named)
    faults = [f"it has no method {name!r}" for name in sorted(getattr(scenario, "__abstractmethods__", ()))]
    try:
        scenario.parameters()
    except (DeclarationError, TypeError) as e:
        faults.append(f"its parameters are invalid: {one_line(e)}")
    if scenario.name in SCENARIOS and scenario is not SCENARIOS[scenario.name]:
        faults.append(f"its name {scenario.name!r} is that of a scenario of this package; give it another")
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

    def find(self) -> type[Experiment[Any]]:
        """Return the scenario, from the folder where it was.

        Raises:
            KeyError, InvalidScenario: as `named_scenario`; also if the module of that name is another folder's.
        """
        search_folder(self.folder)
        scenario = named_scenario(self.scenario)
        if self.folder and (here := _folder_of(scenario)) != self.folder:
            fault = f"its module was in {self.folder}; here a module of that name comes from {here or 'a package'}"
            raise InvalidScenario(self.scenario, [fault])
        return scenario


def scenario_of(name: str, source: Mapping[str, Any]) -> type[Experiment[Any]] | None:
    """Return the scenario of a run or campaign as its folder names it, None where it is not to be had here.

    Args:
        name: the scenario's.
        source: a `ScenarioSource` as data; what else a run was of, an SSP or an FMU; or nothing, for this package's.
    """
    if not source:
        return SCENARIOS.get(name)
    try:
        return ScenarioSource(**source).find()
    except (TypeError, KeyError, InvalidScenario):
        return None


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
    is_installed = {"site-packages", "dist-packages"} & set(file.parts)
    return "" if is_installed else str(file.parents[depth])
