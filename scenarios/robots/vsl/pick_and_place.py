"""An arm of soft links picks an object up and puts it down, soft near contacts and stiff while it carries.

[Gandarias2020] names pick and place as what position control is for, and has no such experiment: what is tried here is
what its links are meant for, a light touch and a steady carry.
"""

from collections.abc import Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from typing import ClassVar

import numpy as np

from handover.controllers.vsl.kinematics import Unreachable, VslKinematics
from handover.controllers.vsl.pick_and_place import Params as Task
from handover.cosim.blocks.ports import Floats
from handover.cosim.record.reader import Record
from handover.cosim.system.system import System
from handover.scenarios.experiment.experiment import Experiment, Figure, FmuOf
from handover.scenarios.experiment.parameters import InvalidParameter
from handover.scenarios.experiment.places import Place
from handover.scenarios.experiment.replay import Replay
from handover.scenarios.experiment.time_plot import TimeFigure
from handover.scenarios.robots.vsl.penetration import start_faults
from handover.scenarios.robots.vsl.pick_and_place_evaluation import PickAndPlaceEvaluator, PickAndPlaceParameters
from handover.scenarios.robots.vsl.places import FIXED_VALUES, PLACES, fixed_value_faults, sensor_faults

_GRACE = 5
"""Time by which the task may end late before the run does, s (assumed)."""
_FIXED = {
    **FIXED_VALUES,
    "arm.face": "the table is as high as the top of the object, pick",
    "gripper.p_WO_0": "the object stands where planner and arm expect it, at pick",
    "gripper.landing": "the object lands on the table, as high as pick and place",
}
"""The units' values that are fixed, and why."""

_SUBSTEP = 0.002
"""Longest internal time step of the arm, s: a contact is shorter than a swing."""


