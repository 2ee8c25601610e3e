"""Wiring that the free-flyer's scenarios share: the robot, its thrusters, its navigation, and controllers.

Also the metrics of the controllers' closed loops, which they compute by their own models at the start.
"""

import math
from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import numpy as np

from handover.controllers.free_flyer.ports import PERIOD
from handover.cosim.system.signals import Signals
from handover.cosim.system.system import PlacedUnit, System
from handover.scenarios.experiment.experiment import Metric
from handover.scenarios.experiment.paper import paper_values
from handover.scenarios.experiment.parameters import InvalidParameter
from handover.scenarios.free_flyer.parameters import Propulsion

_TRUE = ("p_WB", "q_WB", "v_WB", "w_WB")
_MEASURED = ("p_WB_meas", "q_WB_meas", "v_WB_meas", "w_WB_meas")
_SEEN = ("p_WG", "q_WG", "v_WG", "w_WB")


def expected_lag(propulsion: Propulsion) -> float:
    """Return the lag of the thrusters that the controllers assume, s.

    Of nozzles it is that of their flappers: thrust follows a flapper's angle at once, and as its sine rather than in
    proportion, so that a step of the command lags by 0.8 to 1.2 of it. Impellers stay at their speed.
    """
    if propulsion is Propulsion.IDEAL:
        return 0.0
    values = paper_values("free_flyer", "thrusters")
    return float(values["flapper_lag" if propulsion is Propulsion.NOZZLES else "lag"])


def thruster_settings(propulsion: Propulsion, delay: float, stuck_nozzle: int) -> dict[str, Any]:
    """Return the parameters of the thrusters' unit.

    Raises:
        InvalidParameter: a nozzle is stuck of thrusters that have none.
    """
    settings: dict[str, Any] = {"propulsion": propulsion.item, "delay": delay}
    if stuck_nozzle == 0:
        return settings
    if propulsion is not Propulsion.NOZZLES:
        text = f"propulsion {propulsion.item} has no nozzle that could be; set propulsion nozzles, or 0"
        raise InvalidParameter([f"stuck_nozzle: {stuck_nozzle} is to be stuck, and {text}"])
    opens = np.ones(12)
    opens[stuck_nozzle - 1] = 0.0
    return settings | {"flapper_range": opens}


def common_period(controllers: Sequence[PlacedUnit]) -> Fraction | None:
    """Return the period, s, that controllers of another rate than the robot's own share, for its plants to step by.

    A plant that stepped by its own would take their commands late, by a time that drifts from 0 to a step. None where
    the controllers run at `PERIOD`, which the plants propose, too, or at several rates.
    """
    periods = {c.period for c in controllers if c.sampled}
    return None if len(periods) != 1 or periods == {PERIOD} else periods.pop()


def wire_navigation(s: System, robot: PlacedUnit, navigation: PlacedUnit) -> None:
    """Connect the robot's pose and velocities to the unit that estimates them."""
    for name in _TRUE:
        s.connect(getattr(robot.y, name), getattr(navigation.u, name))


def wire_controller(s: System, controller: PlacedUnit, navigation: PlacedUnit, thrusters: PlacedUnit) -> None:
    """Connect the estimate of the robot's state to a controller, and the controller to the thrusters."""
    wire_estimate(s, navigation, controller)
    for what in ("f", "tau"):
        s.connect(getattr(controller.y, f"{what}_cmd"), getattr(thrusters.u, f"{what}_{controller.name}"))


def wire_estimate(s: System, navigation: PlacedUnit, observer: PlacedUnit) -> None:
    """Connect the estimate of the robot's state to a unit."""
    for name in _MEASURED:
        s.connect(getattr(navigation.y, name), getattr(observer.u, name))


def wire_forces(s: System, robot: PlacedUnit, thrusters: PlacedUnit, external: PlacedUnit) -> None:
    """Connect the thrust to the robot, and an external wrench to its gripper."""
    for name in ("f_B", "tau_B"):
        s.connect(getattr(thrusters.y, name), getattr(robot.u, name))
    for name in ("f_G", "tau_G"):
        s.connect(getattr(external.y, name), getattr(robot.u, name))


def wire_handover(s: System) -> None:
    """Wire all units of a handover that were added under the names of `FlyerHandover.units`."""
    robot, thrusters, person = (s.units[n] for n in ("robot", "thrusters", "person"))
    navigation, decision = (s.units[n] for n in ("navigation", "decision"))
    wire_forces(s, robot, thrusters, person)
    wire_navigation(s, robot, navigation)
    wire_estimate(s, navigation, decision)
    s.connect(person.y.gripper_angle, decision.u.gripper_angle)
    for name in ("impedance", "pose"):
        controller = s.units[name]
        wire_controller(s, controller, navigation, thrusters)
        s.connect(getattr(decision.y, name), controller.u.active)
        for goal in ("p_WG_goal", "q_WG_goal"):
            s.connect(getattr(decision.y, goal), getattr(controller.u, goal))
    for name in _SEEN:
        s.connect(getattr(robot.y, name), getattr(person.u, name))
    for name in ("closure", "light"):
        s.connect(getattr(decision.y, name), getattr(person.u, name))


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
        slowest = -PERIOD / math.log(radius) if 0.0 < radius < 1.0 else math.inf
        metrics[f"slowest_decay_{name}"] = Metric(
            slowest, "s", f"time constant of {_SLOWEST_MODE.get(name, 'the slowest mode')}: {text}"
        )
        metrics[f"damping_ratio_{name}"] = Metric(damping, "1", f"least damping ratio: {text}")
        metrics[f"frequency_{name}"] = Metric(frequency, "rad/s", f"frequency of the least damped poles: {text}")
    return metrics
