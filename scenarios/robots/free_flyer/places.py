"""What a unit needs to take a place in the scenarios of the free-flyer."""

from collections.abc import Mapping

from handover.scenarios.experiment.places import Place

_FRAMES = (
    "W is the world, without gravity. B is the robot's frame, with its origin in its centre of mass; G, the gripper, "
    "has the axes of B and stands at p_BG. Vectors are in W where nothing else is said. Commands of force and "
    "torque, what the thrusters make of them, inertia and p_BG are in B. Quaternions are scalar first, of the "
    "frame's orientation in W.",
)
_ESTIMATE = {
    "p_WB_meas": "",
    "q_WB_meas": "",
    "v_WB_meas": "",
    "w_WB_meas": "",
}
_TRUTH = {"p_WB": "", "q_WB": "", "v_WB": "", "w_WB": ""}
_WRENCH = {"f_B": "", "tau_B": ""}
_ON_GRIPPER = {"f_G": "", "tau_G": ""}
_AT_GRIPPER = {"p_WG": "", "q_WG": "", "v_WG": ""}
_MOTION = {**_AT_GRIPPER, "w_WG": ""}
_BODY = {
    "mass": "as the scenario's factors make it",
    "I_B": "by the same factors",
    "p_BG": "by the same factors",
}
_CONTROLLER = Place(
    required={"f_cmd": "at the centre of mass", "tau_cmd": ""},
    optional={
        **_ESTIMATE,
        "p_WG_goal": "",
        "q_WG_goal": "",
        "active": "a controller that is not active is to command zeros: the thrusters add all commands",
        "error_p": "shown as a signal",
        "error_R": "shown as a signal",
        "pole_radius": "of metrics of the closed loop, which want damping_ratio and pole_frequency too",
        "damping_ratio": "see pole_radius",
        "pole_frequency": "see pole_radius",
        "slowest_decay": "a metric of the closed loop, besides those",
        "behaviour": "the scenario's parameter",
        **_BODY,
        "delay": "the sum of the scenario's delay and navigation_delay",
        "lag": "of the thrusters, as a controller may expect it",
    },
    remarks=_FRAMES,
)
_POSE = Place(
    required=_CONTROLLER.required,
    optional={name: text for name, text in _CONTROLLER.optional.items() if name != "behaviour"},
    remarks=_FRAMES,
)


def _thrusters(*controllers: str) -> Place:
    commands = {f"{what}_{name}": "" for name in controllers for what in ("f", "tau")}
    return Place(
        required={**commands, **_WRENCH, "saturated": "its share of the run is a metric"},
        optional={
            "propulsion": "the scenario's parameter",
            "flapper_range": "0 of a nozzle that is stuck",
        },
        remarks=_FRAMES,
    )


_ROBOT = Place(
    required={**_WRENCH, **_ON_GRIPPER, **_TRUTH, **_AT_GRIPPER},
    optional={
        **_BODY,
        "p_WB_0": "",
        "f_P": "a live page cannot push without it",
        "p_BP": "",
    },
    remarks=_FRAMES,
)
_NAVIGATION = Place(
    required=_ESTIMATE,
    optional={**_TRUTH, "seed": "follows from the run's seed"},
    remarks=_FRAMES,
)

PLACES_OF_PUSH = {
    "impedance": _CONTROLLER,
    "thrusters": _thrusters("impedance"),
    "push": Place(
        required=_ON_GRIPPER,
        optional=dict.fromkeys(("axis", "torque"), "the scenario's parameter"),
        remarks=_FRAMES,
    ),
    "robot": _ROBOT,
    "navigation": _NAVIGATION,
}
"""Of `FlyerImpedance`, by the units' names in the system."""

_ARM = {
    "joints": "the scenario's parameter",
    "link": "in B, as the scenario's factors make it",
    "mass_L": "as the scenario's factors make it",
    "I_L": "as the scenario's factors make it",
}

PLACES_OF_ARM_PUSH = {
    **PLACES_OF_PUSH,
    "impedance": Place(
        required={**_CONTROLLER.required, "tau_J_cmd": ""},
        optional={
            **_CONTROLLER.optional,
            **_ARM,
            "q_J": "",
            "v_J": "",
            "q_J_goal": "the scenario's parameter posture",
        },
        remarks=_FRAMES,
    ),
    "robot": Place(
        required={**_ROBOT.required, "tau_J": "", "q_J": "", "v_J": "", "w_WG": ""},
        optional={
            **_ROBOT.optional,
            **_ARM,
            "q_J_0": "the scenario's parameter posture",
            "friction_J": "the scenario's parameter friction",
            "f_Q": "a live page cannot push the gripper without it",
            "p_GQ": "",
        },
        remarks=_FRAMES,
    ),
}
"""Of `FlyerArmImpedance`, by the units' names in the system."""

