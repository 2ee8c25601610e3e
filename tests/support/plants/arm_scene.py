"""Arms for tests: three skewed links on a skewed base, and the model of the same in MuJoCo's language."""

import math

import numpy as np
from scipy.spatial.transform import Rotation

from handover.cosim.blocks.plain_rotation import quaternion
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


def mujoco_model(arm: Arm) -> str:
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
        '<mujoco><option timestep="0.001" gravity="0 0 0" integrator="RK4"/><worldbody>'
        f'{opened}<site name="G" pos="{_text(place)}"/>{closed}</worldbody></mujoco>'
    )


def _text(v: object) -> str:
    return " ".join(str(x) for x in np.asarray(v).tolist())
