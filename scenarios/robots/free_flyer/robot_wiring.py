"""Wiring that the free-flyer's scenarios share: the robot, its thrusters, its navigation, and controllers.

Also the metrics of the controllers' closed loops, which they compute by their own models at the start.
"""

from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any

import numpy as np

from handover.controllers.free_flyer.ports import PERIOD
from handover.controllers.free_flyer.ports import Behaviour as Gains
from handover.cosim.blocks.ports import Floats
from handover.cosim.system.signals import Signals
from handover.cosim.system.system import PlacedUnit, System
from handover.plants.free_flyer.robot.thrusters import Params as ThrustersParams
from handover.scenarios.experiment.experiment import FmuOf, Metric
from handover.scenarios.experiment.live_inputs import Pushable
from handover.scenarios.experiment.parameters import InvalidParameter
from handover.scenarios.robots.free_flyer.parameters import (
    ROBOTS,
    HandoverParameters,
    ImpedanceParameters,
    Propulsion,
    Wrench,
)

_GREATEST_PUSH = 5.0
"""Force of the thesis's validation, sec. 4.1.3, N: no person's push on a robot is greater."""
PUSHES = (
    Pushable(labels=("robot", "arm", "gripper"), unit="robot", force="f_P", point="p_BP", greatest=_GREATEST_PUSH),
)
"""A person may push a robot whose arm is fixed anywhere."""
PUSHES_WITH_JOINTS = (
    Pushable(labels=("robot",), unit="robot", force="f_P", point="p_BP", greatest=_GREATEST_PUSH),
    Pushable(labels=("gripper",), unit="robot", force="f_Q", point="p_GQ", greatest=_GREATEST_PUSH),
)
"""Of one whose arm has joints the base and the gripper."""
PUSHES_OF_TEAM = tuple(
    Pushable(
        labels=tuple(f"{part} {r}" for part in ("robot", "arm", "gripper")),
        unit=f"robot_{r}",
        force="f_P",
        point="p_BP",
        greatest=_GREATEST_PUSH,
    )
    for r in ROBOTS
)
"""Each of two robots anywhere."""
SATURATED_SHARE = "share of the time for which more was commanded than the thrusters give"
"""What the metric `saturated_share` is; controllers that clip their own commands never command more."""
_CUSTOM_GAINS = tuple(f"{what}_{of}" for what in ("stiffness", "damping") for of in ("translation", "rotation"))
_OF_JOINTS = (
    *("axis_J", "link", "centre_L", "mass_L", "I_L", "rotor_J", "q_J_0", "lower_J", "upper_J", "tolerance_J"),
    *("torque_max_J", "friction_J", "drag_J", "lock_time"),
)
"""Parameters of a robot that mean nothing where it has no joints."""
_TRUE = ("p_WB", "q_WB", "v_WB", "w_WB")
_MEASURED = ("p_WB_meas", "q_WB_meas", "v_WB_meas", "w_WB_meas")
_ROBOT = "FreeFlyer"
_SEEN = ("p_WG", "q_WG", "v_WG", "w_WG")


def expected_lag(propulsion: Propulsion) -> float:
    """Return the lag of the thrusters that the controllers assume, s.

    Of nozzles it is that of their flappers: thrust follows a flapper's angle at once, and as its sine rather than in
    proportion, so that a step of the command lags by 0.8 to 1.2 of it. Impellers stay at their speed.
    """
    if propulsion is Propulsion.IDEAL:
        return 0.0
    values = vars(ThrustersParams())
    return float(values["flapper_lag" if propulsion is Propulsion.NOZZLES else "lag"])


def thruster_settings(propulsion: Propulsion, stuck_nozzle: int) -> dict[str, Any]:
    """Return the parameters of the thrusters' unit; without nozzles none is stuck."""
    settings: dict[str, Any] = {"propulsion": propulsion.item}
    if stuck_nozzle == 0 or propulsion is not Propulsion.NOZZLES:
        return settings
    opens = np.ones(12)
    opens[stuck_nozzle - 1] = 0.0
    return settings | {"flapper_range": opens}