PLACES_OF_HANDOVER = {
    "decision": Place(
        required={
            "impedance": "whether the unit impedance is to be active",
            "pose": "whether the unit pose is to be active",
            "p_WG_goal": "",
            "q_WG_goal": "",
            "closure": "",
            "light": "by it the person knows when to act",
            "phase": "by it the run is judged, and ends",
            "failed_receptions": "the person may be to feign some",
            "speed_G": "",
        },
        optional={
            **_ESTIMATE,
            "gripper_angle": "",
            "failed_deliveries": "a metric, 0 without it",
            **dict.fromkeys(("task", "behaviour"), "the scenario's, or its parameter's value"),
            "p_BG": "",
            "p_WO_0": "",
            "p_OG": "",
        },
        remarks=_FRAMES,
    ),
    "impedance": _CONTROLLER,
    "pose": _POSE,
    "thrusters": _thrusters("impedance", "pose"),
    "person": Place(
        required={
            **_ON_GRIPPER,
            **_MOTION,
            "closure": "",
            "light": "",
            "gripper_angle": "",
            "p_WO": "",
            "q_WO": "",
            "p_WH": "",
            "q_WH": "",
            "finger": "shown in space",
            "holder": "by it the run is judged",
            "f_H": "shown over time",
            "motion": "the scenario's",
            "object_with": "the scenario's",
        },
        optional={
            "v_WO": "",
            "activity": "by it, with f_H, the run says why a handover failed",
            **dict.fromkeys(
                ("p_WH_goal", "q_WH_goal", "finger_goal", "closed_goal"), "of what `handover flyer-track` writes"
            ),
            "motion_again": "the scenario's",
            "seed": "follows from the run's seed",
            "p_WO_0": "",
            "angle_0": "",
            **dict.fromkeys(
                ("driven_by", "track"),
                "of the scenario's parameters hand and hand_track; not set for a simulated person",
            ),
            **dict.fromkeys(
                ("p_WH_track", "q_WH_track", "finger_track", "closed_track", "age"),
                "from outside, with the scenario's parameter hand=outside",
            ),
            "effort": "the scenario's parameter strength",
            "arm_force_max": "follows from the scenario's parameter strength",
            **dict.fromkeys(("sight_error", "depth_error"), "the scenario's parameter, times what skill makes of it"),
            **dict.fromkeys(
                ("timing_error", "effort_spread", "haste", "reaction_time"),
                "follows from the scenario's parameter skill",
            ),
        },
        remarks=_FRAMES,
    ),
    "robot": Place(required={**_ROBOT.required, **_MOTION}, optional=_ROBOT.optional, remarks=_FRAMES),
    "navigation": _NAVIGATION,
}
"""Of the handovers, by the units' names in the system."""

_HANDOVER_OF = {
    "robot": PLACES_OF_HANDOVER["robot"],
    "navigation": _NAVIGATION,
    "impedance": _CONTROLLER,
    "pose": _POSE,
}


def _of_each(names: Mapping[str, str]) -> dict[str, str]:
    """Return ports of both robots by the names of one's."""
    return {f"{name}_{i}": text for i in (1, 2) for name, text in names.items()}


PLACES_OF_TEAM = {
    "decision": Place(
        required=_of_each(
            {
                "impedance": "whether the robot's unit impedance is to be active",
                "pose": "whether its unit pose is to be active",
                "p_WG_goal": "",
                "q_WG_goal": "",
                "closure": "",
                "light": "by both the person knows when to act",
                "phase": "by it the run is judged, and ends",
                "failed_receptions": "a metric",
                "speed": "by which a pull or push is felt",
            }
        ),
        optional={
            **_of_each({**_ESTIMATE, "gripper_angle": "", "failed_deliveries": "a metric, 0 without it"}),
            **dict.fromkeys(("task", "behaviour"), "the scenario's parameter, or follows from it"),
            "p_BG": "",
            "p_WO_0": "",
            "p_OG": "in the object's frame, the middle between its handles",
            "grip_spacing": "between the handles, along y of the object",
        },
        remarks=_FRAMES,
    ),
    **{f"{name}_{i}": place for i in (1, 2) for name, place in _HANDOVER_OF.items()},
    **{f"thrusters_{i}": _thrusters("impedance", "pose") for i in (1, 2)},
    "person": Place(
        required={
            **_of_each(
                {
                    **_ON_GRIPPER,
                    **_MOTION,
                    "closure": "",
                    "light": "",
                    "gripper_angle": "",
                    "p_WH": "",
                    "q_WH": "",
                    "finger": "shown in space",
                    "f_H": "",
                }
            ),
            "p_WO": "",
            "q_WO": "",
            "grippers_holding": "by it the run is judged",
            "hands_holding": "by it the run is judged",
            "motion": "follows from the scenario's parameter task",
            "object_with": "follows from the scenario's parameter task",
        },
        optional={
            "activity": "shown as a signal",
            "seed": "follows from the run's seed",
            "p_WO_0": "",
            "angle_0": "",
            "p_OG": "as the unit decision has it",
            "grip_spacing": "as the unit decision has it",
            **dict.fromkeys(("hands", "p_OH"), "follows from the scenario's parameter hands"),
            **dict.fromkeys(
                ("effort", "arm_force_max"), "follows from the scenario's parameter strength, of each hand"
            ),
            **dict.fromkeys(("sight_error", "depth_error"), "the scenario's parameter, times what skill makes of it"),
            **dict.fromkeys(
                ("timing_error", "reaction_time", "effort_spread", "haste"),
                "follows from the scenario's parameter skill",
            ),
        },
        remarks=_FRAMES,
    ),
}
"""Of `TwoRobots`, by the units' names in the system."""
