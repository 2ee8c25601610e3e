"""What a person may do in a scenario while its run goes on, in a live page: push bodies, lead a hand."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from handover.cosim.blocks.ports import Floats
from handover.cosim.system.system import PortName, System
from handover.cosim.system.time_series import NoSource
from handover.scenarios.experiment.returned_types import VECTOR, Checked

_HAND_SIZES = {"p_WH_track": 3, "q_WH_track": 4, "finger_track": 14, "closed_track": 1}


@dataclass(frozen=True, kw_only=True)
class Pushable(Checked):
    """A body that can be pushed at any of its points, by two inputs of a unit, or at one of them, by a single input.

    Attributes:
        labels: of the replay's bodies that can be pressed; the first body of the first label is the points' frame.
        unit: name of the unit.
        force: its input of the force, N, shape (3,), in W.
        point: its input of the point at which the force acts, m, shape (3,), in that frame; None where it acts at the
            same point wherever the body is pressed.
        greatest: magnitude of the greatest force, N.
    """

    labels: tuple[str, ...]
    unit: str
    force: str
    point: str | None
    greatest: float

    @property
    def inputs(self) -> tuple[PortName, ...]:
        """The inputs of force and, if there is one, of the point."""
        return tuple(PortName(self.unit, name) for name in (self.force, self.point) if name is not None)


def inputs_of_pushes(pushes: Sequence[Pushable]) -> Mapping[str, int]:
    """Return the sizes of the inputs of pushes by their names, `unit.input`."""
    return {f"{end.unit}.{end.port}": 3 for push in pushes for end in push.inputs}


def let_push(system: System, pushes: Sequence[Pushable]) -> None:
    """Let the forces come from outside, from nobody yet; a unit that has no such inputs is not pushed."""
    for push in pushes:
        unit = system.units.get(push.unit)
        if unit is not None and {end.port for end in push.inputs} <= unit.description.inputs.keys():
            for end in push.inputs:
                system.external(end, NoSource())


@dataclass(frozen=True)
class LedHand(Checked):
    """A hand that inputs from outside lead.

    Attributes:
        unit: whose inputs they are: `p_WH_track`, `q_WH_track`, `finger_track`, `closed_track`, `age`.
        p_WH_0: where it rests, in W, m.
        reach: how far from there it may be wanted, m.
        task: what is asked of who leads it, in a few sentences.
    """

    unit: str
    p_WH_0: tuple[float, float, float]
    reach: float
    task: str = ""

    expected = {"p_WH_0": VECTOR}

    @property
    def inputs(self) -> Mapping[str, int]:
        """The inputs that a sample of a hand sets, as `unit.input`, and how many entries each has."""
        return {f"{self.unit}.{name}": size for name, size in _HAND_SIZES.items()}

    @property
    def age(self) -> str:
        """The input that tells how old the sample is."""
        return f"{self.unit}.age"


@dataclass(frozen=True)
class HandHint(Checked):
    """What helps who leads a hand, at an instant of a run.

    Attributes:
        p_WH: where the hand is, in W, m.
        goal: where it is to be; None where it need not go anywhere yet.
        within_reach: whether it is near enough to do there what is asked.
        holds: whether it holds the object.
        advice: what is to be done now, in a short sentence.
    """

    p_WH: Floats
    goal: Floats | None
    within_reach: bool = False
    holds: bool = False
    advice: str = ""
