"""A hand that is led from outside, and an object that floats before it: what people practise with. [Fernandes2020]."""

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import ClassVar

import numpy as np

from handover.cosim.blocks.ports import Vector3, parameter
from handover.cosim.blocks.units import Metre, Second
from handover.cosim.record.reader import Record
from handover.cosim.system.signals import Signals
from handover.cosim.system.system import PortName, System
from handover.plants.free_flyer.hand.parameters import Params as PersonParams
from handover.scenarios.experiment.experiment import Evaluator, Experiment, FmuOf, Metric, Outcome
from handover.scenarios.experiment.live_inputs import LedHand
from handover.scenarios.experiment.replay import Replay
from handover.scenarios.robots.free_flyer.handover.led_hand import NEVER_TRACKED

_FAR = np.array([50.0, 0.0, 0.0])
"""Where the gripper is that nobody sees, in W, m."""
_AXES = ("x", "y", "z")
_TASK = "Practise with the hand: lead it to the object that floats before it, and close it on the object."


@dataclass(frozen=True, kw_only=True)
class PracticeParameters:
    """What one practises with, and for how long."""

    duration: Second = parameter(600.0, "how long the practice lasts", minimum=1.0, maximum=7200.0)
    p_WO_0: Vector3[Metre] = parameter(
        np.array([-0.12, 0.02, 0.0]), "where the object floats at first, in W", minimum=-1.0, maximum=1.0
    )


class PracticeEvaluator(Evaluator):
    """Follows a practice: how far the hand was moved along each axis, and how often it was closed and held the object.

    Args:
        duration: how long the practice is to last, s.
    """

    def __init__(self, duration: float) -> None:
        self._duration, self._t = duration, 0.0
        self._low, self._high = [np.inf] * 3, [-np.inf] * 3
        self._fists, self._grasps = 0, 0
        self._was_closed, self._had = False, False

    def __call__(self, t: float, signals: Signals) -> None:
        """Take in the signals at time t, s."""
        self._t = t
        p_WH = [float(x) for x in signals["person.p_WH"]]
        self._low = [min(a, b) for a, b in zip(self._low, p_WH, strict=True)]
        self._high = [max(a, b) for a, b in zip(self._high, p_WH, strict=True)]
        closed, has = bool(signals["person.closed_goal"]), signals.text("person.holder") == "HAND"
        self._fists += closed and not self._was_closed
        self._grasps += has and not self._had
        self._was_closed, self._had = closed, has

    @property
    def over(self) -> bool:
        """Whether the time is up."""
        return self._t >= self._duration

    def outcome(self) -> Outcome:
        """Return what was practised; there is nothing in which it could fail."""
        ranges = [max(0.0, b - a) for a, b in zip(self._low, self._high, strict=True)]
        metrics = {
            f"range_{axis}": Metric(r, "m", f"how far the hand was moved along {axis}")
            for axis, r in zip(_AXES, ranges, strict=True)
        }
        metrics["fists"] = Metric(float(self._fists), "1", "how often the hand was closed")
        metrics["grasps"] = Metric(float(self._grasps), "1", "how often it got hold of the object")
        reason = f"the hand was closed {self._fists} times and got the object {self._grasps} times"
        return Outcome(success=True, reason=reason, metrics=metrics)


class HandPractice(Experiment[PracticeEvaluator]):
    """A person's hand, led from outside, and an object in microgravity, without a robot. [Fernandes2020] sec. 5.7."""

    name: ClassVar[str] = "flyer_hand_practice"
    title: ClassVar[str] = "a person practises with the simulated hand and an object that floats"
    parameters_type: ClassVar[type[PracticeParameters]] = PracticeParameters
    units: ClassVar[Mapping[str, str]] = {"person": "HandAndObject"}
    headline: ClassVar[tuple[str, ...]] = ("fists", "grasps")
    is_seeded: ClassVar[bool] = False

    def build(self, parameters: PracticeParameters, seed: int, fmu: FmuOf) -> System:
        """Place hand and object; the gripper that the unit expects is far away."""
        s = System()
        s.add(
            "person",
            fmu("person"),
            seed=seed,
            p_WO_0=parameters.p_WO_0,
            p_WG=_FAR,
            driven_by="outside",
            age=NEVER_TRACKED,
        )
        led = self.led_hand(parameters)
        for name in (*led.inputs, led.age):
            s.external(PortName(*name.split(".")))
        return s

    def led_hand(self, parameters: PracticeParameters) -> LedHand:  # noqa: ARG002
        """Return the person's hand."""
        person = vars(PersonParams())
        x, y, z = (float(n) for n in person["p_WH_0"])
        return LedHand("person", (x, y, z), float(person["arm_reach"]), _TASK)

    def stop_time(self, parameters: PracticeParameters) -> Fraction:
        """Return the duration of the practice."""
        return Fraction(repr(parameters.duration))

    def evaluator(self, parameters: PracticeParameters) -> PracticeEvaluator:
        """Return the evaluator of a practice."""
        return PracticeEvaluator(parameters.duration)

    def replay(self, parameters: PracticeParameters, record: Record) -> Replay:  # noqa: ARG002
        """Return hand and object in space."""
        from handover.scenarios.robots.free_flyer.replay import replay_practice

        return replay_practice(record)
