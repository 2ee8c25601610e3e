"""What a unit is driven with when it is tried in a foreign host: parameters and inputs near its start values."""

import functools
import zlib
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handover.cosim.blocks.description import Description
from handover.cosim.blocks.variable import Kind, Variable, element_names
from handover.plants.helix.cameras.stereo_camera import Inputs, Params, StereoCamera

STEPS = 10
"""Steps of a run, each as long as the unit proposes."""

CHOSEN: Mapping[str, Mapping[str, Any]] = {
    "TendonArm": {"internal_step": 0.0025},  # a step must be a multiple of it
    "TendonArmFast": {"internal_step": 0.0025},
    "HandoverPartner": {"guide_stiffness": 50.0},
    "TrajectoryPlanner": {"settle": 0.06},
    "PickAndPlace": {"settle": 0.06},
    "HybridKinematics": {"L_1": 0.15, "L_2": 0.225, "L_3": 0.225},  # the model that ships is trained for these
    "Push": {"start": 0.05, "duration": 0.06},
    "LargeObjectAndHands": {"hands": 1},  # of two at most
    "VacuumGripper": {"reach": 0.1},
}
"""Parameters whose values are not near those that they start with, most so that inputs act within the short run."""

CENTRES: Mapping[str, Mapping[str, Any]] = {
    "IrReflex": {"ticks": 400.0},
    "FingerInfrared": {"p_WO": np.array([-0.18, 0.0, -0.12]), "p_WH": np.array([-0.18, 0.0, -0.12])},
}
"""How far inputs lie from start values that say nothing: sensors that see nothing."""

Values = dict[str, Any]


def parameters(d: Description) -> Values:
    """Return a value other than its start for every parameter that can have one."""
    return {v.name: _moved(d.name, v) for v in d.parameters} | dict(CHOSEN.get(d.name, {}))


def inputs(d: Description, k: int) -> Values:
    """Return the inputs that hold during step k."""
    rng = np.random.default_rng([zlib.crc32(d.name.encode()), k])
    return {v.name: _picture(v.name, k) if v.kind is Kind.BINARY else _varied(d.name, v, rng) for v in d.inputs}


def scalars(variables: Mapping[str, Variable], values: Mapping[str, Any]) -> dict[str, Any]:
    """Return values by the names of their scalars, `p_WG[1]` and so on; texts and pictures are left out."""
    made: dict[str, Any] = {}
    for name, value in values.items():
        v = variables[name]
        if v.kind not in (Kind.STRING, Kind.BINARY):
            made |= zip(element_names(v), np.ravel(value).tolist(), strict=True)
    return made


def _moved(unit: str, v: Variable) -> Any:
    share = zlib.crc32(f"{unit}.{v.name}".encode()) / 2**32
    if v.kind is Kind.INTEGER:
        return v.start + 1
    if v.kind is not Kind.REAL:
        return v.start
    if v.name.startswith("q_") and v.shape == (4,):
        return _unit(np.asarray(v.start) + 0.02 * share * np.array([0.0, 1.0, -1.0, 1.0]))
    return _within(v, np.asarray(v.start) * (1.0 + 0.02 * share))  # one factor keeps matrices symmetric


def _varied(unit: str, v: Variable, rng: np.random.Generator) -> Any:
    if v.kind is Kind.REAL:
        span = 0.02 if v.maximum is None or v.minimum is None else 0.02 * (v.maximum - v.minimum)
        moved = np.asarray(v.start) + CENTRES.get(unit, {}).get(v.name, 0.0) + rng.normal(0.0, span, v.shape)
        return _unit(moved) if v.name.startswith("q_") and v.shape == (4,) else _within(v, moved)
    if v.kind is Kind.BOOLEAN:
        return bool(rng.integers(4) > 0)
    return v.start


def _within(v: Variable, value: NDArray[np.float64]) -> Any:
    clipped = np.clip(value, -np.inf if v.minimum is None else v.minimum, np.inf if v.maximum is None else v.maximum)
    return clipped if v.shape else float(clipped)


def _unit(q: NDArray[np.float64]) -> NDArray[np.float64]:
    return q / np.linalg.norm(q)


@functools.cache
def _pictures(k: int) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    camera = StereoCamera(Params(seed=k))
    u = Inputs()
    u.p_WO = np.asarray(u.p_WO) + np.array([0.0, 0.004 * k, 0.002 * k])
    y = camera.outputs(0.0, u)
    return y.left, y.right


def _picture(port: str, k: int) -> NDArray[np.uint8]:
    """Return a true picture of a scene in which the ball is moved a little from step to step."""
    return _pictures(k)[0 if port == "left" else 1]
