"""Points measured on the VSL arm's own FMU, to learn its kinematics from. [Gandarias2020] sec. IV-A, eq. (9)."""

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from handover.controllers.vsl.kinematics import VslKinematics
from handover.controllers.vsl.learned_model import Integers
from handover.cosim.blocks.ports import Floats
from handover.cosim.blocks.variable import Kind
from handover.cosim.exceptions import InitializationError, InvalidFmu, UnitFailure
from handover.cosim.files import scratch_folder
from handover.cosim.fmu.file.description import FmuDescription, FmuPort, describe_fmu
from handover.cosim.fmu.file.fmpy_edge import unpack
from handover.cosim.fmu.instance import Instance

SPLIT = (0.70, 0.15, 0.15)
"""Shares of training, validation and test points. [Gandarias2020] sec. IV-B"""

RADII = (0.22, 0.42)
"""Distances of the wanted tip from J1's axis, m: the published paths with 2 cm around them (assumed)."""

HEIGHTS = (0.03, 0.37)
"""Heights of the wanted tip, m (assumed)."""

MAX_THETA_1 = 0.5
"""Largest angle of J1 either way, rad (assumed)."""

SAG = 0.075
"""Maximum height of the commanded above the wanted tip, m, at the largest radius, where the arm sags about as much."""

STRETCH = 0.44
"""Greatest distance from the shoulder to which tips are commanded and kept, m."""

_SINGULAR, _FOLDED = 0.01, 0.001
"""Metres within the outer limit of rigid links' reach, beyond which they are singular, and beyond the inner one."""

LEAST_SPAN = 0.05
"""Width of the ring about the shoulder in which points can be measured, m, that is worth it (assumed)."""

PRESSURES = (3e4, 2.2e5)
"""Pressures of each link, Pa; the published ones are 0.5e5 to 2e5."""

LOADS = (0.0, 0.13)
"""Loads at the gripper, kg; the published ones are 0 to 0.1."""

_STEP, _STEPS, _KEPT = 0.1, 15, 5
"""Each point: steps of 0.1 s until settled; the mean of the readings after the last ones is kept (assumed)."""

_QUANTITIES = ("angles", "pressures", "load")
"""What is varied from point to point."""

_WANTED = {
    "input": {"q_cmd": (3,), "p_cmd": (2,), "load": ()},
    "output": {"q_meas": (3,), "i_meas": (3,), "p_meas": (2,), "p_WG_meas": (3,)},
}


@dataclass(frozen=True)
class Dataset:
    """The matrix D of eq. (9), a row for each point, and the commanded angles.

    Attributes:
        p_WG: tip by the tracker, shape (n, 3), m.
        p: pressures, shape (n, 2), Pa.
        i: currents, shape (n, 3), A.
        q: angles by the encoders, shape (n, 3), rad.
        q_cmd: commanded angles, shape (n, 3), rad.
    """

    p_WG: Floats
    p: Floats
    i: Floats
    q: Floats
    q_cmd: Floats

    def __len__(self) -> int:
        return len(self.q)

    def rows(self, indices: Any) -> "Dataset":
        """Return some of the points."""
        return Dataset(self.p_WG[indices], self.p[indices], self.i[indices], self.q[indices], self.q_cmd[indices])

    def without_friction(self, directions: Floats, friction: Sequence[float] | Floats) -> "Dataset":
        """Return the points with the friction taken off currents 2 and 3, (2,), A; see `directions_of`."""
        if not np.any(friction):
            return self
        i = np.array(self.i)
        i[:, 1:] -= np.asarray(friction) * directions
        return replace(self, i=i)