def check_reach(p_WG: Floats, person: Mapping[str, Any]) -> None:
    """Reject a handover place where a person, by parameters of its unit, could not reach the object.

    Raises:
        InvalidParameter: it is one.
    """
    at = {name: np.array(person[name]) for name in ("p_OH", "p_OG", "p_WH_0")}
    p_WH = p_WG + at["p_OH"] - at["p_OG"]
    distance, reach = float(np.linalg.norm(p_WH - at["p_WH_0"])), float(person["arm_reach"])
    if distance > reach:
        place = ", ".join(f"{x:g}" for x in p_WG)
        text = f"the hand would be {distance:.2f} m from where it rests, and can be {reach:g} m from it"
        text += "; move the place towards person.p_WH_0, or raise person.arm_reach"
        raise InvalidParameter([f"p_WG_handover: [{place}] m is out of the person's reach: {text}"])


def idle_values(system: System, given: Sequence[str]) -> list[str]:
    """Return which values were given, as `UNIT.NAME`, that have no effect.

    These are gains of impedance controllers whose behaviour has gains of its own, and joints and links of robots that
    have none.
    """
    units = {name: system.units[name.partition(".")[0]] for name in given if "." in name}
    return [
        f"{name} has no effect unless {unit.name}.{needed}"
        for name, unit in units.items()
        if (needed := _needed_by(name.partition(".")[2], unit))
    ]


def _needed_by(parameter: str, unit: PlacedUnit) -> str:
    """Return what a unit's parameter needs to have an effect, "" where it has one."""
    behaviour = str(unit.start.get("behaviour", "")).lower()
    if parameter in _CUSTOM_GAINS and behaviour not in ("custom", str(int(Gains.CUSTOM))):
        return "behaviour=custom"
    if parameter in _OF_JOINTS and unit.description.name == _ROBOT and not unit.start.get("joints", 0):
        return "joints is 1 or more"
    return ""


def undriven_joints(system: System) -> list[str]:
    """Return what is wrong with joints that are free to move and that nothing drives, and with drives of no joints."""
    jointless = [
        f"{name} ({unit.description.name}) drives an arm's joints, and the robot here has none; flyer_arm_impedance "
        "has a robot with joints"
        for name, unit in system.units.items()
        if "q_J" in unit.description.inputs and "q_J" not in system.fed_inputs(name)
    ]
    return jointless + [
        f"{name}.joints: nothing drives an arm's joints here; expected {name}.joints=0, or {name}.tolerance_J=0, which "
        "fixes them; the controller of flyer_arm_impedance drives joints"
        for name, unit in system.units.items()
        if unit.description.name == _ROBOT
        and unit.start.get("joints", 0) > 0
        and unit.start.get("tolerance_J", 1.0) > 0.0
        and unit.start.get("lock_time", 1.0) > 0.0
        and "tau_J" not in system.fed_inputs(name)
    ]


def common_period(controllers: Sequence[PlacedUnit]) -> Fraction | None:
    """Return the period, s, that controllers of another rate than the robot's own share, for its plants to step by.

    A plant that stepped by its own would take their commands late, by a time that drifts from 0 to a step. None where
    the controllers run at `PERIOD`, which the plants propose, too, or at several rates.
    """
    periods = {c.period for c in controllers if c.sampled}
    return None if len(periods) != 1 or periods == {PERIOD} else periods.pop()


def decision_settings(p: HandoverParameters) -> dict[str, Any]:
    """Return the parameters of the unit that decides, as far as they follow from the scenario's."""
    return {"behaviour": p.behaviour.item, "p_BG": p.model.p_BG}


