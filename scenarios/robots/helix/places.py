"""What a unit needs to take a place in the Helix handover, and what its author has to know of frames and signs."""

from dataclasses import replace

from handover.scenarios.experiment.places import Place

_BASE = (
    "W is the world: its origin is the arm's mount, z points up, x away from the cameras, y to their left. B is the "
    "arm's base frame, with z down along the hanging arm: R_WB = diag(1, -1, -1). The ring's frame R has z along "
    "the arm, away from the mount, and the gripper's frame G has z towards its tip. Vectors are in W where nothing "
    "else is said. Quaternions are scalar first, of the frame's orientation in W."
)
_CALIBRATION = {
    f"{what}_{side}": ""
    for side in ("left", "right", "third")
    for what in ("p_WC", "q_WC", "intrinsics", "distortion")
}  # fmt: skip
_THIRD = "with cameras=three alone"
_SEEN = {
    "p_WO_meas": "while it is not seen, the last one, zeros before any",
    "p_WR_meas": "the wrist carries the marker ring, at the end of the arm's centre line",
    "p_WG_meas": "the gripper is 0.1 m beyond the wrist, along the ring's axis",
    "seen_O": "in these pictures",
    "seen_R": "in these pictures",
}
_COVARIANCES = {
    "cov_O": "large while it is not seen",
    "cov_R": "large while it is not seen",
    "cov_G": "large while it is not seen",
}

_TUNED = dict.fromkeys(
    (
        *("threshold_grasp", "epsilon_pose_bound", "epsilon_control", "A_pose_upd", "settle_steps"),
        *("judge_apart", "windup", "follow_until", "lost_after", "use_covariance", "filter_pictures", "predict_motion"),
        *("shaping_time", "least_response", "posture", "standoff", "threshold_accept"),
        *("K_initialize", "gate", "Q_ball", "Q_wrist", "Q_direction"),
    ),
    "by the scenario's tuning",
)

_COVERS = dict.fromkeys(
    (
        *("cover_left_from", "cover_left_until", "cover_right_from", "cover_right_until"),
        *("hide_ball_from", "hide_ball_until"),
    ),
    "the scenario's disturbances",
)
_STIFFNESS = {
    "EA": "by the scenario's arm_stiffness",
    "EI": "by the scenario's arm_stiffness",
    "gripper_mass": "by the scenario's gripper_load",
}
_MOVES = {"p_WO_1": "", "move_for": "0 where the hand stays"}

PLACES = {
    "camera": Place(
        required={"left": "", "right": ""},
        optional={
            "backbone": "",
            "p_WR": "",
            "q_WR": "",
            "p_WG": "",
            "q_WG": "",
            "grip": "",
            "p_WO": "",
            "p_WH": "",
            "third": _THIRD,
            **_CALIBRATION,
            "seed": "follows from the run's seed",
            "decimation": "the unit is stepped so often",
            **_COVERS,
        },
        remarks=(_BASE, "In a camera's frame C, z is its direction of view, x points to the right and y down."),
    ),
    "vision": Place(
        required=_SEEN,
        optional={
            "left": "",
            "right": "",
            "third": _THIRD,
            **_COVARIANCES,
            **dict.fromkeys(_CALIBRATION, "as the clicks of the calibration give it"),
            "decimation": "the unit is stepped so often",
        },
        remarks=(_BASE, "Without covariances, those that the controller gets are zeros."),
    ),
    "servo": Place(
        required={
            "dl_t": "three tendons of each segment, base segment first, at the angles 0, 120 and 240 degrees from x of "
            "B towards y of B. A shorter tendon (a negative change) bends its segment towards its angle: at 120 "
            "degrees towards +y of B, which is -y of W. All three together change the segment's length",
        },
        optional={
            "closure": "the person lets go once the gripper has closed around the ball",
            **_SEEN,
            **_COVARIANCES,
            "phase": "by it, time and success of the handover are judged: it fails in GIVEN_UP",
            "error": "shown, and by it the run says how near the arm came",
            "verdict": "part of the reason why the run failed",
            "tilt": "shown as a signal",
            "q_est": "shown as a signal",
            "q_sys": "compared with p_WG_est as the gripper begins to close, as in fig. 9 of the thesis",
            "p_WO_est": "shown in plots, pictures and replay",
            "p_WR_est": "shown in pictures",
            "p_WG_est": "shown in plots, pictures and replay",
            "control_period": "the unit is stepped so often; by it, control steps are counted",
            "adaptive_step": "the scenario's step_rule",
            "seed": "follows from the run's seed",
            **_TUNED,
        },
        advised=("closure",),
        remarks=(
            _BASE,
            "Calibrated, the arm hangs straight with segments of 0.12, 0.24 and 0.24 m, tendons 0.035 m from its "
            "axis; the gripper is 0.1 m beyond. Dx and Dy are a segment's rotation, rad, towards x and y of B, and l "
            "is its length, m. The tendon at angle s has the length l - 0.035 (Dx cos s + Dy sin s).",
            "Without phase, the gripper itself gives when it begins to close (closure above 0) and when it has "
            "closed. Without error, the distance of gripper and ball takes its place. Without closure the gripper "
            "stays open.",
        ),
    ),
    "arm": Place(
        required={
            "dl_t": "as the controller commands it: see the place servo",
            "p_WR": "",
            "q_WR": "",
            "p_WG": "",
            "q_WG": "",
            "backbone": "",
            "grip": "",
        },
        optional={
            "closure": "",
            "f_G": "by it a person guides the gripper",
            "f_P": "a live page cannot push without it",
            "tension": "shown over time",
            **_STIFFNESS,
        },
        remarks=(_BASE,),
    ),
    "hand": Place(
        required={
            "p_WO": "",
            "p_WH": "",
            "holder": "it is a success if GRIPPER has the ball at the end",
            "p_WO_0": "where the scenario offers the ball",
        },
        optional={
            "f_G": "",
            "f_H": "by it the run says how hard the hand was pressed",
            "p_WG": "",
            "q_WG": "",
            "grip": "",
            "seed": "follows from the run's seed",
            **_MOVES,
        },
        remarks=(_BASE,),
    ),
}
"""By the units' names in the system."""


