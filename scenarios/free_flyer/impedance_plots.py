"""What the report draws of a push over time."""

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.cosim.record.reader import Record
from handover.scenarios.experiment.paper import paper_values
from handover.scenarios.experiment.time_plot import Curve, TimePlot
from handover.scenarios.free_flyer.impedance_model import MOTION_SIGNALS, Motion, errors_of
from handover.scenarios.free_flyer.impedance_parameters import Parameters, Wrench
from handover.scenarios.free_flyer.thrust_plots import plot_thrust


def plot_push(parameters: Parameters, record: Record) -> list[TimePlot]:
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


def _push(parameters: Parameters, record: Record) -> TimePlot:
    signal, quantity, unit = (
        ("push.f_G", "force", "N") if parameters.kind is Wrench.FORCE else ("push.tau_G", "torque", "N·m")
    )
    values = record[signal]
    curves = [Curve(label=axis, values=values[:, i], held=True) for i, axis in enumerate("xyz")]
    return TimePlot(title=f"The push: {quantity} on the gripper in W", quantity=quantity, unit=unit, curves=curves)