def note_own_limits(s: System, controller: PlacedUnit, propulsion: Propulsion) -> None:
    """Note that a controller clips its own commands where the thrusters have no limits."""
    name = controller.name
    if propulsion is Propulsion.IDEAL and "f_max" in controller.description.parameters:
        s.notes.append(
            f"{name} ({controller.description.name}) clips its own commands at {name}.f_max and {name}.tau_max, which "
            f"propulsion=ideal does not lift; -p {name}.f_max=1000,1000,1000 -p {name}.tau_max=1000,1000,1000 does"
        )


def add_controllers(s: System, fmu: FmuOf, p: HandoverParameters, suffix: str = "") -> None:
    """Add a robot's impedance and pose control, under names that end in its suffix."""
    known: dict[str, Any] = {
        **vars(p.model),
        "delay": p.delay + p.navigation_delay,
        "lag": expected_lag(p.propulsion),
    }
    impedance = s.add(f"impedance{suffix}", fmu(f"impedance{suffix}"), behaviour=p.behaviour.item, **known)
    note_own_limits(s, impedance, p.propulsion)
    s.add(f"pose{suffix}", fmu(f"pose{suffix}"), **known)


def add_robot(
    s: System,
    fmu: FmuOf,
    p: HandoverParameters,
    p_WG_0: Floats,
    *,
    period: Fraction | None,
    seed: int,
    suffix: str = "",
) -> None:
    """Add a robot, its gripper at p_WG_0, m in W, its thrusters and its navigation, whose noise has the seed."""
    settings = thruster_settings(p.propulsion, p.stuck_nozzle)
    s.add(f"thrusters{suffix}", fmu(f"thrusters{suffix}"), period=period, **settings)
    robot = p.robot
    s.add(f"robot{suffix}", fmu(f"robot{suffix}"), period=period, **vars(robot), p_WB_0=p_WG_0 - robot.p_BG)
    navigation = f"navigation{suffix}"
    s.add(navigation, fmu(navigation), period=period, seed=seed)


def wire_navigation(s: System, robot: PlacedUnit, navigation: PlacedUnit) -> None:
    """Connect the robot's pose and velocities to the unit that estimates them."""
    for name in _TRUE:
        s.connect(getattr(robot.y, name), getattr(navigation.u, name))


def wire_controller(
    s: System, controller: PlacedUnit, navigation: PlacedUnit, thrusters: PlacedUnit, kind: str = ""
) -> None:
    """Connect the estimate of the robot's state to a controller, and the controller to the thrusters.

    `kind` is the name by which the thrusters know it, where that is not its own.
    """
    wire_estimate(s, navigation, controller)
    for what in ("f", "tau"):
        s.connect(getattr(controller.y, f"{what}_cmd"), getattr(thrusters.u, f"{what}_{kind or controller.name}"))


def wire_estimate(s: System, navigation: PlacedUnit, observer: PlacedUnit, suffix: str = "") -> None:
    """Connect the estimate of the robot's state to a unit, to inputs whose names may end in a robot's suffix."""
    for name in _MEASURED:
        s.connect(getattr(navigation.y, name), getattr(observer.u, name + suffix))


def wire_forces(s: System, robot: PlacedUnit, thrusters: PlacedUnit, external: PlacedUnit, suffix: str = "") -> None:
    """Connect the thrust to the robot, and an external wrench, of a suffix, to its gripper."""
    for name in ("f_B", "tau_B"):
        s.connect(getattr(thrusters.y, name), getattr(robot.u, name))
    for name in ("f_G", "tau_G"):
        s.connect(getattr(external.y, name + suffix), getattr(robot.u, name))


