"""Parameters and measurements of the visual servo, and what is wrong with the former. [Vervloet2025] appendix A."""

import math
from dataclasses import dataclass, fields

import numpy as np

from handover.cosim.blocks.block import InvalidParameters
from handover.cosim.blocks.origins import assumed, derived, stated
from handover.cosim.blocks.ports import Matrix3, Vector3, Vector6, Vector9, parameter, port
from handover.cosim.blocks.start_values import parameter_faults
from handover.cosim.blocks.units import Metre, Number, Radian, Second, SquareMetre

_APPENDIX = stated("appendix A")

_ROTATIONS, _LENGTHS = slice(0, None, 2), slice(1, None, 2)  # in q_DL, eq. (8)


class InvalidServoParameters(InvalidParameters):
    """Values with which the visual servo cannot work; `faults` lists all of them."""

    block = "VisualServo"


@dataclass(frozen=True, kw_only=True)
class Params:
    """Values of appendix A and eq. (11); a description that says own (choice) tells the stated value, if any.

    The estimate lies epsilon_pose_bound off the measurement, on the command's side. A Jacobian loop that a smaller
    epsilon_control keeps iterating takes that offset back from the command, period by period. So the command does not
    wind up while slack tendons keep it from the arm, but the loop stalls where the error falls to epsilon_pose_bound /
    alpha: the stated 0.005 m with alpha = 0.1 stalls at the stated threshold, 0.05 m. As stated, epsilon_control is the
    same, so that the last digits decide whether the loop continues, and with alpha = 0.1 how many steps it takes.
    Lengths weigh more than stated in the estimate, since a metre is a lot more than a radian: equal weights explain a
    sagging arm by segments of half their length.

    The stated filters know nothing of the pictures' exactness: the wrist's lags by about three control periods. Here
    each measurement has its own covariance (`use_covariance`), and every picture counts (`filter_pictures`). As stated,
    one error is the norm over wrist and gripper; here position and tilt are judged apart (`judge_apart`), and the tilt
    weighs less the longer the position makes no progress, so that a tilt which cannot be reached keeps the gripper from
    no ball. As stated, the command stands while the gripper closes; here the arm follows the ball (`follow_until`).

    A hanging arm swings once a second, for long: averaged over that time (`shaping_time`), a command excites no swing.
    Lengths are stiffer than stated (`K_initialize`), since a longer segment's tendons go slack, and where the goal
    leaves it open, segments are shortened (`posture`), which tightens them. Where tendons are slack, the arm makes only
    a part of the commanded motion; the step is divided by that part (`least_response`).
    """

    control_period: Second = parameter(
        0.5,
        "time between two updates of the command (own; thesis: 1.45)",
        minimum=0.01,
        maximum=60.0,
        origin=assumed(
            "the thesis's loop took 1.45 s of computing a step (table 1, alpha 0.4); this one needs a hundredth of that"
        ),
    )
    jitter: Number = parameter(
        0.0,
        "largest deviation of a control period, drawn evenly, as a part of it (own choice)",
        minimum=0.0,
        maximum=0.9,
        origin=assumed("a period that is kept; the thesis's deviates by 0.02 to 0.18 s (table 1)"),
    )
    seed: int = parameter(0, "seed of the jitter", minimum=0)
    alpha: Number = parameter(
        0.25,
        "step size of the Jacobian control, eq. (21): part of the way to the goal in a control period",
        minimum=0.0,
        maximum=1.0,
        origin=assumed("with control_period half of the way in a second: the averaged command trails by half a second"),
    )
    adaptive_step: bool = parameter(
        False,
        "let the step grow with the error e: min(0.8, max(alpha, 0.8 e / (e + 0.08 m))) (own choice)",
        origin=stated("sec. 5.4.4: the step sizes were constant"),
    )
    d_gripper: Metre = parameter(
        0.10, "distance of wrist and gripper", minimum=0.0, origin=stated("sec. 3.2.4, appendix A")
    )
    d: Metre = parameter(
        0.035,
        "distance of the tendons from the axis (own choice)",
        minimum=0.0,
        origin=assumed("not given: radius on which the tendons lie"),
    )
    l_calib: Vector3[Metre] = parameter(
        np.array([0.12, 0.24, 0.24]), "segment lengths after calibration", minimum=0.0, origin=stated("sec. 3.1")
    )
    L_sys_LB: Vector6[Number] = parameter(
        np.array([0.0, 0.08, 0.0, 0.16, 0.0, 0.16]),
        "lower bounds of d_1, l_1, d_2, l_2, d_3, l_3 (rad, m)",
        minimum=0.0,
        origin=stated("eq. (11): d_1, l_1, d_2, l_2, d_3, l_3, in rad and m"),
    )
    L_sys_UB: Vector6[Number] = parameter(
        np.array([math.pi / 4, 0.14, math.pi / 2, 0.26, math.pi / 2, 0.26]),
        "upper bounds of d_1, l_1, d_2, l_2, d_3, l_3 (rad, m)",
        minimum=0.0,
        origin=stated("eq. (11): d_1, l_1, d_2, l_2, d_3, l_3, in rad and m"),
    )
    A_pose_upd: Vector9[Number] = parameter(
        np.array([1.0, 1.0, 5.0, 1.05, 1.05, 5.25, 1.1, 1.1, 5.5]),
        "weight of each state's distance from the command in the estimate (own; thesis: lengths 1, 1.05, 1.1)",
        minimum=0.0,
        origin=assumed(
            "the thesis's, lengths weighted five times more: as stated, sag is explained by segments of "
            "half their length"
        ),
    )
    K_initialize: Vector9[Number] = parameter(
        np.array([0.2, 0.2, 10.0, 0.1, 0.1, 5.0, 0.1, 0.1, 5.0]),
        "virtual stiffness (diagonal; own; thesis: lengths 2, 1, 1)",
        minimum=0.0,
        origin=assumed("the thesis's, lengths five times stiffer: longer segments have slack tendons"),
    )
    epsilon_pose_bound: Metre = parameter(
        0.0001,
        "distance of the estimate's pose from the measured one (own; thesis: 0.005)",
        minimum=0.0,
        origin=assumed(
            "the loop stalls at epsilon_pose_bound / alpha, and the cameras know the gripper to less than a millimetre"
        ),
    )
    bound_by_covariance: bool = parameter(
        False,
        "that bound is the standard deviation of the filtered pose instead, sec. 5.4.3 (thesis: false)",
        origin=stated("sec. 5.4.3: epsilon_pose_bound is a fixed value"),
    )
    weight_fall: Number = parameter(
        0.0,
        "c of the weights A_pose_upd / (1 + c (max(0, l / l_calib - 1) + bending of it and those above, rad)), "
        "sec. 5.4.3 (thesis: 0)",
        minimum=0.0,
        maximum=10.0,
        origin=stated("sec. 5.4.3: A_pose_upd is fixed"),
    )
    epsilon_control: Metre = parameter(
        0.0001,
        "error at which the Jacobian loop ends (own; thesis: 0.005)",
        minimum=0.0,
        origin=assumed("as epsilon_pose_bound"),
    )
    N_max_iter: int = parameter(20, "iterations of the Jacobian loop at most", minimum=1, origin=_APPENDIX)
    threshold: Metre = parameter(
        0.05,
        "error at which the arm has reached the place above the ball",
        minimum=0.0,
        origin=stated(
            "appendix A, epsilon_threshold; the norm, as secs. 3.4 and 3.5 have it (algorithm 3 prints its square)"
        ),
    )
    threshold_grasp: Metre = parameter(
        0.003,
        "error at which the gripper closes (own; thesis: 0.05)",
        minimum=0.0,
        origin=assumed("some times what a hand trembles"),
    )
    settle_steps: int = parameter(
        2,
        "control steps in a row below threshold_grasp before the gripper closes (own; thesis: 1)",
        minimum=1,
        origin=assumed("so that an arm that swings through the ball does not close"),
    )
    judge_apart: bool = parameter(
        True,
        "the error is that of the gripper's position, and its tilt is judged by itself (own; thesis: false)",
        origin=assumed("a tilt that cannot be reached keeps the gripper from no ball"),
    )
    threshold_tilt: Radian = parameter(
        0.6,
        "tilt of the gripper from straight down at which it still closes, where it is judged apart (own choice)",
        minimum=0.0,
        maximum=math.pi,
        origin=assumed("own choice: with which fingers around a ball still close on it"),
    )
    tilt_weight: Number = parameter(
        0.02,
        "weight of the tilt's error beside the position's, where they are judged apart (own choice)",
        minimum=0.001,
        maximum=1.0,
        origin=assumed("own choice: a goal is met in position first"),
    )
    damping: Metre = parameter(
        0.02,
        "error of position that weighs as much as a change dq of the state with dq^T K dq = 1, where position and tilt "
        "are judged apart (own choice)",
        minimum=1e-6,
        maximum=1.0,
        origin=assumed("own choice: some centimetres of an error that cannot be met do not let the state grow"),
    )
    shaping_time: Second = parameter(
        1.0,
        "time over which the command is averaged, as long as the arm swings once, so that it does not swing; 0: none "
        "(own; thesis: 0)",
        minimum=0.0,
        maximum=5.0,
        origin=assumed("the hanging arm swings once a second"),
    )
    least_response: Number = parameter(
        0.3,
        "where the arm makes a part of the commanded motion, the step is divided by it, down to this; 1: never (own "
        "choice; thesis: 1)",
        minimum=0.01,
        maximum=1.0,
        origin=assumed("an arm with slack tendons makes a tenth to a half of what it is commanded to"),
    )
    posture: Number = parameter(
        0.5,
        "part of the way to l_preferred that a control step takes where the goal leaves it open (own; thesis: 0)",
        minimum=0.0,
        maximum=1.0,
        origin=assumed("shorter segments have taut tendons"),
    )
    l_preferred: Vector3[Metre] = parameter(
        np.array([0.09, 0.18, 0.18]),
        "segment lengths that keep the tendons taut (own choice)",
        minimum=0.0,
        origin=assumed("three quarters of l_calib, within eq. (11): shorter segments have taut tendons"),
    )
    windup: Metre = parameter(
        0.7,
        "largest distance of the commanded state's gripper from the measured one; 0: any (own; thesis: 0)",
        minimum=0.0,
        origin=assumed("more than an arm sags within reach, less than a wound-up command runs ahead"),
    )
    follow_until: Number = parameter(
        0.95,
        "part of closing_time for which the arm follows the ball while the gripper closes (own; thesis: 0)",
        minimum=0.0,
        maximum=1.0,
        origin=assumed("until the fingers are near the ball"),
    )
    threshold_reopen: Metre = parameter(
        0.04,
        "error at which a gripper that closes and follows opens again and comes from above (own choice)",
        minimum=0.0,
        origin=assumed("own choice: a ball so far from closing fingers was moved"),
    )
    lost_after: Second = parameter(
        2.5,
        "time without ring or ball after which the arm goes back and searches; 0: it waits (own; thesis: 0)",
        minimum=0.0,
        origin=assumed("five control periods"),
    )
    search_steps: int = parameter(
        60,
        "control steps of going back and searching at most (own choice)",
        minimum=1,
        origin=assumed("own choice: half a minute"),
    )
    threshold_retreat: Metre = parameter(
        0.16,
        "error at which the arm, coming down, returns above the ball (own choice)",
        minimum=0.0,
        origin=assumed("own choice: more than the error when the goal changes, threshold + sqrt(2) d_grasp_offset"),
    )
    d_grasp_offset: Metre = parameter(
        0.05, "height of the first goal above the ball", minimum=0.0, origin=stated("sec. 3.5, appendix A")
    )
    standoff: Metre = parameter(
        0.10,
        "distance beside the ball at which a gripper that is too low rises before it comes over it; 0: never (own)",
        minimum=0.0,
        maximum=0.3,
        origin=assumed("open fingers reach 5 cm from the gripper's axis, the ball 2.5 cm from its middle"),
    )
    closing_time: Second = parameter(
        10.0, "time that the gripper is given to close", minimum=0.0, origin=stated("sec. 3.5, 4.1")
    )
    delivers: bool = parameter(
        False,
        "carry the ball to p_WG_drop and let it fall there (own choice)",
        origin=derived("sec. 3.5.1: the first experiment ends with the grip; sec. 3.5.3 is helix_use_case"),
    )
    p_WG_drop: Vector3[Metre] = parameter(
        np.array([0.0, -0.16, -0.64]),
        "where the gripper lets the ball fall, in the world (own choice)",
        origin=derived("drop_height above the bowl of helix_use_case, which sets it"),
    )
    carry_after: Second = parameter(
        1.5,
        "time after closing for which the arm waits before it carries the ball away (own choice)",
        minimum=0.0,
        origin=assumed("the hand withdraws for a second"),
    )
    threshold_drop: Metre = parameter(
        0.015,
        "error at which the gripper opens above the place (own; thesis: 0.05)",
        minimum=0.0,
        origin=assumed("by tuning: ours, and the thesis's, whose only threshold is epsilon_threshold"),
    )
    patience: int = parameter(
        60,
        "control steps without progress before the arm gives up (own choice)",
        minimum=1,
        origin=assumed("own choice: half a minute"),
    )
    threshold_accept: Metre = parameter(
        0.01,
        "error at which the gripper closes where it makes no more progress; 0: it gives up (own; thesis: 0)",
        minimum=0.0,
        origin=assumed("less than the 15 mm beside the ball from which the fingers still take it"),
    )
    progress: Metre = parameter(
        0.001,
        "change of the error that is progress (own choice)",
        minimum=0.0,
        origin=assumed("own choice: what a hand trembles is not progress"),
    )
    max_steps: int = parameter(
        1000,
        "control steps before the arm gives up (own choice)",
        minimum=1,
        origin=assumed("own choice: far more than the scenarios' patience of 60 s lets be"),
    )
    P_init: SquareMetre = parameter(
        2000.0, "variance of all three filters before the first measurement", minimum=0.0, origin=_APPENDIX
    )
    Q_ball: SquareMetre = parameter(
        1e-6,
        "ball filter: variance that a control period adds (own; thesis: 0.1)",
        minimum=0.0,
        origin=assumed("1 mm in a control period: drift of a hand"),
    )
    R_ball: SquareMetre = parameter(
        0.01, "ball filter: variance of a measurement, without covariances", minimum=0.0, origin=_APPENDIX
    )
    Q_wrist: SquareMetre = parameter(
        4e-5,
        "wrist filter: variance that a control period adds (own; thesis: 0.01)",
        minimum=0.0,
        origin=assumed("6 mm in a control period: what J dq leaves unpredicted"),
    )
    R_wrist: SquareMetre = parameter(
        0.1, "wrist filter: variance of a measurement, without covariances", minimum=0.0, origin=_APPENDIX
    )
    Q_direction: SquareMetre = parameter(
        4e-5,
        "gripper direction filter: variance a control period adds (own; thesis: 0.1)",
        minimum=0.0,
        origin=assumed("6 mm in a control period: what J dq leaves unpredicted"),
    )
    R_direction: SquareMetre = parameter(
        0.01, "gripper direction filter: variance of a measurement, without covariances", minimum=0.0, origin=_APPENDIX
    )
    use_covariance: bool = parameter(
        True,
        "take the measurements' covariances for R (own; thesis: false); then Q wants to be of their size",
        origin=assumed("the vision knows how exact each measurement is"),
    )
    ball_motion: Metre = parameter(
        0.0006,
        "standard deviation, along an axis, of a ball's tremor, which is not motion to follow (own choice)",
        minimum=0.0,
        origin=derived("tremor_rms / sqrt(3), of the plant's hand: as if the controller knew how a hand trembles"),
    )
    filter_pictures: bool = parameter(
        True,
        "filter in every step, not once a control period (own; thesis: false)",
        origin=assumed("every picture counts"),
    )
    predict_motion: bool = parameter(
        True,
        "expect the arm to move as commanded (own; thesis: false)",
        origin=assumed("an arm that is commanded moves"),
    )
    response_time: Second = parameter(
        0.15,
        "time in which most of a commanded motion comes (own choice)",
        minimum=0.001,
        origin=assumed("own choice: about the lag of motors and arm"),
    )
    gate: Number = parameter(
        8.0,
        "standard deviations from what is expected beyond which a measurement is refused; 0: none (own; thesis: 0)",
        minimum=0.0,
        origin=assumed("standard deviations; refuses fits of the ring that are centimetres off"),
    )
    gate_steps: int = parameter(
        4,
        "measurements in a row that are refused before one is taken (own choice)",
        minimum=1,
        origin=assumed("own choice: as many pictures in a row, 0.4 s"),
    )

    def check(self) -> None:
        """Raise InvalidServoParameters, with all faults, if the servo cannot work with these values."""
        faults = parameter_faults(self) or self._zero_faults() + self._limit_faults() + self._threshold_faults()
        if faults:
            raise InvalidServoParameters(faults)

    def _zero_faults(self) -> list[str]:
        values = {f.name: getattr(self, f.name) for f in fields(self)}
        positive = ["alpha", "d_gripper", "d", "l_calib", "A_pose_upd", "K_initialize"]
        positive += ["epsilon_pose_bound", "epsilon_control", "threshold", "threshold_grasp", "threshold_drop"]
        positive += [n for n in values if n.startswith(("P_", "Q_", "R_"))]
        return [f"{n} = {_text(values[n])} must be positive" for n in positive if np.any(np.asarray(values[n]) <= 0.0)]

    def _limit_faults(self) -> list[str]:
        LB, UB, l = self.L_sys_LB, self.L_sys_UB, self.l_calib
        names = ["d_1", "l_1", "d_2", "l_2", "d_3", "l_3"]
        faults = [f"limits of {n}: lower {a} > upper {b}" for n, a, b in zip(names, LB, UB, strict=True) if a > b]
        if np.any(LB[_ROTATIONS] != 0.0):
            faults.append(f"L_sys_LB: rotations d_i have the lower bound 0, not {_text(LB[_ROTATIONS])}")
        if np.any(UB[_ROTATIONS] <= 0.0) or np.any(LB[_LENGTHS] <= 0.0):
            faults.append("L_sys_UB of the rotations and L_sys_LB of the lengths must be positive")
        if np.any(l < LB[_LENGTHS]) or np.any(l > UB[_LENGTHS]):
            within = f"{_text(LB[_LENGTHS])} .. {_text(UB[_LENGTHS])}"
            faults.append(f"l_calib = {_text(l)} is outside the limits of the lengths, {within}")
        return faults

    def _threshold_faults(self) -> list[str]:
        points, factor = ("the gripper", 1.0) if self.judge_apart else ("wrist and gripper", math.sqrt(2.0))
        after_switch = self.threshold + factor * self.d_grasp_offset
        faults: list[str] = []
        if self.threshold_retreat <= after_switch:
            law = "threshold + d_grasp_offset" if self.judge_apart else "threshold + sqrt(2) d_grasp_offset"
            faults.append(
                f"threshold_retreat = {self.threshold_retreat} must exceed {law} = {after_switch:.4g}, the largest "
                f"error, over {points}, when the goal changes to the ball, or the arm rises at once"
            )
        if self.threshold_retreat <= self.threshold_grasp:
            faults.append(
                f"threshold_retreat = {self.threshold_retreat} must exceed threshold_grasp = {self.threshold_grasp}"
            )
        if self.follow_until > 0.0 and self.threshold_reopen <= self.threshold_grasp:
            faults.append(
                f"threshold_reopen = {self.threshold_reopen} must exceed threshold_grasp = {self.threshold_grasp}, or "
                "the gripper opens as soon as it closes"
            )
        return faults


def _text(value: object) -> str:
    return str(np.asarray(value).tolist())


@dataclass(kw_only=True)
class Inputs:
    """Measurements, in W; one that is not seen is ignored."""

    p_WO_meas: Vector3[Metre] = port(np.zeros(3), "measured position of the ball")
    p_WR_meas: Vector3[Metre] = port(np.zeros(3), "measured position of the wrist")
    p_WG_meas: Vector3[Metre] = port(np.zeros(3), "measured position of the gripper")
    cov_O: Matrix3[SquareMetre] = port(np.zeros((3, 3)), "covariance of p_WO_meas")
    cov_R: Matrix3[SquareMetre] = port(np.zeros((3, 3)), "covariance of p_WR_meas")
    cov_G: Matrix3[SquareMetre] = port(np.zeros((3, 3)), "covariance of p_WG_meas")
    seen_O: bool = port(False, "the ball is seen")
    seen_R: bool = port(False, "the marker ring is seen, and so wrist and gripper")
