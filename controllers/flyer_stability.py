"""Whether a free-flyer's control loop is stable at its rate and delay, and what would make it so."""

import math
from collections.abc import Callable

from handover.controllers.flyer_body import FlyerBody
from handover.controllers.sampled_loop import LinearController, SampledLoop, largest_stable
from handover.cosim.blocks.block import Refusal

_LONGEST_DELAY = 0.5  # s, up to which a stable one is looked for


class UnusableController(Refusal):
    """A controller that cannot work as its parameters have it; `faults` lists all of them."""

    def __init__(self, block: str, faults: list[str]) -> None:
        self.block = block
        super().__init__(faults)


def stability_faults(
    body: FlyerBody, law: Callable[[float], LinearController], period: float, delay: float, lag: float
) -> list[str]:
    """Return nothing for a stable loop, else what is wrong and by how much delay or gains must shrink.

    Args:
        body: the robot.
        law: makes the controller with all of its gains times a factor.
        period: time between two samples, s.
        delay: time from a measurement to the command's arrival at the propulsion, s.
        lag: time constant of the propulsion, s.
    """
    times = (("delay", delay), ("lag", lag))
    if faults := [f"{name} = {x:g} s must be finite and not negative" for name, x in times if not 0.0 <= x < math.inf]:
        return faults
    plant = body.linear_plant(lag)

    def radius(factor: float, later: float) -> float:
        return SampledLoop(plant, law(factor), period, later).pole_radius

    if (found := radius(1.0, delay)) < 1.0:
        return []
    fault = (
        f"the loop is unstable at {1.0 / period:g} Hz with a delay of {delay:g} s and a propulsion lag of {lag:g} s: "
        f"its largest pole has |z| = {found:.4f}, which must be less than 1"
    )
    cures: list[str] = []
    if (most := largest_stable(lambda later: radius(1.0, later), min(delay, _LONGEST_DELAY))) > 0.0:
        cures.append(f"a delay of at most about {most:.3f} s")
    if (most := largest_stable(lambda factor: radius(factor, delay), 1.0)) > 0.0:
        cures.append(f"at most about {most:.3g} times these gains")
    return [fault + ("; it is stable with " + " or with ".join(cures) if cures else "; no cure was found")]