@dataclass(frozen=True)
class Measured:
    """Points one after another as they were measured, how they are split, and where they come from.

    Attributes:
        points: all of them.
        order: the place of each in the split, shape (n,): training points first, then validation and test; -1 where the
            tip is too near to the limits of reach.
        origin: plain data: `arm` (name and parameters of its FMU), `links` that commanded it, `seed` and `walk`.
    """

    points: Dataset
    order: Integers
    origin: Mapping[str, Any]

    @property
    def usable(self) -> int:
        """How many points have a place in the split."""
        return int(np.sum(self.order >= 0))

    def parts(self, share: float = 1.0) -> tuple[Integers, Integers, Integers]:
        """Return rows of training, validation and test points; a share of the first two, drawn at random."""
        n = self.usable
        by_place = np.argsort(np.where(self.order < 0, len(self.order), self.order), kind="stable")[:n]
        first, second = round(SPLIT[0] * n), round((SPLIT[0] + SPLIT[1]) * n)
        taken = round(share * first), round(share * (second - first))
        return by_place[: taken[0]], by_place[first : first + taken[1]], by_place[second:]

    def digest(self) -> str:
        """Return a hash of all numbers: equal for equal data."""
        digest = hashlib.sha256()
        for values in (*vars(self.points).values(), self.order.astype(np.float64)):
            digest.update(np.ascontiguousarray(values, dtype="<f8").tobytes())
        return digest.hexdigest()


def is_heavy(load: float) -> bool:
    """Return whether a load at the gripper, kg, is heavier than any that models are trained with."""
    return load > LOADS[1] + 1e-9


def beyond_loads(load: float) -> str:
    """Return that a load, kg, is beyond the training, as the end of a clause; "" if it is not."""
    return f", with {1e3 * load:.0f} g, and was trained up to {1e3 * LOADS[1]:.0f} g" if is_heavy(load) else ""


def describe_arm(fmu: Path) -> FmuDescription:
    """Read the FMU of an arm that can be learned from.

    Raises:
        InvalidFmu: it is invalid, or lacks ports of `VslArm` that are needed.
    """
    d = describe_fmu(fmu)
    faults: list[str] = []
    for role, ports in (("input", d.inputs), ("output", d.outputs)):
        for name, shape in _WANTED[role].items():
            p = ports.get(name)
            if p is None or p.kind is not Kind.REAL or p.shape != shape:
                wanted = f"{role} {name!r} ({'x'.join(map(str, shape)) or 'one'} real)"
                faults.append(f"no {wanted}" if p is None else f"no {wanted}, but {p.signature}")
    if faults:
        raise InvalidFmu(fmu, "not an arm to learn from: it has " + ", ".join(faults))
    return d


def parameters_of(d: FmuDescription, seed: int) -> dict[str, Any]:
    """Return the arm's parameter settings: quasi-static motion and the seed, as far as it has these parameters."""
    wanted: dict[str, Any] = {"motion": "QUASI_STATIC", "seed": seed}
    return {name: value for name, value in wanted.items() if name in d.parameters}


def plain_parameters(d: FmuDescription, given: Mapping[str, Any]) -> dict[str, Any]:
    """Return all parameters of the arm as plain data: those given, and the starts of the others."""
    stated = {n: _start_of(p) for n, p in sorted(d.parameters.items())} | dict(given)
    return {n: v.tolist() if isinstance(v, np.ndarray) else v for n, v in stated.items()}


def _start_of(port: FmuPort) -> Any:
    """Return a parameter's start as JSON has it."""
    if port.kind not in (Kind.REAL, Kind.INTEGER) or port.start is None:
        return port.start
    numbers = [float(n) if port.kind is Kind.REAL else int(n) for n in port.start.split()]
    return numbers if port.shape else numbers[0]