def wired_push(
    fmu: FmuOf, p: ImpedanceParameters, seed: int, controller: Mapping[str, Any], robot: Mapping[str, Any]
) -> System:
    """Return a system of robot, thrusters, navigation, impedance controller and push.

    Args:
        fmu: gives the units' FMUs.
        p: the scenario's parameters.
        seed: of the navigation's noise.
        controller: parameters of the controller, and its goal, besides what it knows of delays.
        robot: parameters of the robot.
    """
    is_force, s = p.kind is Wrench.FORCE, System()
    lateness: dict[str, Any] = {
        "delay": p.delay + p.navigation_delay if p.delay_known else 0.0,
        "lag": expected_lag(p.propulsion),
    }
    impedance = s.add("impedance", fmu("impedance"), **lateness, **controller, active=True)
    thrusters = s.add("thrusters", fmu("thrusters"), **thruster_settings(p.propulsion, p.stuck_nozzle))
    pushed: dict[str, Any] = {"force": p.force if is_force else 0.0, "torque": 0.0 if is_force else p.torque}
    note_own_limits(s, impedance, p.propulsion)
    push = s.add("push", fmu("push"), axis=p.axis.name.lower(), **pushed)
    body = s.add("robot", fmu("robot"), **robot)
    navigation = s.add("navigation", fmu("navigation"), seed=seed)
    wire_controller(s, impedance, navigation, thrusters)
    wire_navigation(s, body, navigation)
    wire_forces(s, body, thrusters, push)
    return s


def wire_handover(s: System, suffix: str = "") -> None:
    """Wire all units of a handover that were added under the names of `FlyerHandover.units`.

    Of two robots the names of each end in its suffix, and so do those of its ports at `decision` and `person`.
    """
    robot, thrusters, navigation = (s.units[n + suffix] for n in ("robot", "thrusters", "navigation"))
    person, decision = (s.units[n] for n in ("person", "decision"))
    wire_forces(s, robot, thrusters, person, suffix)
    wire_navigation(s, robot, navigation)
    wire_estimate(s, navigation, decision, suffix)
    s.connect(getattr(person.y, f"gripper_angle{suffix}"), getattr(decision.u, f"gripper_angle{suffix}"))
    for name in ("impedance", "pose"):
        controller = s.units[name + suffix]
        wire_controller(s, controller, navigation, thrusters, name)
        s.connect(getattr(decision.y, name + suffix), controller.u.active)
        for goal in ("p_WG_goal", "q_WG_goal"):
            s.connect(getattr(decision.y, goal + suffix), getattr(controller.u, goal))
    for name in _SEEN:
        s.connect(getattr(robot.y, name), getattr(person.u, name + suffix))
    for name in ("closure", "light"):
        s.connect(getattr(decision.y, name + suffix), getattr(person.u, name + suffix))


_SLOWEST_MODE = {"pose": "the slowest mode, the integrator's"}
_POLES = ("pole_radius", "damping_ratio", "pole_frequency")


def stability_metrics(signals: Signals, controllers: Sequence[str]) -> dict[str, Metric]:
    """Return the outermost pole's margin and decay, and the least damping ratio, of each controller's closed loop.

    A controller that does not give them has none.
    """
    metrics: dict[str, Metric] = {}
    for name in controllers:
        if not all(f"{name}.{what}" in signals for what in _POLES):
            continue
        radius, damping, frequency = (float(signals[f"{name}.{what}"]) for what in _POLES)
        text = f"{name} control, by its own model"
        metrics[f"pole_margin_{name}"] = Metric(
            1.0 - radius, "1", f"outermost pole to unit circle, 1 - |z|, above 0 if stable: {text}"
        )
        if f"{name}.slowest_decay" in signals:
            slowest = float(signals[f"{name}.slowest_decay"])
            mode = _SLOWEST_MODE.get(name, "the slowest mode")
            metrics[f"slowest_decay_{name}"] = Metric(slowest, "s", f"time constant of {mode}: {text}")
        metrics[f"damping_ratio_{name}"] = Metric(damping, "1", f"least damping ratio: {text}")
        metrics[f"frequency_{name}"] = Metric(frequency, "rad/s", f"frequency of the least damped poles: {text}")
    return metrics
