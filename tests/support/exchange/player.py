"""Makes blocks whose outputs are what another block is driven with."""

import dataclasses
import typing
from typing import Any

from handover.cosim.blocks.description import describe
from handover.cosim.blocks.ports import output
from handover.fmus.catalog import UNITS
from support.exchange.drive import STEPS, inputs


@dataclasses.dataclass(frozen=True, kw_only=True)
class Params:
    pass


@dataclasses.dataclass(kw_only=True)
class Inputs:
    pass


def player(block: type[Any], unit: str) -> type[Any]:
    """Return a block that plays a unit's inputs: from k to k + 1 steps its outputs are the inputs of step k.

    After STEPS steps it begins anew.
    """
    d, period = describe(block), float(UNITS[unit].step)
    hints = typing.get_type_hints(d.inputs_type, include_extras=True)
    fields: list[Any] = [(v.name, hints[v.name], output("what is played")) for v in d.inputs]
    made = dataclasses.make_dataclass("Outputs", fields, kw_only=True)

    class Player:
        """Plays."""

        feedthrough: typing.ClassVar[dict[str, tuple[str, ...]]] = {}
        period: float | None = None

        def __init__(self, params: Params) -> None:
            pass

        def outputs(self, t: float, u: Inputs) -> Any:  # noqa: ARG002
            return made(**inputs(d, round(t / period) % STEPS))

        def step(self, t: float, dt: float, u: Inputs) -> Any:
            return self.outputs(t + dt, u)

        def get_state(self) -> bytes:
            return b""

        def set_state(self, state: bytes) -> None:
            pass

    Player.step.__annotations__["return"] = made
    return Player
