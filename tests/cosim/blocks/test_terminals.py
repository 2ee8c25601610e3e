"""Terminals that a block declares: what a kind asks of its members, and what is refused with the reason."""

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
import pytest

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


def with_terminals(*terminals: Any) -> type[Any]:
    return type("Declared", (Plant,), {"terminals": terminals})


def test_members_have_their_ports_names_unless_others_are_given():
    block = with_terminals(
        terminal("tip", TerminalKind.POSE, "q", position="p"), terminal("load", TerminalKind.WRENCH, "f", "tau")
    )
    tip, load = describe(block).terminals
    assert (tip.members, load.members) == ({"q": "q", "position": "p"}, {"f": "f", "tau": "tau"})
    assert describe(Plant).terminals == ()


def test_the_kind_says_the_matching_rule():
    rules = {kind: kind.rule for kind in TerminalKind}
    assert rules[TerminalKind.POSE] is rules[TerminalKind.COMMAND] is MatchingRule.PLUG
    assert rules[TerminalKind.PICTURES] is rules[TerminalKind.MEASUREMENTS] is MatchingRule.BUS
    assert rules[TerminalKind.SIGNALS] is MatchingRule.SEQUENCE
    assert all(TerminalKind.of_standard_name(kind.standard_name) is kind for kind in TerminalKind)


@pytest.mark.parametrize(
    ("declared", "wanted"),
    [
        (
            terminal("eyes", TerminalKind.PICTURES, "left", "right"),
            r"Declared\.terminals: 'eyes': left \(.*width=1280.*\) and right \(.*width=64.*\) differ in shape: the",
        ),
        (terminal("eyes", TerminalKind.PICTURES, "left", "f"), r"f is real \[3\] N, but pictures are binary"),
        (
            terminal("tip", TerminalKind.POSE, "p"),
            r"'tip': it has no quaternion: a pose has a position \(real \[3\] m\) and a quaternion \(real \[4\]\)",
        ),
        (terminal("tip", TerminalKind.POSE, "p", "r"), r"r is one more real \[3\] m, but a pose has"),
        (terminal("load", TerminalKind.WRENCH, "f", "left"), r"left is binary, but a wrench has a force"),
        (terminal("tip", TerminalKind.COMMAND, "p", "f"), r"f and p are inputs and outputs: make two terminals"),
        (terminal("tip", TerminalKind.COMMAND, "p", "x"), r"there is no input or output 'x'"),
        (terminal("tip", TerminalKind.COMMAND, "p", x="p"), r"p is there under two names"),
        (terminal("tip", TerminalKind.COMMAND), r"'tip': it has no members"),
        (terminal("p", TerminalKind.COMMAND, "q"), r"'p': a port has this name; y\.p and u\.p would stand for either"),
        (terminal("mass", TerminalKind.COMMAND, "q"), r"'mass': a parameter has this name, and u\.mass .*; rename one"),
        (terminal("a tip", TerminalKind.COMMAND, "q"), r"letters, digits and underscores"),
        ("tip", r"'tip' is not a terminal, such as \(terminal\("),
    ],
)
def test_what_is_no_terminal_is_refused_with_the_reason(declared: Any, wanted: str):
    with pytest.raises(DeclarationError, match=wanted):
        describe(with_terminals(declared))


def test_a_port_in_two_terminals_is_refused_with_the_other_one():
    shared = terminal("tip", TerminalKind.POSE, "p", "q"), terminal("place", TerminalKind.COMMAND, "r", at="p")
    with pytest.raises(DeclarationError, match=r"terminals: 'place': p is in 'tip', too; a port is in one terminal"):
        describe(with_terminals(*shared))


def test_all_faults_are_told_at_once_and_names_are_unique():
    twice = terminal("tip", TerminalKind.COMMAND, "p"), terminal("tip", TerminalKind.POSE, "p")
    with pytest.raises(DeclarationError, match=r"'tip': another terminal has this name.*; 'tip': it has no quaternion"):
        describe(with_terminals(*twice))
    block = type("Declared", (Plant,), {"terminals": {"tip": ("p", "q")}})
    with pytest.raises(DeclarationError, match=r"terminals: \{'tip'.*\} is not a tuple of terminals, such as"):
        describe(block)
