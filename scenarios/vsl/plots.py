"""What the report draws of a run along a path over time."""

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.cosim.record.reader import Record
from handover.scenarios.experiment.time_plot import Curve, Level, TimePlot
from handover.scenarios.vsl.parameters import Parameters

BY_SERVOS = "tip by the servos, links taken as rigid"
_BAR = 1e5  # Pa
_FLAT = 1e-6  # m


def plot_path_run(parameters: Parameters, record: Record, *, hybrid: bool) -> list[TimePlot]:
    """Return the tip's error, its place and the desired one, joints, currents and pressures."""
    off_plane = bool(np.any(np.abs(record["planner.p_WG_goal"][:, 1]) > _FLAT))
    return [
        _error(parameters, record, hybrid=hybrid),
        *(_position(record, axis) for axis in range(3) if axis != 1 or off_plane),
        _joints(record),
        _pressures(record),
        TimePlot(
            title="Servos' currents",
            quantity="current",
            unit="A",
            curves=[Curve(label=f"J{k + 1}", values=record["arm.i_meas"][:, k]) for k in range(3)],
        ),
    ]


def errors(record: Record, *, hybrid: bool) -> dict[str, Floats]:
    """Return distances over time by what they are, m: of the tip from the desired point, of the model from the tip."""
    goal = record["planner.p_WG_goal"]
    found = {
        "tip by the tracker": _apart(record["arm.p_WG_meas"], goal),
        BY_SERVOS: _apart(record["kinematics.p_WG_model"], goal),
    }
    if hybrid:
        found["hybrid forward model, to the true tip"] = _apart(record["kinematics.p_WG_est"], record["arm.p_WG"])
    return found


def _apart(p: Floats, q: Floats) -> Floats:
    return np.linalg.norm(p - q, axis=1)


def _error(parameters: Parameters, record: Record, *, hybrid: bool) -> TimePlot:
    moving = record["planner.moving"]
    curves = [
        Curve(label=label, values=np.where(moving, 1000 * values, np.nan))
        for label, values in errors(record, hybrid=hybrid).items()
    ]
    return TimePlot(
        title="Error of the tip, on the path",
        quantity="error",
        unit="mm",
        curves=curves,
        levels=(Level(label="tolerance for the mean", value=1000 * parameters.tolerance),),
    )


def _position(record: Record, axis: int) -> TimePlot:
    followed = (
        ("desired", "planner.p_WG_goal", True),
        ("tip by the tracker", "arm.p_WG_meas", False),
        (BY_SERVOS, "kinematics.p_WG_model", False),
    )
    curves = [
        Curve(label=label, values=1000 * record[signal][:, axis], held=desired, faint=desired)
        for label, signal, desired in followed
    ]
    name = "xyz"[axis]
    return TimePlot(title=f"Tip along {name} of W", quantity=name, unit="mm", curves=curves)


def _joints(record: Record) -> TimePlot:
    cmd, meas = (np.degrees(record[signal]) for signal in ("kinematics.q_cmd", "arm.q_meas"))
    curves = [c for k in range(3) for c in _both(f"J{k + 1}", cmd[:, k], meas[:, k])]
    return TimePlot(title="Joints", quantity="angle", unit="°", curves=curves)


def _pressures(record: Record) -> TimePlot:
    cmd, meas = (record[signal] / _BAR for signal in ("planner.p_cmd", "arm.p_meas"))
    curves = [c for k in range(2) for c in _both(f"link {k + 2}", cmd[:, k], meas[:, k])]
    return TimePlot(title="Pressures inside the links", quantity="pressure", unit="bar", curves=curves)


def _both(name: str, commanded: Floats, measured: Floats) -> list[Curve]:
    return [
        Curve(label=f"{name}, measured", values=measured, group=name),
        Curve(label=f"{name}, commanded", values=commanded, held=True, faint=True, group=name),
    ]
