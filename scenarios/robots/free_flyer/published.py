"""The thesis's results for pushes and handovers with given parameters. [Fernandes2020] sec. 4.1, 4.3."""

from collections.abc import Sequence

import numpy as np

from handover.scenarios.experiment.paper import PublishedValue
from handover.scenarios.robots.free_flyer.parameters import HandoverParameters, ImpedanceParameters, Propulsion, Wrench

_PAPER = "free_flyer"


def published_of_push(p: ImpedanceParameters) -> Sequence[PublishedValue]:
    """Return the bounds of how far robot and impedance model differ; nothing for other pushes than the published."""
    default = ImpedanceParameters()
    same = p.force == default.force if p.kind is Wrench.FORCE else p.torque == default.torque
    if not same or p.propulsion is not Propulsion.IDEAL or p.delay or p.navigation_delay or not p.is_published:
        return ()
    note = "over all pushes and twists; how long they lasted is not stated"
    return [
        PublishedValue(
            metric=f"disagreement_{what}",
            paper=_PAPER,
            name="model_agreement",
            index=(k,),
            relation="at most",
            note=note,
        )
        for k, what in enumerate(("position", "orientation"))
    ]


def published_of_giving(p: HandoverParameters) -> Sequence[PublishedValue]:
    """Return the published values of handovers from robot to human at the published place."""
    if not _is_published(p):
        return ()
    return [
        PublishedValue(
            metric="transfer_displacement_z",
            paper=_PAPER,
            name="transfer_displacement_z",
            index=(int(p.behaviour),),
            note=f"of one run of the {p.behaviour.item} robot; how strongly the person pulled is not stated",
        ),
        _threshold(p, "velocity_hand"),
        PublishedValue(
            metric="phase_move_to_handover",
            paper=_PAPER,
            name="fetched",
            note="the object's first place is not stated; it was chosen such that the robot has it about then",
        ),
    ]


def published_of_receiving(p: HandoverParameters) -> Sequence[PublishedValue]:
    """Return the published values of handovers from human to robot at the published place."""
    return [_threshold(p, "velocity_gripper")] if _is_published(p) else ()


def _threshold(p: HandoverParameters, name: str) -> PublishedValue:
    return PublishedValue(
        metric="transfer_speed",
        paper=_PAPER,
        name=name,
        index=(int(p.behaviour),),
        relation="above",
        note=f"the {p.behaviour.item} robot's threshold, which is the thesis's here too",
    )


def _is_published(p: HandoverParameters) -> bool:
    return p.is_published and np.array_equal(p.p_WG_handover, HandoverParameters().p_WG_handover)
