"""An arm with links of variable stiffness follows a path. [Gandarias2020] sec. V.

Both experiments wire planner, kinematics and arm alike. `VslModelBased` commands by rigid-link kinematics (sec. V-A,
experiment 1), `VslHybrid` by the same with learned corrections (sec. V-B, experiment 2).
"""

from collections.abc import Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from handover.controllers.vsl.hybrid_kinematics import Imu
from handover.controllers.vsl.waypoints import InvalidWaypoints
from handover.cosim.record.reader import Record
from handover.cosim.system.system import System
from handover.scenarios.experiment.experiment import Experiment, Figure, FmuOf
from handover.scenarios.experiment.parameters import InvalidParameter
from handover.scenarios.experiment.places import Place
from handover.scenarios.experiment.replay import Replay
from handover.scenarios.experiment.time_plot import TimeFigure
from handover.scenarios.robots.vsl.arms import arm_of
from handover.scenarios.robots.vsl.evaluation import PathEvaluator
from handover.scenarios.robots.vsl.parameters import (
    BASE_STEP,
    ENCODER_STEP,
    REGULATOR_STEP,
    TRANSDUCER_STEP,
    HybridParameters,
    Parameters,
    Resolution,
)
from handover.scenarios.robots.vsl.penetration import start_faults
from handover.scenarios.robots.vsl.places import PLACES, fixed_value_faults, sensor_faults

_GRACE = 5
"""Time by which the path may be completed late before the run ends, s (assumed)."""


ELECTRONICS: dict[str, Any] = {
    "base_step": BASE_STEP,
    "encoder_step": ENCODER_STEP,
    "transducer_step": TRANSDUCER_STEP,
    "regulator_step": REGULATOR_STEP,
}
"""What the arm's parameters are set to for what the published robot's electronics resolve."""


class PathExperiment(Experiment[PathEvaluator]):
    """The tip is to follow a path; joint angles, pressures and currents are measured, the tip is not."""

    units: ClassVar[Mapping[str, str]] = {
        "planner": "TrajectoryPlanner",
        "kinematics": "HybridKinematics",
        "arm": "VslArm",
    }
    places: ClassVar[Mapping[str, Place]] = PLACES
    unit_files: ClassVar[tuple[str, ...]] = ("planner.waypoints", "kinematics.model")
    headline: ClassVar[tuple[str, ...]] = (
        "mean_error",
        "median_error",
        "max_error",
        "servo_error",
        "model_error",
        "estimate_error",
        "outside",
        "model_mismatch",
        "points_visited",
        "lowest",
        "path_time",
        "cpu_per_cycle",
        "pace_arm",
    )
    hybrid: ClassVar[bool]
    """Whether the kinematics use what was learned."""

    def kinematics(self, parameters: Any) -> dict[str, Any]:  # noqa: ARG002
        """Return the parameters of the kinematics that only this experiment has."""
        return {}

    def build(self, parameters: Parameters, seed: int, fmu: FmuOf) -> System:
        """Wire planner, kinematics and arm.

        Raises:
            InvalidParameter: an end of the path is below the ground; a pressure of link 3 is out of range; loads or
                pressures over time are no schedule.
        """
        p = parameters
        if faults := p.contradictions():
            raise InvalidParameter(faults)
        arm_seed = int(np.random.SeedSequence(seed).generate_state(1)[0] >> 1)
        s = System()
        planner = s.add(
            "planner",
            fmu("planner"),
            pressure=p.pressures,
            waypoints=str(Path(p.waypoints).absolute()) if p.waypoints else "",
        )
        kinematics = s.add(
            "kinematics",
            fmu("kinematics"),
            method="HYBRID" if self.hybrid else "MODEL_BASED",
            **self.kinematics(p),
        )
        link_2, link_3 = p.links.kinds
        arm = s.add(
            "arm",
            fmu("arm"),
            link_2=link_2.name,
            link_3=link_3.name,
            load=p.load,
            q_0=p.q_0,
            seed=arm_seed,
            **(ELECTRONICS if p.resolution is Resolution.ELECTRONICS else {}),
            **arm_of(p).settings,
        )
        for name in ("q_ref", "qd_ref"):
            s.connect(getattr(planner.y, name), getattr(kinematics.u, name))
        s.connect(planner.y.p_cmd, arm.u.p_cmd)
        for name in ("q_cmd", "qd_cmd"):
            s.connect(getattr(kinematics.y, name), getattr(arm.u, name))
        for name in ("q_meas", "p_meas", "i_meas"):
            s.connect(getattr(arm.y, name), getattr(kinematics.u, name))
        return s

    def stop_time(self, parameters: Parameters) -> Fraction:
        """Return the nominal duration of the run, settling and path, plus a grace period.

        Raises:
            InvalidParameter: there is no such file of waypoints, or it is not a list of them.
        """
        try:
            length = parameters.length
        except InvalidWaypoints as e:
            raise InvalidParameter([f"waypoints: {e}"]) from e
        return Fraction(round(parameters.settle + length / parameters.speed)) + _GRACE

    def check_unit_values(self, system: System, given: Sequence[str]) -> None:
        """Reject sensors that the controller is to look at, and that are not connected; and a tip that starts too low.

        Raises:
            InvalidParameter: `kinematics.closed_loop`, `kinematics.imu` or `arm.links` is given, or the tip would start
                below the ground. An elbow that points down may: its parameter says that it does on the paper's paths.
        """
        faults = fixed_value_faults(given) + start_faults(system.units, elbow=False)
        if faults := faults + sensor_faults(system, given, "`-p {}` of vsl_hybrid connects it"):
            raise InvalidParameter(faults)

    def parameter_files(self, parameters: Parameters) -> Mapping[str, Path]:
        """Return the files of waypoints and of a trained model."""
        named = {"waypoints": parameters.waypoints}
        if isinstance(parameters, HybridParameters):
            named["model"] = parameters.model
        return {name: Path(file) for name, file in named.items() if file}

    def evaluator(self, parameters: Parameters) -> PathEvaluator:
        """Return the evaluator of one run along the path."""
        return PathEvaluator(parameters, hybrid=self.hybrid)

    def cycle(self) -> tuple[str, ...]:
        """Return the units that run on the robot's computer: planner and kinematics."""
        return ("planner", "kinematics")

    def draw(self, parameters: Parameters, evaluator: PathEvaluator, record: Record, folder: Path) -> list[Figure]:
        """Draw the path, the arm's shape at three moments, and errors."""
        from handover.scenarios.robots.vsl.plots import draw_path_run  # matplotlib is slow to import

        return draw_path_run(parameters, evaluator, record, folder)

    def time_figures(self, parameters: Parameters, record: Record) -> list[TimeFigure]:
        """Return error and position of the tip, joints, pressures and currents over time."""
        from handover.scenarios.robots.vsl.plots import figures_of_path

        return figures_of_path(parameters, record, hybrid=self.hybrid)

    def replay(self, parameters: Parameters, record: Record) -> Replay:
        """Return arm, load, desired path and tip path in space."""
        from handover.scenarios.robots.vsl.replay import replay_path

        return replay_path(parameters, record, hybrid=self.hybrid)


