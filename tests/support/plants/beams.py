"""The chain as a straight beam in a wall, and where it rests."""

from handover.plants.vsl.chain import Pose, VslChain
from handover.plants.vsl.parameters import Link, Params
from handover.plants.vsl.statics import VslStatics

STIFF = 1e11
ONE_LINK = Params(
    link_2=Link.RIGID,
    EI_rigid=1e9,
    cap=0.0,
    link_mass=0.0,
    servo_mass=0.0,
    gripper_mass=0.0,
    joint_stiffness=STIFF,
    servo_stiffness=STIFF,
)
"""Link 2 does not give: what does is link 3, a straight beam in a wall."""


def rest(params: Params, theta: tuple[float, ...], p: float, load: float, hinges: int = 6) -> tuple[VslChain, Pose]:
    chain = VslChain(params, hinges)
    statics = VslStatics(chain, params.gravity, 1.0 / params.servo_stiffness)
    statics.settle(theta, (p,) * params.links, load)
    return chain, statics.pose


def tip(params: Params, theta: tuple[float, ...], p: float, load: float, hinges: int = 6) -> complex:
    chain, pose = rest(params, theta, p, load, hinges)
    return complex(chain.ends(pose)[-1])
