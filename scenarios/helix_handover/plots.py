"""What the report draws of a Helix handover over time."""

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.cosim.record.reader import Record
from handover.scenarios.experiment.time_plot import Curve, Level, TimePlot
from handover.scenarios.helix_handover.parameters import Parameters

_PHASES = "servo.phase"
_FOLLOWED = (("gripper", "arm.p_WG", "servo.p_WG_est"), ("ball", "hand.p_WO", "servo.p_WO_est"))
"""What is followed, where it is in truth, and where the controller has it."""


def plot_handover(parameters: Parameters, record: Record) -> list[TimePlot]:
    """Return distance to the goal, positions true and estimated, tendons, and the gripper."""
    return [
        _distance(parameters, record),
        *(_position(record, axis) for axis in range(3)),
        _tendons("Commanded tendon lengths, since calibration", "change", "mm", 1000 * record["servo.dl_t"], held=True),
        _tendons("Tendon forces", "force", "N", record["arm.tension"], held=False),
        TimePlot(
            title="Gripper",
            quantity="closure, from 0 to 1",
            unit="",
            phases=_PHASES,
            curves=(
                Curve(label="commanded", values=record["servo.closure"], held=True),
                Curve(label="as it is", values=record["arm.grip"]),
            ),
        ),
    ]


def gripper_to_ball(record: Record) -> Floats:
    """Return the true distance between gripper and ball over time, m."""
    return np.linalg.norm(record["arm.p_WG"] - record["hand.p_WO"], axis=1)


def known(record: Record, values: Floats) -> Floats:
    """Return what the controller holds, not a number before it has seen ball and arm, when it means nothing."""
    return np.where(record[_PHASES] > 0, values, np.nan)


def tendon_name(k: int) -> str:
    """Return what the k-th tendon is called, from 0."""
    return f"segment {k // 3 + 1}, {120 * (k % 3)}°"


def _distance(parameters: Parameters, record: Record) -> TimePlot:
    return TimePlot(
        title="Distance to the goal",
        quantity="distance",
        unit="mm",
        phases=_PHASES,
        curves=(
            Curve(
                label="gripper to its goal, as the controller sees it",
                values=known(record, 1000 * record["servo.error"]),
                held=True,
            ),
            Curve(label="gripper to ball, true", values=1000 * gripper_to_ball(record), faint=True),
        ),
        levels=(
            Level(label="descends", value=1000 * parameters.threshold),
            Level(label="grasps", value=1000 * parameters.settings["threshold_grasp"]),
        ),
    )


def _position(record: Record, axis: int) -> TimePlot:
    curves: list[Curve] = []
    for what, true, estimated in _FOLLOWED:
        values = known(record, 1000 * record[estimated][:, axis])
        curves.append(Curve(label=f"{what}, estimated", values=values, held=True, group=what))
        curves.append(Curve(label=f"{what}, true", values=1000 * record[true][:, axis], faint=True, group=what))
    name = "xyz"[axis]
    return TimePlot(
        title=f"Gripper and ball along {name} of W",
        quantity=name,
        unit="mm",
        curves=curves,
        phases=_PHASES,
    )


def _tendons(title: str, quantity: str, unit: str, values: Floats, *, held: bool) -> TimePlot:
    curves = [Curve(label=tendon_name(k), values=values[:, k], held=held) for k in range(values.shape[1])]
    return TimePlot(title=title, quantity=quantity, unit=unit, curves=curves, phases=_PHASES)
