"""Learns the residuals of the VSL arm's rigid kinematics from points measured on its FMU. [Gandarias2020] sec. IV."""

import platform
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handover.controllers.vsl.beam import BentCommand, BentTip
from handover.controllers.vsl.fit import directions_of, domain_of, fit_adapted, fit_beam, fit_cubic, fit_friction
from handover.controllers.vsl.fit_network import EPOCHS, Points, fit_published, fit_small
from handover.controllers.vsl.hybrid_kinematics import Params
from handover.controllers.vsl.kinematics import VslKinematics
from handover.controllers.vsl.learned_model import (
    FORWARD_INPUTS,
    Adapted,
    Cubic,
    ForwardInput,
    Learned,
    Regressor,
    VslModel,
    inputs_of,
)
from handover.cosim.blocks.ports import Floats
from handover.scenarios.robots.vsl.data_file import links_of
from handover.scenarios.robots.vsl.residuals import Errors, Pairs, Residuals, lengths_of
from handover.scenarios.robots.vsl.training_data import (
    Dataset,
    Measured,
    collect,
    describe_arm,
    parameters_of,
    plain_parameters,
    stretch_of,
)

Progress = Callable[[float, float], None]

MIN_POINTS = 400
"""Number of points below which the 120 coefficients of a cubic are not worth fitting (assumed)."""

_MIN_VARIATION = 1e-9
"""Range of an input, relative to its magnitude, below which it counts as constant: rounding (own choice)."""

_FRICTION_POINTS = 1500
"""Training points of which the gears' friction, two numbers, is learned (own choice)."""

_FOLDS = 10
"""Parts into which the few points of an adaptation are split: each is tested by what the others teach (own choice)."""


class NothingToLearn(ValueError):
    """Measured points from which no kinematics can be learned: not the expected arm, or its sensors do not work."""

    def __init__(self, fmu: Path, fault: str) -> None:
        super().__init__(f"{fmu}: {fault}")
        self.fmu, self.fault = fmu, fault


@dataclass(frozen=True)
class _Fitted:
    regressor: Regressor
    facts: Mapping[str, Any]