class VslModelBased(PathExperiment):
    """The paper's first experiment: the links bend, which the kinematics ignore."""

    name: ClassVar[str] = "vsl_model_based"
    title: ClassVar[str] = "an arm of soft links follows a path by rigid-link kinematics"
    parameters_type: ClassVar[type[Parameters]] = Parameters
    hybrid: ClassVar[bool] = False


class VslHybrid(PathExperiment):
    """The paper's second experiment: pressures and currents show how far the links bend."""

    name: ClassVar[str] = "vsl_hybrid"
    title: ClassVar[str] = "an arm of soft links follows a path by kinematics with learned corrections"
    parameters_type: ClassVar[type[HybridParameters]] = HybridParameters
    hybrid: ClassVar[bool] = True

    def kinematics(self, parameters: HybridParameters) -> dict[str, Any]:
        """Return the trained model's file, which is absolute, since a unit may run in another folder."""
        return {"model": str(Path(parameters.model).absolute()) if parameters.model else ""}

    def build(self, parameters: Any, seed: int, fmu: FmuOf) -> System:
        """Wire as the other experiment does, and tracker or IMUs to the kinematics if these look at them."""
        s = super().build(parameters, seed, fmu)
        if parameters.closed_loop:
            s.connect(s.units["arm"].y.p_WG_meas, s.units["kinematics"].u.p_WG_meas)
        if parameters.imu is not Imu.NONE:
            s.connect(s.units["arm"].y.tilt_meas, s.units["kinematics"].u.tilt_meas)
        return s

    def check_unit_values(self, system: System, given: Sequence[str]) -> None:
        """Reject sensors that are not connected, and a gain of damping that is without effect.

        Raises:
            InvalidParameter: as its base; or K_D is given, and friction is not compensated.
        """
        super().check_unit_values(system, given)
        start = system.units["kinematics"].start
        if "kinematics.K_D" in given and not start.get("friction_compensation"):
            fault = (
                "kinematics.K_D: without effect unless friction_compensation=true: currents with friction lag behind "
                "the posture, which would be taken for a swing"
            )
            raise InvalidParameter([fault])
