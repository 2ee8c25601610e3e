"""Parameters of the tendon-driven arm; apart from its design, which takes SciPy, so that they are listed at once."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from handover.cosim.blocks.block import InvalidParameters
from handover.cosim.blocks.origins import assumed, stated
from handover.cosim.blocks.ports import Floats, Vector3, parameter
from handover.cosim.blocks.start_values import parameter_faults
from handover.cosim.blocks.units import (
    Hertz,
    Kilogram,
    Metre,
    MetrePerSecond2,
    Newton,
    NewtonMetre2,
    NewtonPerMetre,
    NewtonSecondPerMetre,
    Number,
    Second,
)

_FITTED = assumed(
    "such that at rest, for one commanded state far forward, model and arm are 0.29, 0.16 and 0.14 m apart, as in "
    "sec. 5.2. In the closed loop they end 0.08 m apart: see fitted_arm"
)


class InvalidArmParameters(InvalidParameters):
    """Values of which no arm can be built; `faults` lists all of them, `block` is which of the two arms."""

    def __init__(self, faults: Sequence[str], block: str) -> None:
        self.block = block
        super().__init__(faults)


@dataclass(frozen=True, kw_only=True)
class Params:
    """The arm as built; three entries are of the three segments from the mount down.

    [Vervloet2025] states `tendon_length` (sec. 3.1), `d_gripper` (appendix A) and `closing_time` (sec. 3.5). The rest
    is assumed, such that for one commanded state far forward the arm at rest is as far from the constant-curvature
    model as in fig. 9; in the closed loop it ends nearer to it.
    """

    discs_1: int = parameter(
        4, "discs in the first segment", minimum=1, maximum=64, origin=assumed("own choice: a disc for each 3 cm")
    )
    discs_2: int = parameter(
        8, "discs in the second segment", minimum=1, maximum=64, origin=assumed("own choice: a disc for each 3 cm")
    )
    discs_3: int = parameter(
        8, "discs in the third segment", minimum=1, maximum=64, origin=assumed("own choice: a disc for each 3 cm")
    )
    tendon_length: Vector3[Metre] = parameter(
        np.array([0.12, 0.24, 0.24]),
        "lengths of the segments as calibrated, hanging",
        minimum=0.01,
        maximum=2.0,
        origin=stated("sec. 3.1"),
    )
    natural_length: Vector3[Metre] = parameter(
        np.array([0.14, 0.262, 0.262]),
        "lengths of the segments without tendons and weight: the excess tightens the tendons",
        minimum=0.01,
        maximum=2.0,
        origin=_FITTED,
    )
    d_gripper: Metre = parameter(
        0.10, "distance of wrist and gripper", minimum=0.0, maximum=1.0, origin=stated("sec. 3.2.4, appendix A")
    )
    d: Metre = parameter(
        0.035,
        "distance of the tendons from the axis",
        minimum=0.001,
        maximum=0.5,
        origin=assumed("as the controller has it"),
    )
    EA: Newton = parameter(100.0, "axial stiffness of the segments", minimum=1.0, maximum=1e5, origin=_FITTED)
    EI: NewtonMetre2 = parameter(0.0267, "bending stiffness of the segments", minimum=1e-4, maximum=1e2, origin=_FITTED)
    shear_ratio: Number = parameter(
        0.35, "shear stiffness over axial stiffness, GA / EA", minimum=0.01, maximum=10.0, origin=assumed("GA / EA")
    )
    twist_ratio: Number = parameter(
        2.0, "twisting over bending stiffness, GJ / EI", minimum=0.01, maximum=100.0, origin=assumed("GJ / EI")
    )
    damping: Second = parameter(
        0.03,
        "damping over stiffness, in axial strain, bending and twist",
        minimum=0.0,
        maximum=10.0,
        origin=assumed("damping over stiffness"),
    )
    segment_mass: Vector3[Kilogram] = parameter(
        np.array([0.10, 0.16, 0.13]),
        "masses of the segments, spread over their lengths",
        minimum=0.001,
        maximum=10.0,
        origin=_FITTED,
    )
    plate_mass: Vector3[Kilogram] = parameter(
        np.array([0.03, 0.03, 0.05]),
        "masses of the plates that end the segments",
        minimum=0.0,
        maximum=10.0,
        origin=_FITTED,
    )
    shortest: Number = parameter(
        0.4,
        "lower end stop of a motor: tendon length over calibrated length",
        minimum=0.1,
        maximum=1.0,
        origin=assumed("own choice: tendons within eq. (11) are 0.44 times as long as calibrated, or longer"),
    )
    longest: Number = parameter(
        2.0,
        "upper end stop of a motor: tendon length over calibrated length",
        minimum=1.0,
        maximum=10.0,
        origin=assumed("own choice: tendons within eq. (11) are 1.4 times as long as calibrated, or shorter"),
    )
    gripper_mass: Kilogram = parameter(0.10, "mass of the gripper", minimum=0.0, maximum=10.0, origin=_FITTED)
    gravity: MetrePerSecond2 = parameter(
        9.81, "gravity, along -z of the world", minimum=0.0, maximum=30.0, origin=assumed("standard")
    )
    tendon_stiffness: NewtonPerMetre = parameter(
        1e4,
        "stiffness of a tendon of its calibrated length",
        minimum=100.0,
        maximum=1e6,
        origin=assumed("stiff against the segments"),
    )
    tendon_damping: NewtonSecondPerMetre = parameter(
        10.0,
        "damping of a tendon of its calibrated length",
        minimum=0.0,
        maximum=1e4,
        origin=assumed("own choice: 1 ms of tendon_stiffness"),
    )
    slack_force: Newton = parameter(
        0.005,
        "largest push of a slack tendon, which the solver needs",
        minimum=1e-4,
        maximum=1.0,
        origin=assumed("own choice: what the solver needs, a small part of the weights"),
    )
    motor_frequency: Hertz = parameter(
        4.0,
        "natural frequency of the motors, critically damped",
        minimum=0.1,
        maximum=50.0,
        origin=assumed("critically damped"),
    )
    closing_time: Second = parameter(
        10.0, "time of the gripper's full travel", minimum=0.01, maximum=100.0, origin=stated("sec. 3.5")
    )
    internal_step: Second = parameter(
        0.005,
        "time step of the integrator",
        minimum=1e-4,
        maximum=0.01,
        origin=assumed("own choice of the integrator's step"),
    )

    @property
    def end_stops(self) -> tuple[Floats, Floats]:
        """Smallest and largest length change of each tendon, (9,), m."""
        length = np.repeat(self.tendon_length, 3)
        return length * (self.shortest - 1.0), length * (self.longest - 1.0)

    def check(self, block: str) -> None:
        """Raise InvalidArmParameters of a block, with all faults, if a value lies outside its range."""
        faults = parameter_faults(self)
        if faults:
            raise InvalidArmParameters(faults, block)