@dataclass(frozen=True, kw_only=True)
class VslTraining:
    """Measures points, splits them, fits both regressors and tests them.

    Attributes:
        fmu: the arm.
        kinematics: of rigid links, which is corrected.
        points: how many are measured; those whose tip is too near to the limits of reach are left out.
        seed: of the points, the split, the arm's noise and a network's first weights.
        learned: what corrects.
        forward_input: what eq. (10) takes.
        friction_compensation: whether it is learned on currents without the gears' friction.
        walk: see `collect`.
        arm: parameters of the arm, by name, in place of its own.
        epochs: passes over the points of a published network's training.
    """

    fmu: Path
    kinematics: VslKinematics
    points: int
    seed: int
    learned: Learned = Learned.CUBIC
    forward_input: ForwardInput = ForwardInput.Q
    friction_compensation: bool = False
    walk: bool = False
    arm: Mapping[str, Any] = field(default_factory=dict[str, Any])
    epochs: int = EPOCHS

    @property
    def residuals(self) -> Residuals:
        """What is to be learned of measured points."""
        return Residuals(kinematics=self.kinematics, learned=self.learned, forward_input=self.forward_input)

    def like(self, model: VslModel) -> "VslTraining":
        """Return the training of a model of the same kind for the same links."""
        return replace(self, kinematics=model.kinematics, learned=model.kind, forward_input=model.forward_input)

    def train(self, progress: Progress) -> tuple[VslModel, Errors]:
        """Return the model, whose provenance has no date or path, and its errors.

        Raises:
            InvalidFmu, InitializationError, UnitFailure: the arm's FMU is invalid, does not initialize, or fails.
            NothingToLearn: fewer than half of the tips are within reach, or an input is the same at all points.
            NoPyTorch: a published network is wanted, and PyTorch is not installed.
        """
        return self.learn(self.measure(progress), progress)

    def measure(self, progress: Progress) -> Measured:
        """Return measured points, with their place in the split.

        Raises:
            InvalidFmu, InitializationError, UnitFailure, NothingToLearn: as `train`.
        """
        d = describe_arm(self.fmu)
        points_seed, arm_seed = (int(n) for n in np.random.SeedSequence(self.seed).generate_state(2) >> 1)
        rng = np.random.default_rng(points_seed)
        parameters = {**parameters_of(d, arm_seed), **self.arm}
        data = collect(d, self.kinematics, self.points, rng, parameters, progress, walk=self.walk)
        usable = self._usable(data)
        order = np.full(len(data), -1)
        order[usable[rng.permutation(len(usable))]] = np.arange(len(usable))
        arm = {"fmu": d.name, "parameters": plain_parameters(d, parameters)}
        origin = {"arm": arm, "links": links_of(self.kinematics), "seed": self.seed, "walk": self.walk}
        return Measured(data, order, origin)

    def parameters(self) -> dict[str, Any]:
        """Return the parameters of the arm that is measured, with some seed, as plain data."""
        d = describe_arm(self.fmu)
        return plain_parameters(d, {**parameters_of(d, 0), **self.arm})

    def learn(self, measured: Measured, progress: Progress, share: float = 1.0) -> tuple[VslModel, Errors]:
        """Return the model of measured points and its errors.

        Args:
            measured: the points, of this arm and these links.
            progress: called with the passes of a published network's training and their number.
            share: of the training and validation points that are used.

        Raises:
            NothingToLearn, NoPyTorch: as `train`.
        """
        directions = directions_of(measured.points.q_cmd[:, 1:], Params().reversal)
        training, validation, test = measured.parts(share)
        self._check_varies(measured.points.rows(training))
        friction = (0.0, 0.0)
        if self.friction_compensation:
            few = training[:_FRICTION_POINTS]
            friction = self._friction(measured.points.rows(few), directions[few])
        data = measured.points.without_friction(directions, friction)
        parts = data.rows(training), data.rows(validation)
        seeds = [int(n) for n in np.random.SeedSequence(measured.origin["seed"]).generate_state(4)[2:] >> 1]
        inverse, forward = self._fit_both(*parts, seeds, progress)
        nominal = self._nominal_currents(*parts) if self.friction_compensation else None
        kinds = self.learned, self.forward_input, friction, nominal
        model = VslModel(inverse.regressor, forward.regressor, self.kinematics, {}, *kinds)
        errors = self.residuals.errors(model, data.rows(test))
        if self.learned is not Learned.PHYSICS:
            other = replace(self, forward_input=_OTHER[self.forward_input])
            pairs = other.residuals.forward_pairs(parts[0]), other.residuals.forward_pairs(parts[1])
            beside = other._fit(*pairs, seeds[1], progress, "m").regressor
            theirs = replace(model, forward=beside, forward_input=other.forward_input)
            errors = replace(errors, forward_other_input=self.residuals.forward_error(theirs, data.rows(test)))
        counts = {"measured": len(measured.points), "training": len(training)}
        provenance: dict[str, Any] = {
            "arm": measured.origin["arm"],
            "seed": measured.origin["seed"],
            **({"walk": True} if measured.origin["walk"] else {}),
            "points": {**counts, "validation": len(validation), "test": len(test)},
            "data": measured.digest(),
            "inverse": inverse.facts,
            "forward": forward.facts,
            "mean_test_errors_m": _rounded(errors),
            "versions": {"python": platform.python_version(), "numpy": np.__version__},
        }
        return replace(model, provenance=provenance), errors

    def adapt(self, base: VslModel, measured: Measured) -> tuple[VslModel, Errors, Errors]:
        """Return a model adapted to few points of an arm that differs, and errors of the base and with the adaptation.

        The errors with it are of points that it did not see: each tenth by what the other nine teach.
        """
        directions = directions_of(measured.points.q_cmd[:, 1:], Params().reversal)
        data = measured.points.without_friction(directions, base.friction).rows(np.flatnonzero(measured.order >= 0))
        folds = [np.arange(len(data)) % _FOLDS == k for k in range(_FOLDS)]
        tested = [
            (self.residuals.errors(self._adapted(base, data.rows(~fold)), data.rows(fold)), int(np.sum(fold)))
            for fold in folds
        ]
        names = ("forward_model_based", "forward_hybrid", "inverse_model_based", "inverse_hybrid")
        errors = Errors(**{n: sum(getattr(e, n) * size for e, size in tested) / len(data) for n in names})
        provenance: dict[str, Any] = {
            "arm": measured.origin["arm"],
            "seed": measured.origin["seed"],
            "points": {"measured": len(measured.points), "training": len(data)},
            "data": measured.digest(),
            "mean_test_errors_m": _rounded(errors),
            "versions": {"python": platform.python_version(), "numpy": np.__version__},
            "adapted_from": base.provenance,
        }
        return replace(self._adapted(base, data), provenance=provenance), self.residuals.errors(base, data), errors

    def _fit_both(
        self, training: Dataset, validation: Dataset, seeds: list[int], progress: Progress
    ) -> tuple[_Fitted, _Fitted]:
        """Fit what corrects eq. (11) and what corrects eq. (10)."""
        if self.learned is Learned.PHYSICS:
            return self._fit_beam(training, validation)
        inverse = self.residuals.inverse_pairs(training), self.residuals.inverse_pairs(validation)
        forward = self.residuals.forward_pairs(training), self.residuals.forward_pairs(validation)
        return self._fit(*inverse, seeds[0], progress, "rad"), self._fit(*forward, seeds[1], progress, "m")

    def _fit(
        self,
        training: Pairs,
        validation: Pairs,
        seed: int,
        progress: Progress,
        unit: str,
    ) -> _Fitted:
        """Fit one of the two, of values in a unit."""
        if self.learned is Learned.CUBIC:
            fit = fit_cubic(*training, *validation)
            return _Fitted(fit.cubic, {"penalty": fit.penalty, **_rms(fit.validation_rms, unit)})
        points = Points(*training, *validation)
        network = (
            fit_small(points, seed)
            if self.learned is Learned.SMALL
            else fit_published(points, seed, self.epochs, progress)
        )
        return _Fitted(network.network, {**network.facts, **_rms(network.validation_rms, unit)})

    def _fit_beam(self, training: Dataset, validation: Dataset) -> tuple[_Fitted, _Fitted]:
        """Fit a beam to tips, and the servos' droop to what their encoders show of it."""
        forward, inverse = self.residuals.forward_pairs(training), self.residuals.inverse_pairs(training)
        beam = fit_beam(self.kinematics, *forward)
        torques, droops = beam.weights.kt * training.i[:, 1:], (training.q_cmd - training.q)[:, 1:]
        droop = float(f"{np.sum(torques * droops) / np.sum(torques**2):.12g}")
        seen, wanted = domain_of(forward[0]), domain_of(inverse[0])
        tip = BentTip(seen.mean, seen.scale, seen.hull, beam)
        command = BentCommand(wanted.mean, wanted.scale, wanted.hull, beam, droop)
        fitted: list[_Fitted] = []
        for bent, pairs, unit in (
            (command, self.residuals.inverse_pairs, "rad"),
            (tip, self.residuals.forward_pairs, "m"),
        ):
            x, y = pairs(validation)
            fitted.append(_Fitted(bent, _rms(float(np.sqrt(np.mean((bent.predict(x) - y) ** 2))), unit)))
        return fitted[0], fitted[1]

    def _friction(self, data: Dataset, directions: Floats) -> tuple[float, float]:
        """Return the currents by friction that leave least of the tips unexplained."""
        residuals = replace(self.residuals, learned=Learned.CUBIC, forward_input=ForwardInput.Q)

        def inputs_at(c: Floats) -> Floats:
            return residuals.forward_pairs(data.without_friction(directions, c))[0]

        return fit_friction(inputs_at, directions, residuals.forward_pairs(data)[1])

    def _nominal_currents(self, training: Dataset, validation: Dataset) -> Cubic:
        """Fit the currents of joints 2 and 3 to angles and pressures, whatever the load."""
        pairs = [(np.concatenate([d.q[:, 1:], d.p], axis=1), d.i[:, 1:]) for d in (training, validation)]
        return fit_cubic(*pairs[0], *pairs[1]).cubic

    def _adapted(self, base: VslModel, data: Dataset) -> VslModel:
        return replace(
            base,
            inverse=fit_adapted(_base(base.inverse), *self.residuals.inverse_pairs(data)),
            forward=fit_adapted(_base(base.forward), *self.residuals.forward_pairs(data)),
        )

    def _usable(self, measured: Dataset) -> Any:
        """Return the rows of points with tips within reach."""
        rows = np.flatnonzero(self._within_reach(measured.p_WG))
        if len(rows) < len(measured) / 2:
            k = self.kinematics
            raise NothingToLearn(
                self.fmu,
                f"{len(rows)} of {len(measured)} measured tips are where links of {k.L_2:g} and {k.L_3:g} m on a "
                f"shoulder {k.L_1:g} m high can be; half of them should be",
            )
        self._check_varies(measured.rows(rows))
        return rows

    def check(self, measured: Measured) -> None:
        """Check points that were measured before.

        Raises:
            NothingToLearn: some in the split have a tip out of reach, or an input is the same at all of them.
        """
        used = measured.points.rows(measured.order >= 0)
        if out := int(np.sum(~self._within_reach(used.p_WG))):
            raise NothingToLearn(self.fmu, f"{out} of {len(used)} points in its split have a tip out of reach")
        if len(used):
            self._check_varies(used)

    def _check_varies(self, data: Dataset) -> None:
        x = inputs_of(data.q, data.p, data.i)
        constant = np.ptp(x, axis=0) <= _MIN_VARIATION * np.max(np.abs(x), axis=0)
        if np.any(constant):
            names = ", ".join(name for name, c in zip(FORWARD_INPUTS, constant, strict=True) if c)
            raise NothingToLearn(self.fmu, f"the same at all points, whatever is commanded: {names}")

    def _within_reach(self, p_WG: Floats) -> NDArray[np.bool_]:
        low, high = stretch_of(self.kinematics)
        from_shoulder = lengths_of(p_WG - np.array([0.0, 0.0, self.kinematics.L_1]))
        return (from_shoulder <= high) & (from_shoulder >= low)


_OTHER = {ForwardInput.Q: ForwardInput.X, ForwardInput.X: ForwardInput.Q}


def _base(regressor: Regressor) -> Regressor:
    """Return what an adapted regressor was adapted from: adaptations of adaptations would pile up."""
    return regressor.base if isinstance(regressor, Adapted) else regressor


def _rms(validation_rms: float, unit: str) -> dict[str, float]:
    return {f"validation_rms_{unit}": float(f"{validation_rms:.4g}")}


def _rounded(errors: Errors) -> dict[str, float]:
    return {name: float(f"{value:.4g}") for name, value in vars(errors).items() if value is not None}
