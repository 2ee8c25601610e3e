"""What a robot's controllers do not know of it: where they assume another body or another delay, and stuck nozzles.

Both sides are taken from the values that the units got, whether by the scenario's parameters or by the units' own.
"""

from collections.abc import Mapping

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.cosim.system.system import PlacedUnit
from handover.plants.free_flyer.robot.thrusters import Propulsion
from handover.scenarios.experiment.starts import array_of, value_of
from handover.scenarios.robots.free_flyer.parameters import ROBOTS, Body

_BODY = {"mass": "mass", "I_B": "inertia", "p_BG": "arm"}
_LINKS = {"link": "arm's links", "mass_L": "links' mass", "I_L": "links' inertia"}
"""What a robot has in common with its controllers' model of it, by the name of the parameter."""
_CONTROLLERS = ("impedance", "pose")
_TOLERANCE = 1e-3
"""Share by which values differ that are not the same."""
_TIME = 1e-6
"""The same of times, s."""


def model_mismatch(units: Mapping[str, PlacedUnit]) -> str:
    """Return what a robot's controllers do not know of it, as the end of a sentence; of each robot, if there are two.

    A unit of another kind, which has no such parameter, is left out.
    """
    robots = {"": "the robot's"} if "robot" in units else {f"_{r}": f"robot {r}'s" for r in ROBOTS}
    parts = [part for suffix, whose in robots.items() for part in _mismatch_of(units, suffix, whose)]
    return "".join(f"; {part}" for part in parts)


def assumed_body(controller: PlacedUnit, otherwise: Body) -> Body:
    """Return the robot as a controller takes it to be; what it has no parameter of, as `otherwise` says."""
    has = controller.description.parameters
    given = {name: array_of(controller, name) for name in _BODY if name in has}
    mass = _number(controller, "mass") if "mass" in has else otherwise.mass
    return Body(mass, given.get("I_B", otherwise.I_B), given.get("p_BG", otherwise.p_BG))


def _mismatch_of(units: Mapping[str, PlacedUnit], suffix: str, whose: str) -> list[str]:
    robot, thrusters = units.get(f"robot{suffix}"), units.get(f"thrusters{suffix}")
    controllers = [c for name in _CONTROLLERS if (c := units.get(f"{name}{suffix}")) is not None]
    parts = _stuck(thrusters, whose if suffix else "")
    if robot is not None:
        parts += [f"{whose} {text}" for controller in controllers for text in _unlike(robot, controller)]
    late = sum(_number(u, "delay") for u in (thrusters, units.get(f"navigation{suffix}")))
    knew: dict[float, list[str]] = {}
    for c in controllers:
        if "delay" in c.description.parameters and abs((known := _number(c, "delay")) - late) > _TIME:
            knew.setdefault(known, []).append(c.name)
    parts += [
        f"{whose} thrust followed its state {1000.0 * late:.3g} ms late, of which {' and '.join(names)} knew "
        f"{1000.0 * known:.3g} ms"
        for known, names in knew.items()
    ]
    return list(dict.fromkeys(parts))


def _stuck(thrusters: PlacedUnit | None, whose: str) -> list[str]:
    """Return which nozzles are stuck of thrusters that use them."""
    if thrusters is None or "flapper_range" not in thrusters.description.parameters:
        return []
    propulsion = str(value_of(thrusters, "propulsion")).lower()
    if propulsion not in (Propulsion.NOZZLES.name.lower(), str(int(Propulsion.NOZZLES))):
        return []
    shut = [str(k + 1) for k, part in enumerate(array_of(thrusters, "flapper_range").tolist()) if part == 0.0]
    if not shut:
        return []
    which = f"nozzle {shut[0]} was" if len(shut) == 1 else f"nozzles {', '.join(shut)} were"
    return [f"{whose} {which} stuck closed".lstrip()]


def _unlike(robot: PlacedUnit, controller: PlacedUnit) -> list[str]:
    """Return in what a controller's model differs from the robot."""
    joints, assumed = (int(_number(u, "joints")) for u in (robot, controller))
    if joints != assumed:  # fixed joints: the controller takes all links for one body
        whole = _number(robot, "mass") + float(np.sum(array_of(robot, "mass_L")[:joints]))
        return _compared("mass", np.array([whole]), controller, "mass")
    names = _BODY | (_LINKS if joints else {})
    found: list[str] = []
    for name, what in names.items():
        if name in robot.description.parameters:
            actual = array_of(robot, name)
            found += _compared(what, actual[:joints] if name in _LINKS else actual, controller, name)
    return found


def _compared(what: str, actual: Floats, controller: PlacedUnit, name: str) -> list[str]:
    """Return how a quantity of the robot differs from what a controller assumes of it, in a list; none if it knows."""
    if name not in controller.description.parameters:
        return []
    assumed = array_of(controller, name)[: len(actual)]
    scale = float(np.max(np.abs(assumed), initial=0.0))
    if assumed.shape != actual.shape or np.allclose(actual, assumed, rtol=_TOLERANCE, atol=_TOLERANCE * scale):
        return []
    ratio = float(np.sum(actual * assumed)) / max(float(np.sum(assumed**2)), 1e-300)
    if np.allclose(actual, ratio * assumed, rtol=_TOLERANCE, atol=_TOLERANCE * scale):
        return [f"{what} was {ratio:.4g} times what its controllers assumed"]
    return [f"{what} was not what its controllers assumed"]


def _number(unit: PlacedUnit | None, name: str) -> float:
    """Return a parameter's value; 0 of a unit that is not there, or has none of that name."""
    if unit is None or name not in unit.description.parameters:
        return 0.0
    return float(array_of(unit, name).ravel()[0])
