"""Learns the residuals of the VSL arm's rigid kinematics from points measured on its FMU. [Gandarias2020] sec. IV."""

import hashlib
import platform
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handover.controllers.vsl.fit import Fit, fit_cubic
from handover.controllers.vsl.kinematics import Elbow, VslKinematics
from handover.controllers.vsl.learned_model import FORWARD_INPUTS, VslModel, inputs_of, rotate_about_z
from handover.controllers.vsl.model_text import model_text
from handover.cosim.blocks.ports import Floats
from handover.cosim.blocks.variable import Kind
from handover.cosim.fmu.description import FmuPort
from handover.scenarios.vsl.training_data import STRETCH, Dataset, collect, describe_arm, parameters_of

SPLIT = (0.70, 0.15, 0.15)
"""Shares of training, validation and test points. [Gandarias2020] sec. IV-B"""

MIN_POINTS = 400
"""Number of points below which the 120 coefficients of a cubic are not worth fitting (assumed)."""

_MIN_VARIATION = 1e-9
"""Range of an input, relative to its magnitude, below which it counts as constant: that much is rounding."""

_MODULE = '''"""The trained model of `HybridKinematics` that ships, as JSON.

Generated; when the sources of the arm (plants/vsl/) have changed, run again

    handover vsl-train --points {points} --seed {seed}{elbow} --out controllers/vsl/default_model.py
"""

DEFAULT_MODEL = """\\
{text}"""
'''


class NothingToLearn(ValueError):
    """Measured points from which no kinematics can be learned: not the expected arm, or its sensors do not work."""

    def __init__(self, fmu: Path, fault: str) -> None:
        super().__init__(f"{fmu}: {fault}")
        self.fmu, self.fault = fmu, fault


@dataclass(frozen=True, kw_only=True)
class Errors:
    """Mean errors of the test points, of rigid kinematics and with what was learned.

    Attributes:
        forward_model_based, forward_hybrid: distance of the tip from where the kinematics take it to be, m.
        inverse_model_based, inverse_hybrid: distance by which the command for the measured tip would miss it, m, by the
            Jacobian.
    """

    forward_model_based: float
    forward_hybrid: float
    inverse_model_based: float
    inverse_hybrid: float


