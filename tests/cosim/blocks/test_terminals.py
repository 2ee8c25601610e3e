"""Terminals that a block declares: what a kind asks of its members, and what is refused with the reason."""

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
import pytest
from support.wording import Wording

from handover.cosim.blocks.declarations import DeclarationError
from handover.cosim.blocks.description import describe
from handover.cosim.blocks.ports import (
    BLACK_1280X720,
    Picture1280x720,
    Raster,
    Vector3,
    Vector4,
    output,
    parameter,
    port,
)
from handover.cosim.blocks.terminals import MatchingRule, TerminalKind, terminal
from handover.cosim.blocks.units import Kilogram, Metre, Newton, NewtonMetre, Number

Small = Annotated[np.ndarray[Any, Any], Raster(64, 48)]


@dataclass(kw_only=True)
class Params:
    mass: Kilogram = parameter(1.0, "mass")


@dataclass(kw_only=True)
class Inputs:
    left: Picture1280x720 = port(BLACK_1280X720, "a picture")
    right: Small = port(np.zeros((48, 64, 3), dtype=np.uint8), "a smaller one")
    f: Vector3[Newton] = port(np.zeros(3), "force")
    tau: Vector3[NewtonMetre] = port(np.zeros(3), "torque")


@dataclass(kw_only=True)
class Outputs:
    p: Vector3[Metre] = output("position")
    q: Vector4[Number] = output("orientation")
    r: Vector3[Metre] = output("another position")


class Plant:
    feedthrough: Any = {}
    period: float | None = None
    terminals: Any = ()

    def __init__(self, params: Params) -> None: ...
    def outputs(self, t: float, u: Inputs) -> Outputs: ...
    def step(self, t: float, dt: float, u: Inputs) -> Outputs: ...
    def get_state(self) -> bytes: ...
    def set_state(self, state: bytes) -> None: ...


def with_terminals(terminals: Any) -> type[Any]:
    return type("Declared", (Plant,), {"terminals": terminals})


def test_members_have_their_ports_names_unless_others_are_given_and_the_kind_says_the_matching_rule():
    block = with_terminals(
        (terminal("tip", TerminalKind.POSE, "q", position="p"), terminal("load", TerminalKind.WRENCH, "f", "tau"))
    )
    tip, load = describe(block).terminals
    assert (tip.members, load.members) == ({"q": "q", "position": "p"}, {"f": "f", "tau": "tau"})
    assert describe(Plant).terminals == ()
    rules = {kind: kind.rule for kind in TerminalKind}
    assert rules[TerminalKind.POSE] is rules[TerminalKind.COMMAND] is MatchingRule.PLUG
    assert rules[TerminalKind.PICTURES] is rules[TerminalKind.MEASUREMENTS] is MatchingRule.BUS
    assert rules[TerminalKind.SIGNALS] is MatchingRule.SEQUENCE
    assert all(TerminalKind.of_standard_name(kind.standard_name) is kind for kind in TerminalKind)


@pytest.mark.parametrize(
    "declared",
    [
        pytest.param((terminal("eyes", TerminalKind.PICTURES, "left", "right"),), id="shapes"),
        pytest.param((terminal("eyes", TerminalKind.PICTURES, "left", "f"),), id="kinds"),
        pytest.param((terminal("tip", TerminalKind.POSE, "p"),), id="a member misses"),
        pytest.param((terminal("tip", TerminalKind.POSE, "p", "r"),), id="one twice"),
        pytest.param((terminal("load", TerminalKind.WRENCH, "f", "left"),), id="another member"),
        pytest.param((terminal("tip", TerminalKind.COMMAND, "p", "f"),), id="inputs and outputs"),
        pytest.param((terminal("tip", TerminalKind.COMMAND, "p", "x"),), id="no port"),
        pytest.param((terminal("tip", TerminalKind.COMMAND, "p", x="p"),), id="two names"),
        pytest.param((terminal("tip", TerminalKind.COMMAND),), id="none"),
        pytest.param((terminal("p", TerminalKind.COMMAND, "q"),), id="a port's name"),
        pytest.param((terminal("mass", TerminalKind.COMMAND, "q"),), id="a parameter's name"),
        pytest.param((terminal("a tip", TerminalKind.COMMAND, "q"),), id="no name"),
        pytest.param(("tip",), id="a text"),
        pytest.param({"tip": ("p", "q")}, id="a mapping"),
        pytest.param(
            (terminal("tip", TerminalKind.POSE, "p", "q"), terminal("place", TerminalKind.COMMAND, "r", at="p")),
            id="a port in two",
        ),
        pytest.param(
            (terminal("tip", TerminalKind.COMMAND, "p"), terminal("tip", TerminalKind.POSE, "p")), id="all faults"
        ),
    ],
)
def test_what_is_no_terminal_is_refused_with_the_reason(declared: Any, wording: Wording):
    with pytest.raises(DeclarationError) as refused:
        describe(with_terminals(declared))
    wording.check(refused.value)