def collect(
    d: FmuDescription,
    kinematics: VslKinematics,
    points: int,
    rng: np.random.Generator,
    parameters: Mapping[str, Any],
    progress: Callable[[float, float], None],
    *,
    walk: bool = False,
) -> Dataset:
    """Measure points of the workspace at random pressures, angles and loads, each after the arm has settled.

    The source varies one of the three from point to point: a walk. Else all are drawn anew, which spreads points
    better.
    The arm is commanded above the wanted tip by a random share of what it may sag, so that measured tips cover the
    wanted places.

    Args:
        d: the arm.
        kinematics: of rigid links, by which it is commanded.
        points: how many.
        rng: random numbers of the points.
        parameters: the arm's parameter settings.
        progress: called with the simulated time and its end, s.
        walk: whether a point differs from the one before in one of the three alone, drawn at random.

    Raises:
        InvalidFmu, InitializationError, UnitFailure: the arm does not load, start or step.
    """
    rows: list[tuple[Floats, Floats]] = []
    with scratch_folder("training") as folder:
        unpack(d.path, folder, d.fmi, d.identifier)
        arm = Instance("arm", d, folder, _WANTED["input"])
        try:
            _start(arm, parameters)
            q_cmd = np.zeros(3)
            for k in range(points):
                drawn = _QUANTITIES if not walk or k == 0 else (_QUANTITIES[rng.integers(len(_QUANTITIES))],)
                if "angles" in drawn:
                    q_cmd = kinematics.inverse(_commanded_tip(kinematics, rng))
                    arm.u["q_cmd"][0][:] = q_cmd
                if "pressures" in drawn:
                    arm.u["p_cmd"][0][:] = rng.uniform(*PRESSURES, size=2)
                if "load" in drawn:
                    arm.u["load"][0][:] = rng.uniform(*LOADS)
                rows.append((_settled(arm, k * _STEPS), q_cmd))
                progress((k + 1) * _STEPS * _STEP, points * _STEPS * _STEP)
            arm.end()
        finally:
            arm.free()
    measured = np.array([m for m, _ in rows])
    p_WG, p, i, q = np.split(measured, [3, 5, 8], axis=1)
    return Dataset(p_WG, p, i, q, np.array([c for _, c in rows]))


def _start(arm: Instance, parameters: Mapping[str, Any]) -> None:
    try:
        arm.set_start(parameters)
        arm.enter_initialization(0.0, None)
        arm.exit_initialization()
    except UnitFailure as e:
        raise InitializationError(e) from e


def _settled(arm: Instance, before: int) -> Floats:
    """Let the arm settle under its inputs; return p_WG_meas, p_meas, i_meas, q_meas, shape (11,), averaged."""
    total = np.zeros(11)
    arm.set_inputs()
    for k in range(_STEPS):
        arm.step((before + k) * _STEP, _STEP)
        if k >= _STEPS - _KEPT:
            arm.get_outputs()
            total += np.concatenate([arm.y[name][0] for name in ("p_WG_meas", "p_meas", "i_meas", "q_meas")])
    return total / _KEPT


def measured_reach(kinematics: VslKinematics) -> tuple[float, float]:
    """Return from which to which distance from the axis, m, points at the shoulder's height can be measured."""
    low, high = stretch_of(kinematics)
    return max(low, RADII[0]), min(high, RADII[1])


def stretch_of(kinematics: VslKinematics) -> tuple[float, float]:
    """Return from which to which distance from the shoulder, m, tips are commanded and kept."""
    inner, outer = kinematics.reach
    return inner + _FOLDED, min(STRETCH, round(outer - _SINGULAR, 9))


def _commanded_tip(kinematics: VslKinematics, rng: np.random.Generator) -> Floats:
    """Return a point to command the tip to, shape (3,), m."""
    while True:
        radius, height, lift = rng.uniform(*RADII), rng.uniform(*HEIGHTS), rng.uniform(0.0, SAG)
        theta_1 = rng.uniform(-MAX_THETA_1, MAX_THETA_1)
        p_WG = np.array([radius * np.cos(theta_1), radius * np.sin(theta_1), height + lift * (radius / RADII[1]) ** 2])
        low, high = stretch_of(kinematics)
        if low <= np.hypot(radius, p_WG[2] - kinematics.L_1) <= high:
            return p_WG