def _without(place: Place, *names: str) -> Place:
    """Return a place without some optional ports and parameters."""
    return replace(place, optional={name: text for name, text in place.optional.items() if name not in names})


REACH_PLACES = {
    "servo": replace(
        PLACES["servo"],
        optional={
            **_without(PLACES["servo"], *_TUNED, "q_sys", "adaptive_step", "control_period", "seed").optional,
            "threshold_accept": "0: near is not there",
        },
    ),
    "arm": _without(PLACES["arm"], *_STIFFNESS),
    "hand": replace(
        PLACES["hand"],
        optional={
            **_without(PLACES["hand"], *_MOVES, "seed").optional,
            "room": "0: the hand does not wait",
            "tremor_rms": "0",
            "drift_rms": "0",
        },
    ),
}
"""By the units' names where no camera looks and the hand is still."""

AS_IN_HANDOVER = "as helix_handover has it by default"
"""Of parameters that `helix_handover` has and a scenario that is made of it has not."""

_FINGERS = {
    "p_WG": "",
    "q_WG": "",
    "grip": "",
    "p_WO": "",
    "p_WH": "",
    "seed": "follows from the run's seed",
}
_CORRECTED = {
    "p_WO": "where the servo is to take the ball to be",
    "p_WR": "where the servo is to take the wrist to be",
    "p_WG": "where the servo is to take the gripper to be",
    "known_O": "whether the servo is to take p_WO",
    "known_R": "whether the servo is to take p_WR and p_WG",
}
_NEAR = {
    "cover_within": "the scenario's near, with cameras=covered",
    "hide_ball_within": "the scenario's near, with cameras=ball_hidden",
}


def _as_in_handover(name: str) -> Place:
    place, names = PLACES[name], {*_TUNED, *_COVERS, *_STIFFNESS, "adaptive_step"}
    given = {n: AS_IN_HANDOVER if n in names else text for n, text in place.optional.items()}
    return replace(place, optional=given)


REFLEX_PLACES = {
    **PLACES,
    **{name: _as_in_handover(name) for name in ("servo", "arm")},
    "camera": replace(_as_in_handover("camera"), optional={**_as_in_handover("camera").optional, **_NEAR}),
    "fingers": Place(
        required={
            "ticks": "of 12-bit converters. Those that look across look to the gripper's axis. The fingers are at 60, "
            "180 and 300 degrees from x of G towards y"
        },
        optional=_FINGERS,
        remarks=(_BASE,),
    ),
    "reflex": Place(
        required=_CORRECTED,
        optional={
            **_SEEN,
            **_COVARIANCES,
            "P_O": "",
            "P_R": "",
            "P_G": "",
            "ticks": "of the fingers' sensors; see the place fingers",
            "grip": "",
            "dl_t": "see the place servo",
            "q_est": "of the servo: Dx, Dy (rad) and l (m) of each segment, base segment first",
            "p_GO_est": "compared with the ball's true place, and shown",
            "source": "shown over time",
            "deviation": "shown over time",
            "reflectivity": "shown as a signal",
            "sensors": "shown as a signal",
        },
        remarks=(_BASE,),
    ),
}
"""By the units' names in the grasp by infrared reflex."""