class VslPickAndPlace(Experiment[PickAndPlaceEvaluator]):
    """The links are soft while something may be touched, and stiff while the object is carried."""

    name: ClassVar[str] = "vsl_pick_and_place"
    title: ClassVar[str] = "an arm of soft links picks an object up softly and carries it stiffly"
    parameters_type: ClassVar[type[PickAndPlaceParameters]] = PickAndPlaceParameters
    units: ClassVar[Mapping[str, str]] = {
        "planner": "PickAndPlace",
        "kinematics": "HybridKinematics",
        "arm": "VslArm",
        "gripper": "VacuumGripper",
    }
    unit_files: ClassVar[tuple[str, ...]] = ("kinematics.model",)
    headline: ClassVar[tuple[str, ...]] = (
        "place_error",
        "dragged",
        "pick_force",
        "place_force",
        "carry_error",
        "pace_arm",
    )
    places: ClassVar[Mapping[str, Place]] = {
        "planner": Place(
            required={
                "q_ref": "",
                "qd_ref": "",
                "p_cmd": "",
                "vacuum": "",
                "p_WG_goal": "compared with the tip while it carries",
                "phase": "says what is touched and when",
                "done": "by it the run ends",
            },
            remarks=PLACES["planner"].remarks,
        ),
        "kinematics": Place(
            required=PLACES["kinematics"].required,
            optional={n: PLACES["kinematics"].optional[n] for n in ("q_ref", "qd_ref", "q_meas", "p_meas", "i_meas")}
            | {"outside": "its share of the time is a metric"},
            remarks=PLACES["kinematics"].remarks,
        ),
        "arm": Place(
            required={**PLACES["arm"].required, "f_G": "by it touches are judged", "load": "what the gripper holds"},
            optional={n: PLACES["arm"].optional[n] for n in ("p_cmd", "seed")}
            | {
                "q_0": "above the place where it picks the object up",
                "motion": "it swings",
                "face": "where the object's top is",
                "substep": "as contacts need",
            },
            remarks=PLACES["arm"].remarks,
        ),
        "gripper": Place(
            required={"p_WG": "", "vacuum": "", "load": "", "held": "", "p_WO": "by it the run is judged"},
            optional={"landing": "the height of the scenario's parameter place"},
            remarks=PLACES["arm"].remarks,
        ),
    }

    def build(self, parameters: PickAndPlaceParameters, seed: int, fmu: FmuOf) -> System:
        """Wire planner, kinematics, arm and gripper.

        Raises:
            InvalidParameter: the two places are one, or of different heights, or the arm cannot start above the first.
        """
        p = parameters
        if faults := p.faults():
            raise InvalidParameter(faults)
        q_0 = _q_above(p.pick, p.hover)
        s = System()
        planner = s.add("planner", fmu("planner"))
        kinematics = s.add("kinematics", fmu("kinematics"))
        arm = s.add(
            "arm",
            fmu("arm"),
            motion="DYNAMIC",
            q_0=q_0,
            face=p.pick[2],
            substep=_SUBSTEP,
            seed=int(np.random.SeedSequence(seed).generate_state(1)[0] >> 1),
        )
        gripper = s.add("gripper", fmu("gripper"), landing=p.place[2])
        for name in ("q_ref", "qd_ref"):
            s.connect(getattr(planner.y, name), getattr(kinematics.u, name))
        for name in ("q_cmd", "qd_cmd"):
            s.connect(getattr(kinematics.y, name), getattr(arm.u, name))
        for name in ("q_meas", "p_meas", "i_meas"):
            s.connect(getattr(arm.y, name), getattr(kinematics.u, name))
        s.connect(planner.y.p_cmd, arm.u.p_cmd)
        s.connect(planner.y.vacuum, gripper.u.vacuum)
        s.connect(arm.y.p_WG, gripper.u.p_WG)
        s.connect(gripper.y.load, arm.u.load)
        return s

    def check_unit_values(self, system: System, given: Sequence[str]) -> None:
        """Reject sensors that the controller is to look at, and that are not connected; and an arm that starts too low.

        Raises:
            InvalidParameter: `kinematics.closed_loop`, `kinematics.imu` or a value that is fixed here is given, or
                tip or elbow would start below the ground or the table.
        """
        faults = fixed_value_faults(given, _FIXED) + start_faults(system.units, elbow=True)
        if faults := faults + sensor_faults(system, given, "this scenario has no {}, vsl_hybrid has"):
            raise InvalidParameter(faults)

    def stop_time(self, parameters: PickAndPlaceParameters) -> Fraction:
        """Return the nominal duration of the task, plus a grace period."""
        return Fraction(round(parameters.duration)) + _GRACE

    def evaluator(self, parameters: PickAndPlaceParameters) -> PickAndPlaceEvaluator:
        """Return the evaluator of one run."""
        return PickAndPlaceEvaluator(parameters)

    def cycle(self) -> tuple[str, ...]:
        """Return the units that run on the robot's computer: planner and kinematics."""
        return ("planner", "kinematics")

    def draw(
        self,
        parameters: PickAndPlaceParameters,
        evaluator: PickAndPlaceEvaluator,  # noqa: ARG002 (its figures need the record alone)
        record: Record,
        folder: Path,
    ) -> list[Figure]:
        """Draw the way of the tip and of the object, and the arm as it picks up and as it puts down."""
        # Matplotlib is slow to import.
        from handover.scenarios.robots.vsl.pick_and_place_plots import draw_pick_and_place

        return draw_pick_and_place(parameters, record, folder)

    def time_figures(self, parameters: PickAndPlaceParameters, record: Record) -> list[TimeFigure]:
        """Return heights, forces and pressures over time."""
        from handover.scenarios.robots.vsl.pick_and_place_plots import figures_of_pick_and_place

        return figures_of_pick_and_place(parameters, record)

    def replay(self, parameters: PickAndPlaceParameters, record: Record) -> Replay:
        """Return arm, object and table in space."""
        from handover.scenarios.robots.vsl.pick_and_place_plots import replay_pick_and_place

        return replay_pick_and_place(parameters, record)


def _q_above(p_WP: Floats, hover: float) -> Floats:
    """Return the angles, shape (3,), rad, that put a rigid arm's tip above a place, from where it comes down.

    Raises:
        InvalidParameter: it is out of reach.
    """
    task = Task()
    try:
        return VslKinematics(task.L_1, task.L_2, task.L_3, task.elbow).inverse(p_WP + np.array([0.0, 0.0, hover]))
    except Unreachable as e:
        raise InvalidParameter([f"pick: above it the arm is to start, and {e}"]) from e
