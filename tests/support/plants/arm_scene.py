"""Arms for tests: three skewed links on a skewed base, and the model of the same in MuJoCo's language."""

import math
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from handover.cosim.blocks.plain_rotation import quaternion
from handover.cosim.blocks.ports import Floats
from handover.plants.free_flyer.robot.arm import Arm, Joints
from handover.plants.free_flyer.robot.articulated_body import ArticulatedBody
from handover.plants.free_flyer.robot.stopping_joints import JointLimits, StoppingJoints

MASS = 9.584
SKEWED = np.array([[0.1534, 0.01, -0.02], [0.01, 0.1427, 0.005], [-0.02, 0.005, 0.1623]])
Q_WB = quaternion(np.asarray(Rotation.from_euler("xyz", [0.4, -0.9, 2.0]).as_quat(scalar_first=True)))


def skewed_arm(n: int = 3) -> Arm:
    axes = np.array([[0.0, 1.0, 0.0], [0.0, 0.6, 0.8], [1.0, 0.0, 0.0]])
    links = np.array([[-0.1, 0.0, 0.02], [-0.05, 0.01, 0.0], [-0.05, 0.03, 0.02]])
    inertias = np.array([[0.02, 0.025, 0.02], [0.013, 0.011, 0.006], [0.002, 0.002, 0.003]])
    centres, masses, rotors = np.array([0.5, 0.4, 0.6]), np.array([0.4, 0.3, 0.2]), np.array([0.01, 0.0, 0.003])
    return Arm.of(n, np.array([-0.3, 0.02, 0.05]), axes, links, centres, masses, inertias, rotors)


def limits(n: int, reach: float = math.inf, friction: float = 0.0, drag: float = 0.0) -> JointLimits:
    return JointLimits((-reach,) * n, (reach,) * n, (friction,) * n, (drag,) * n)


def tumbling(within: JointLimits, q_J: Joints = (0.3, -0.4, 0.8)) -> StoppingJoints:
    body = ArticulatedBody(MASS, SKEWED, skewed_arm(len(q_J)))
    return StoppingJoints(body, within, q_J, ((0.3, 0.1, -0.2), Q_WB), ((0.1, -0.2, 0.05), (0.5, -0.3, 0.8)))


def mujoco_course(
    q_J: Joints, start: "tuple[Floats, Floats]", push: tuple[Any, Any, Any, Any], tau_J: Joints, steps: int, dt: float
) -> "tuple[Floats, list[Floats]]":
    """Return coordinates at the end, and G's place after each step of four of MuJoCo's; start is p_WB and v, w, v_J."""
    mujoco: Any = pytest.importorskip("mujoco")
    n, (f_B, tau_B, f_G, tau_G) = len(q_J), push
    model = mujoco.MjModel.from_xml_string(_mujoco_model(skewed_arm(n), dt / 4))
    data, places = mujoco.MjData(model), list[Floats]()
    (p_WB, velocities), R_WB = start, Rotation.from_quat(Q_WB, scalar_first=True)
    data.qpos[:] = [*p_WB, *Q_WB, *q_J]
    data.qvel[:] = [*velocities[:3], *R_WB.apply(velocities[3:6], inverse=True), *velocities[6:]]

    def pushed(_: Any, now: Any) -> None:
        R = now.xmat[1].reshape(3, 3)
        now.xfrc_applied[1] = [*(R @ f_B), *(R @ tau_B)]
        now.qfrc_applied[:] = [0.0] * 6 + [*tau_J]
        mujoco.mj_applyFT(model, now, np.array(f_G), np.array(tau_G), now.site_xpos[0], n + 1, now.qfrc_applied)

    mujoco.set_mjcb_control(pushed)
    try:
        for _ in range(steps):
            mujoco.mj_step(model, data, nstep=4)
            mujoco.mj_kinematics(model, data)
            places.append(data.site_xpos[0].copy())
    finally:
        mujoco.set_mjcb_control(None)
    return data.qpos.copy(), places


def _mujoco_model(arm: Arm, step: float) -> str:
    """Return base and arm in MuJoCo's language, with a site G."""
    inertia = " ".join(f"{SKEWED[i, j]}" for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)))
    opened = f'<body><freejoint/><inertial pos="0 0 0" mass="{MASS}" fullinertia="{inertia}"/>'
    place = arm.root
    for j, link in enumerate(arm.links):
        centre = arm.centres[j] * np.array(link)
        opened += (
            f'<body pos="{_text(place)}"><joint type="hinge" axis="{_text(arm.axes[j])}" armature="{arm.rotors[j]}"/>'
            f'<inertial pos="{_text(centre)}" mass="{arm.masses[j]}" diaginertia="{_text(arm.inertias[j])}"/>'
        )
        place = link
    closed = "</body>" * (len(arm.links) + 1)
    return (
        f'<mujoco><option timestep="{step}" gravity="0 0 0" integrator="RK4"/><worldbody>'
        f'{opened}<site name="G" pos="{_text(place)}"/>{closed}</worldbody></mujoco>'
    )


def _text(v: object) -> str:
    return " ".join(str(x) for x in np.asarray(v).tolist())
