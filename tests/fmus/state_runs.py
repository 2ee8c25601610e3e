"""Runs of an FMU from its start or from a state, with inputs that depend on nothing but the step's number."""

import functools
from pathlib import Path
from typing import Any

import numpy as np
from fmpy_host import Digests, FmpyHost

from handover.cosim.blocks.variable import Kind
from handover.cosim.fmu.file.description import FmuDescription, FmuPort
from handover.plants.helix.cameras.stereo_camera import Inputs, Outputs, Params, StereoCamera

STEPS = 8
"""Steps before a state is taken, and after."""

HELD = 3
"""Every so many steps, from the first one on, no input is set: what was set before must hold, and be in the state."""


SCENES = 5
"""Pairs of pictures that a unit with eyes is shown, over and over."""

ALIVE = {
    "HybridKinematics": {"i_lag": 0.1},
    "IrReflex": {"move_time": 0.05, "travel_time": 0.05},
    "Push": {"start": 0.15, "duration": 0.2},
    "TrajectoryPlanner": {"settle": 0.1},
    "PickAndPlace": {"settle": 0.1},
    "VacuumGripper": {"reach": 0.1},
}
"""Parameters of units that reject a change of any one alone, or that do nothing for longer than a run takes."""


INTERNAL = ("internal_step", "substep")
"""Parameters that must divide the communication step."""


def run(host: FmpyHost, first: int) -> list[Digests]:
    """Make STEPS steps, beginning with number `first`; return the outputs after each."""
    seen: list[Digests] = []
    step = host.description.step
    assert step is not None
    for k in range(first, first + STEPS):
        if k % HELD:
            host.set(inputs_at(host.description, k))
        host.step(k * step, step)
        seen.append(host.outputs())
    return seen


def run_on(fmu: Path, state: Path, first: int, *, initialising: bool = False) -> list[Digests]:
    """Go on in an instance of its own from a state in a file, one saved in initialisation mode or later."""
    with FmpyHost(fmu) as host:
        host.restore(state.read_bytes())
        if initialising:
            host.leave()
        return [host.outputs(), *run(host, first)]


def inputs_at(d: FmuDescription, k: int) -> dict[str, Any]:
    """Return inputs near their start values: a unit must take them, and its state must depend on them."""
    rng = np.random.default_rng(k)
    return {name: picture(name, k) if p.kind is Kind.BINARY else varied(p, rng) for name, p in d.inputs.items()}


def other_parameters(d: FmuDescription) -> dict[str, Any]:
    """Return parameters that are not the start values, and still a unit's that works."""
    if d.name in ALIVE:
        return ALIVE[d.name]
    changed = {
        name: np.clip(1.001 * _start(p), p.minimum, p.maximum)
        for name, p in d.parameters.items()
        if p.kind is Kind.REAL and not _is_quaternion(p) and p.name not in INTERNAL
    }
    return changed | ({"seed": 7} if "seed" in d.parameters else {})


def varied(port: FmuPort, rng: np.random.Generator) -> Any:
    """Return a value that is near the start value of an input."""
    if port.kind is Kind.BOOLEAN:
        return bool(rng.integers(4) > 0)
    if port.kind is not Kind.REAL:
        return _start(port)
    low, high = port.minimum, port.maximum
    span = 0.02 if low is None or high is None else 0.02 * (high - low)
    moved = np.clip(_start(port) + rng.normal(0.0, span, port.shape), low, high)
    return moved / np.linalg.norm(moved) if _is_quaternion(port) else moved


@functools.cache
def _scenes() -> list[Outputs]:
    """Return what the camera sees of a few scenes."""
    camera, start, shift = StereoCamera(Params()), Inputs(), np.array([0.0, 0.01, 0.01])
    scenes = [Inputs(p_WO=start.p_WO + i * shift, p_WH=start.p_WH + i * shift) for i in range(SCENES)]
    return [camera.outputs(0.0, scene) for scene in scenes]


def picture(side: str, k: int) -> bytes:
    """Return the left or the right one of one of a few pairs of pictures."""
    return getattr(_scenes()[k % SCENES], side).tobytes()


def _start(port: FmuPort) -> Any:
    assert port.start is not None
    return np.array(port.start.split(), dtype=float).reshape(port.shape)


def _is_quaternion(port: FmuPort) -> bool:
    return port.name.startswith("q_") and port.shape == (4,)