@dataclass(frozen=True, kw_only=True)
class VslTraining:
    """Measures points, splits them, fits both residuals and tests them.

    Attributes:
        fmu: the arm.
        kinematics: of rigid links, to which the learned residuals are added.
        points: how many are measured; those whose tip is too near to the limits of reach are left out.
        seed: of the points, the split and the arm's noise.
    """

    fmu: Path
    kinematics: VslKinematics
    points: int
    seed: int

    def train(self, progress: Callable[[float, float], None]) -> tuple[VslModel, Errors]:
        """Return the model, whose provenance has no date or path, and its errors.

        Raises:
            InvalidFmu, InitializationError, UnitFailure: the arm's FMU is invalid, does not initialize, or fails.
            NothingToLearn: fewer than half of the tips are within reach, or an input is the same at all points.
        """
        d = describe_arm(self.fmu)
        points_seed, arm_seed = (int(n) for n in np.random.SeedSequence(self.seed).generate_state(2) >> 1)
        rng = np.random.default_rng(points_seed)
        parameters = parameters_of(d, arm_seed)
        measured = collect(d, self.kinematics, self.points, rng, parameters, progress)
        usable = self._usable(measured)
        training, validation, test = (usable.rows(indices) for indices in split(len(usable), rng))
        inverse = fit_cubic(*self.inverse_pairs(training), *self.inverse_pairs(validation))
        forward = fit_cubic(*self.forward_pairs(training), *self.forward_pairs(validation))
        model = VslModel(inverse.cubic, forward.cubic, self.kinematics, {})
        errors = self.errors(model, test)
        provenance: dict[str, Any] = {
            "arm": {
                "fmu": d.name,
                "key": content_key(self.fmu),
                "parameters": {n: _start(p) for n, p in sorted(d.parameters.items())} | parameters,
            },
            "seed": self.seed,
            "points": {
                "measured": self.points,
                "training": len(training),
                "validation": len(validation),
                "test": len(test),
            },
            "inverse": _fit_facts(inverse, "rad"),
            "forward": _fit_facts(forward, "m"),
            "mean_test_errors_m": {k: float(f"{v:.4g}") for k, v in vars(errors).items()},
            "versions": {"python": platform.python_version(), "numpy": np.__version__},
        }
        return VslModel(inverse.cubic, forward.cubic, self.kinematics, provenance), errors

    def inverse_pairs(self, data: Dataset) -> tuple[Floats, Floats]:
        """Return inputs, the rigid angles of the measured tips first, and commanded minus rigid angles, rad.

        The *measured* angles in place of the commanded ones would leave the servos' droop in.
        """
        q_rigid = np.array([self.kinematics.inverse(p) for p in data.p_WG])
        return inputs_of(q_rigid, data.p, data.i), data.q_cmd - q_rigid

    def forward_pairs(self, data: Dataset) -> tuple[Floats, Floats]:
        """Return inputs, the measured angles first, and measured minus rigid tips in the arm's plane, m."""
        rigid = np.array([self.kinematics.forward(q) for q in data.q])
        residuals = [
            rotate_about_z(r, -theta_1) for r, theta_1 in zip(data.p_WG - rigid, data.q[:, 0].tolist(), strict=True)
        ]
        return inputs_of(data.q, data.p, data.i), np.array(residuals)

    def errors(self, model: VslModel, test: Dataset) -> Errors:
        """Return the errors of points that were not trained on."""
        rigid = np.array([self.kinematics.forward(q) for q in test.q])
        tips = np.array([model.tip(*point) for point in zip(test.q, test.p, test.i, strict=True)])
        inputs, residuals = self.inverse_pairs(test)
        return Errors(
            forward_model_based=_mean_length(test.p_WG - rigid),
            forward_hybrid=_mean_length(test.p_WG - tips),
            inverse_model_based=_mean_length(self._moved(inputs, residuals)),
            inverse_hybrid=_mean_length(self._moved(inputs, residuals - model.inverse.predict(inputs))),
        )

    def _moved(self, inputs: Floats, angles: Floats) -> Floats:
        """Return the displacements of the tip by small joint rotations, shape (n, 3), m, by the Jacobian."""
        jacobians = [self.kinematics.jacobian(q) for q in inputs[:, :3]]
        return np.array([J @ dq for J, dq in zip(jacobians, angles, strict=True)])

    def _usable(self, measured: Dataset) -> Dataset:
        usable = measured.rows(self._within_reach(measured.p_WG))
        if len(usable) < len(measured) / 2:
            k = self.kinematics
            raise NothingToLearn(
                self.fmu,
                f"{len(usable)} of {len(measured)} measured tips are where links of {k.L_2:g} and {k.L_3:g} m on a "
                f"shoulder {k.L_1:g} m high can be; half of them should be",
            )
        x = inputs_of(usable.q, usable.p, usable.i)
        constant = np.ptp(x, axis=0) <= _MIN_VARIATION * np.max(np.abs(x), axis=0)
        if np.any(constant):
            names = ", ".join(name for name, c in zip(FORWARD_INPUTS, constant, strict=True) if c)
            raise NothingToLearn(self.fmu, f"the same at all points, whatever is commanded: {names}")
        return usable

    def _within_reach(self, p_WG: Floats) -> NDArray[np.bool_]:
        min_reach, _ = self.kinematics.reach
        from_shoulder = _lengths(p_WG - np.array([0.0, 0.0, self.kinematics.L_1]))
        return (from_shoulder <= STRETCH) & (from_shoulder >= min_reach + 0.001)


def split(points: int, rng: np.random.Generator) -> tuple[Any, Any, Any]:
    """Return indices of training, validation and test points, drawn at random."""
    order = rng.permutation(points)
    first, second = round(SPLIT[0] * points), round((SPLIT[0] + SPLIT[1]) * points)
    return order[:first], order[first:second], order[second:]


def content_key(fmu: Path) -> str:
    """Return a hash that changes if the sources of the arm do: those in `plants` that its FMU carries.

    Changes of engine and builder leave it as it is. Of an FMU without such sources it is the hash of all bytes.
    """
    digest = hashlib.sha256()
    with zipfile.ZipFile(fmu) as archive:
        names = [n for n in archive.namelist() if n.startswith("resources/sources/handover/plants/")]
        for name in sorted(names):
            content = archive.read(name)
            digest.update(f"{name}\0{len(content)}\0".encode() + content)
    if not names:
        digest.update(fmu.read_bytes())
    return digest.hexdigest()


def file_text(model: VslModel, path: Path) -> str:
    """Return the content of a model's file: a Python module if its name ends in .py, else JSON."""
    text = model_text(model)
    if path.suffix != ".py":
        return text
    provenance = model.provenance
    elbow = "" if model.kinematics.elbow is Elbow.UP else " --elbow down"
    return _MODULE.format(points=provenance["points"]["measured"], seed=provenance["seed"], elbow=elbow, text=text)


def _fit_facts(fit: Fit, unit: str) -> dict[str, float]:
    return {"penalty": fit.penalty, f"validation_rms_{unit}": float(f"{fit.validation_rms:.4g}")}


def _start(port: FmuPort) -> Any:
    """Return a parameter's default as JSON has it."""
    if port.kind not in (Kind.REAL, Kind.INTEGER) or port.start is None:
        return port.start
    numbers = [float(n) if port.kind is Kind.REAL else int(n) for n in port.start.split()]
    return numbers if port.shape else numbers[0]


def _lengths(vectors: Floats) -> Floats:
    return np.sqrt(np.sum(vectors**2, axis=1))


def _mean_length(vectors: Floats) -> float:
    return float(np.mean(_lengths(vectors)))
