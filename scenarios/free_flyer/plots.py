"""What the report draws of a handover in microgravity over time.

What the report draws of a push over time.

What the report draws over time of the wrench that is commanded and of the one that the thrusters give.
"""

from collections.abc import Sequence

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.cosim.record.reader import Record
from handover.scenarios.experiment.paper import paper_values
from handover.scenarios.experiment.time_plot import Curve, Level, TimePlot
from handover.scenarios.free_flyer.impedance_evaluation import MOTION_SIGNALS, Motion, errors_of
from handover.scenarios.free_flyer.parameters import HandoverParameters, ImpedanceParameters, Wrench

BEYOND = 2.0
"""How far plots reach beyond what the thrusters give at most: a command may be twenty times as much."""

QUANTITIES = (("f", "Force", "N"), ("tau", "Torque", "N·m"))


def commanded_wrench(record: Record, controllers: Sequence[str], what: str) -> Floats:
    """Return the sum of commands, as the thrusters take it, in B, shape (rows, 3); `what` is `f` or `tau`."""
    return np.sum([record[f"{name}.{what}_cmd"] for name in controllers], axis=0)


def plot_thrust(record: Record, controllers: Sequence[str], phases: str = "") -> list[TimePlot]:
    """Return force and torque on the robot in B; commands far beyond what the thrusters give are left out."""
    plots: list[TimePlot] = []
    for what, name, unit in QUANTITIES:
        given, commanded = record[f"thrusters.{what}_B"], commanded_wrench(record, controllers, what)
        limit = BEYOND * float(np.abs(given).max(initial=0.0))
        if limit > 0.0:
            commanded = np.where(np.abs(commanded) <= limit, commanded, np.nan)
        curves: list[Curve] = []
        for i, axis in enumerate("xyz"):
            curves.append(Curve(label=f"{axis}, given", values=given[:, i], group=axis))
            told = f"{axis}, commanded"
            curves.append(Curve(label=told, values=commanded[:, i], held=True, faint=True, group=axis))
        title = f"{name} of the thrusters in B"
        plots.append(TimePlot(title=title, quantity=name.lower(), unit=unit, curves=curves, phases=phases))
    return plots


_PHASES = "decision.phase"
_TOUCHES = {"HAND": "a pull", "GRIPPER": "a push"}


def plot_handover(parameters: HandoverParameters, record: Record, receivers: Sequence[str]) -> list[TimePlot]:
    """Return the gripper's place, speed and angle, who holds the object, and thrust."""
    published = paper_values("free_flyer", "published")
    return [
        _place(record),
        _speed(parameters, record, receivers),
        TimePlot(
            title="Angle of the gripper",
            quantity="angle",
            unit="°",
            phases=_PHASES,
            curves=(Curve(label="angle", values=np.degrees(record["person.gripper_angle"])),),
            levels=(Level(label="counts as full", value=float(np.degrees(published["angle_threshold"]))),),
        ),
        TimePlot(
            title="Forces, and who holds the object",
            quantity="force",
            unit="N",
            phases="person.holder",
            curves=(
                Curve(label="on the gripper", values=np.linalg.norm(record["person.f_G"], axis=1)),
                Curve(label="on the hand", values=np.linalg.norm(record["person.f_H"], axis=1)),
            ),
        ),
        *plot_thrust(record, ("impedance", "pose"), _PHASES),
    ]


def _place(record: Record) -> TimePlot:
    p_WG, p_WG_goal = 1000 * record["robot.p_WG"], 1000 * record["decision.p_WG_goal"]
    curves: list[Curve] = []
    for i, axis in enumerate("xyz"):
        curves.append(Curve(label=f"{axis}, gripper", values=p_WG[:, i], group=axis))
        curves.append(Curve(label=f"{axis}, its goal", values=p_WG_goal[:, i], held=True, faint=True, group=axis))
    return TimePlot(
        title="The gripper and its goal in W", quantity="position", unit="mm", curves=curves, phases=_PHASES
    )


def _speed(parameters: HandoverParameters, record: Record, receivers: Sequence[str]) -> TimePlot:
    published = paper_values("free_flyer", "published")
    levels = [
        Level(
            label=f"counts as {_TOUCHES[receiver]}",
            value=published[f"velocity_{receiver.lower()}"][parameters.behaviour],
        )
        for receiver in dict.fromkeys(receivers)
    ]
    curves = (
        Curve(label="as the robot sees it", values=record["decision.speed_G"]),
        Curve(label="true", values=np.linalg.norm(record["robot.v_WG"], axis=1), faint=True),
    )
    return TimePlot(
        title="Speed of the gripper", quantity="speed", unit="m/s", curves=curves, levels=levels, phases=_PHASES
    )


def plot_push(parameters: ImpedanceParameters, record: Record) -> list[TimePlot]:
    """Return errors beside those that the model calls for, the push, and thrust; nothing of a single instant."""
    if len(record.time) < 2:
        return []
    motion = Motion(record.time, *(record[name] for name in MOTION_SIGNALS))
    p_WG_goal = np.array(paper_values("free_flyer", "push_place")["p_WG_goal"])
    errors = errors_of(motion, p_WG_goal, parameters.behaviour)
    turned, turned_model = errors.without_jumps
    return [
        _error("Error of the gripper's position, rest minus actual", "mm", 1000 * errors.p, 1000 * errors.p_model),
        _error("Error of its orientation, rest minus actual", "°", np.degrees(turned), np.degrees(turned_model)),
        _push(parameters, record),
        *plot_thrust(record, ("impedance",)),
    ]


def _error(title: str, unit: str, actual: Floats, calculated: Floats) -> TimePlot:
    curves: list[Curve] = []
    for i, axis in enumerate("xyz"):
        curves.append(Curve(label=f"{axis}, actual", values=_to_the_end(actual[:, i]), group=axis))
        told = f"{axis}, by the model"
        curves.append(Curve(label=told, values=_to_the_end(calculated[:, i]), faint=True, group=axis))
    return TimePlot(title=title, quantity="error", unit=unit, curves=curves)


def _to_the_end(values: Floats) -> Floats:
    """Return values of the beginnings of steps with one more, unknown, for the end of the last step."""
    return np.append(values, np.nan)


def _push(parameters: ImpedanceParameters, record: Record) -> TimePlot:
    signal, quantity, unit = (
        ("push.f_G", "force", "N") if parameters.kind is Wrench.FORCE else ("push.tau_G", "torque", "N·m")
    )
    values = record[signal]
    curves = [Curve(label=axis, values=values[:, i], held=True) for i, axis in enumerate("xyz")]
    return TimePlot(title=f"The push: {quantity} on the gripper in W", quantity=quantity, unit=unit, curves=curves)
