"""Terminals are connected by the standard's rules; what does not match is refused, and nothing of it connected."""

from collections.abc import Mapping
from pathlib import Path

import pytest
from support.cosim.terminal_units import described_unit, terminal_xml

from handover.cosim.exceptions import WiringError
from handover.cosim.system.conversion import LinearTransformation
from handover.cosim.system.system import PlacedUnit, System

POSE = {"p": "m 3", "q": "1 4"}


class Bench:
    """A system of units that are written for it."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.system = folder, System()

    def giver(self, name: str, outputs: Mapping[str, str], *terminals: str) -> PlacedUnit:
        file = described_unit(self.folder / f"{name}.fmu", {}, outputs, "".join(terminals))
        return self.system.add(name, file)

    def taker(self, name: str, inputs: Mapping[str, str], *terminals: str) -> PlacedUnit:
        file = described_unit(self.folder / f"{name}.fmu", inputs, {}, "".join(terminals))
        return self.system.add(name, file)

    @property
    def pairs(self) -> set[tuple[str, str]]:
        return {(str(c.source), str(c.target)) for c in self.system.connections}

    @property
    def faults(self) -> str:
        with pytest.raises(WiringError) as caught:
            self.system.check()
        return "\n".join(caught.value.faults)


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    return Bench(tmp_path)


def named(name: str, rule: str = "plug", kind: str = "_tool_pose", **members: str) -> str:
    return terminal_xml(name, rule, kind, **members)


def test_members_feed_members_of_their_name_though_the_ports_are_named_otherwise(bench: Bench):
    a = bench.giver("arm", {"p_WG": "m 3", "q_WG": "1 4"}, named("gripper", p="p_WG", q="q_WG"))
    b = bench.taker("hand", {"at": "mm 3", "turned": "1 4", "grip": "1"}, named("gripper", q="turned", p="at"))
    told = bench.system.connect(a.y, b.u)
    bench.system.check()
    assert bench.pairs == {("arm.p_WG", "hand.at"), ("arm.q_WG", "hand.turned")}
    assert (told.connected, told.unmatched) == (("at", "turned"), ("grip",))
    assert str(told).splitlines()[0] == "arm.p_WG -> hand.at (terminal gripper)"
    assert bench.system.transformation_of(bench.system.connections[0]) == LinearTransformation(1000.0)


def test_what_lies_in_no_terminal_is_matched_by_name_after_them(bench: Bench):
    a = bench.giver("arm", {"p": "m 3", "q": "1 4", "grip": "1"}, named("gripper", p="p", q="q"))
    b = bench.taker("hand", {"p": "m 3", "q": "1 4", "grip": "1"}, named("gripper", p="p", q="q"))
    assert bench.system.connect(a.y, b.u).connected == ("p", "q", "grip")
    bench.system.check()


def test_a_plug_of_which_a_member_is_missing_is_refused_as_a_whole(bench: Bench):
    a = bench.giver("arm", {"p": "m 3"}, named("gripper", p="p"))
    b = bench.taker("hand", POSE, named("gripper", p="p", q="q"))
    told = bench.system.connect(a.y, b.u)
    assert bench.pairs == set()
    assert "its terminal gripper is not connected" in told.left["p"]
    assert "arm.gripper -> hand.gripper" in bench.faults
    assert "arm.gripper has no member q; a plug is connected as a whole" in bench.faults


def test_of_a_bus_what_both_have_is_connected(bench: Bench):
    a = bench.giver("eye", {"p": "m 3", "c": "1"}, named("seen", "bus", p="p", certain="c"))
    b = bench.taker("hand", {"at": "m 3", "q": "1 4"}, named("seen", "bus", p="at", q="q"))
    assert bench.system.connect(a.y, b.u).connected == ("at",)
    bench.system.check()


def test_inputs_of_terminals_that_do_not_belong_together_are_matched_by_name(bench: Bench):
    a = bench.giver("a", {"p": "m 3", "r": "1 4", "c": "1"}, named("tip", p="p", q="r"))
    b = bench.taker("b", {"p": "m 3", "q": "1 4"}, named("palm", at="p", turned="q"))
    assert bench.system.connect(a.y, b.u).connected == ("p",)
    d = bench.giver("d", {"p": "m 3", "c": "1"}, named("seen", "bus", p="p", certain="c"))
    e = bench.taker("e", {"at": "m 3", "c": "1"}, named("seen", "bus", p="at", sure="c"))
    told = bench.system.connect(d.y, e.u)
    assert (told.connected, set(told.terminals)) == (("at", "c"), {"at"})
    bench.system.check()


def test_a_sequence_matches_by_order_and_needs_as_many(bench: Bench):
    a = bench.giver("a", {"x": "m", "y": "N"}, named("joints", "sequence", x="x", y="y"))
    b = bench.taker("b", {"s": "m", "f": "N"}, named("joints", "sequence", s="s", f="f"))
    c = bench.taker("c", {"s": "m"}, named("joints", "sequence", s="s"))
    bench.system.connect(a.y, b.u)
    bench.system.check()
    assert bench.pairs == {("a.x", "b.s"), ("a.y", "b.f")}
    bench.system.connect(a.y, c.u)
    assert "a.joints has 2 members in sequence, c.joints 1" in bench.faults


def test_members_that_differ_in_shape_are_refused_with_both_ends(bench: Bench):
    a = bench.giver("arm", {"p": "m 3", "q": "1 4"}, named("gripper", p="p", q="q"))
    b = bench.taker("hand", {"p": "m 2", "q": "1 4"}, named("gripper", p="p", q="q"))
    bench.system.connect(a.y, b.u)
    assert bench.pairs == set()
    assert "arm.p (real [3] m) -> hand.p (real [2] m): their shapes differ" in bench.faults


def test_terminals_of_other_names_match_by_their_kind_if_one_fits_only_one(bench: Bench):
    a = bench.giver("reflex", {"x": "m 3"}, named("corrected", "bus", p="x"))
    b = bench.taker("servo", {"y": "m 3"}, named("measured", "bus", p="y"))
    told = bench.system.connect(a.y, b.u)
    bench.system.check()
    assert told.terminals == {"y": ("corrected", "measured")}
    assert str(told) == "reflex.x -> servo.y (terminals corrected, measured)"


def test_an_ambiguity_names_the_candidates_and_is_settled_by_naming_two_terminals(bench: Bench):
    a = bench.giver("robot", {"x": "m 3"}, named("gripper", p="x"))
    b = bench.taker("scene", {"y": "m 3", "z": "m 3"}, named("first", p="y"), named("second", p="z"))
    told = bench.system.connect(a.y, b.u)
    assert bench.pairs == set()
    assert set(told.left) == {"y", "z"}
    assert bench.faults == (
        "robot.y -> scene.u: the terminals robot's gripper match scene's first and second; connect those that are "
        "meant: connect(robot.y.gripper, scene.u.first)"
    )
    bench.system.connect(a.y.gripper, b.u.second)
    bench.system.check()
    assert bench.pairs == {("robot.x", "scene.z")}


def test_naming_one_pair_of_several_leaves_the_others_to_be_named(bench: Bench):
    a = bench.giver("robot", {"x": "m", "y": "m"}, named("left", p="x"), named("right", p="y"))
    b = bench.taker("scene", {"z": "m", "w": "m"}, named("first", p="z"), named("second", p="w"))
    bench.system.connect(a.y, b.u)
    assert "the terminals robot's left and right match scene's first and second" in bench.faults
    bench.system.connect(a.y.left, b.u.second)
    assert bench.faults == (
        "robot.y -> scene.u: the terminals robot's right match scene's first; connect those that are meant: "
        "connect(robot.y.right, scene.u.first)"
    )
    bench.system.connect(a.y.right, b.u.first)
    bench.system.check()
    assert bench.pairs == {("robot.x", "scene.w"), ("robot.y", "scene.z")}


def test_an_ambiguity_is_settled_once_other_units_feed_all_inputs(bench: Bench):
    a = bench.giver("robot", {"x": "m"}, named("tip", p="x"))
    other = bench.giver("other", {"z": "m", "w": "m"})
    b = bench.taker("scene", {"z": "m", "w": "m"}, named("first", p="z"), named("second", p="w"))
    bench.system.connect(a.y, b.u)
    bench.system.connect(other.y.z, b.u.z)
    assert "the terminals robot's tip match scene's second" in bench.faults
    bench.system.connect(other.y.w, b.u.w)
    bench.system.check()


def test_two_named_terminals_are_connected_or_refused_as_a_whole(bench: Bench):
    a = bench.giver("arm", POSE, named("tip", p="p", q="q"))
    b = bench.taker("hand", {**POSE, "x": "m"}, named("palm", p="p", q="q"))
    c = bench.taker("other", {"p": "m 3"}, named("palm", p="p"))
    told = bench.system.connect(a.y.tip, b.u.palm)
    bench.system.check()
    assert str(told) == "arm.p -> hand.p (terminals tip, palm)\narm.q -> hand.q (terminals tip, palm)"
    assert bench.pairs == {("arm.p", "hand.p"), ("arm.q", "hand.q")}
    assert str(bench.system.connect(a.y.tip, c.u.palm)) == "other.p left: its terminal was not connected"
    assert len(bench.pairs) == 2
    assert "arm.tip -> other.palm: terminals that do not match: other.palm has no member q" in bench.faults


def test_a_terminal_is_disconnected_with_all_its_ports(bench: Bench):
    a = bench.giver("arm", {**POSE, "grip": "1"}, named("tip", p="p", q="q"))
    b = bench.taker("hand", {**POSE, "grip": "1"}, named("palm", p="p", q="q"), named("no", p="nowhere"))
    for end in (b.u.palm, a.y.tip):
        bench.system.connect(a.y, b.u)
        assert len(bench.pairs) == 3
        bench.system.disconnect(end)
        assert bench.pairs == {("arm.grip", "hand.grip")}
    with pytest.raises(ValueError, match=r"terminal hand\.no: .*'nowhere'.*; disconnect its ports one by one"):
        bench.system.disconnect(b.u.no)
    bench.system.check()


def test_a_terminal_and_a_port_are_not_connected(bench: Bench):
    a = bench.giver("arm", POSE, named("tip", p="p", q="q"))
    b = bench.taker("hand", POSE)
    bench.system.connect(a.y.tip, b.u.p)
    assert "arm.tip is a terminal: connect it with one, or its ports one by one" in bench.faults
    d = bench.taker("d", POSE, named("palm", p="p", q="q"))
    with pytest.raises(TypeError, match="a transformation is for one connection"):
        bench.system.connect(a.y.tip, d.u.palm, LinearTransformation(2.0))


def test_a_single_connection_takes_precedence_over_a_terminal_before_and_after(bench: Bench):
    a = bench.giver("arm", POSE, named("tip", p="p", q="q"))
    other = bench.giver("other", POSE)
    b = bench.taker("hand", POSE, named("tip", p="p", q="q"))
    bench.system.connect(other.y.p, b.u.p)
    assert dict(bench.system.connect(a.y, b.u).left) == {"p": "other.p feeds it"}
    bench.system.connect(other.y.q, b.u.q)
    bench.system.check()
    assert bench.pairs == {("other.p", "hand.p"), ("other.q", "hand.q")}


@pytest.mark.parametrize("is_before", [True, False])
def test_terminals_that_do_not_match_are_settled_once_all_inputs_are_connected_one_by_one(
    bench: Bench, is_before: bool
):
    a = bench.giver("arm", {**POSE, "x": "m 3"}, named("tip", p="p"))
    b = bench.taker("hand", POSE, named("tip", p="p", q="q"))
    if not is_before:
        bench.system.connect(a.y, b.u)
    bench.system.connect(a.y.x, b.u.p)
    if is_before:
        bench.system.connect(a.y, b.u)
    cure = "connect its inputs one by one, which are hand.u.p, hand.u.q, or make both terminals alike"
    assert cure in bench.faults
    bench.system.connect(a.y.q, b.u.q)
    bench.system.check()
    assert bench.pairs == {("arm.x", "hand.p"), ("arm.q", "hand.q")}


def test_two_units_whose_terminals_match_one_are_refused(bench: Bench):
    a = bench.giver("a", {"x": "m"}, named("tip", p="x"))
    b = bench.giver("b", {"x": "m"}, named("tip", p="x"))
    c = bench.taker("c", {"z": "m"}, named("tip", p="z"))
    bench.system.connect(a.y, c.u)
    assert dict(bench.system.connect(b.y, c.u).left) == {"z": "a.x matches it, too"}
    assert bench.faults == "c.z: a.y.x and b.y.x match it; connect the one that is meant: connect(a.y.x, c.u.z)"


@pytest.mark.parametrize(
    ("given", "taken", "factor"),
    [("outflow", "inflow", None), ("inflow", "inflow", -1.0), ("outflow", "outflow", -1.0)],
)
def test_flows_that_both_count_inwards_get_the_opposite_sign(
    bench: Bench, given: str, taken: str, factor: float | None
):
    a = bench.giver("a", {"x": "N"}, named("pin", f=f"x {given}"))
    b = bench.taker("b", {"z": "N"}, named("pin", f=f"z {taken}"))
    bench.system.connect(a.y, b.u)
    bench.system.check()
    transformation = bench.system.transformation_of(bench.system.connections[0])
    assert (transformation and transformation.factor) == factor


def test_a_flow_and_a_signal_do_not_match(bench: Bench):
    a = bench.giver("a", {"x": "N"}, named("pin", f="x inflow"))
    b = bench.taker("b", {"z": "N"}, named("pin", f="z"))
    bench.system.connect(a.y, b.u)
    assert "a.x (real N) -> b.z (real N): one is inflow, the other signal" in bench.faults


def test_a_terminal_with_a_fault_is_refused_where_it_is_met_and_harmless_elsewhere(bench: Bench):
    a = bench.giver("arm", POSE, named("tip", p="nowhere"))
    b = bench.taker("hand", POSE, named("tip", p="p", q="q"))
    plain = bench.taker("plain", POSE)
    bench.system.connect(a.y, plain.u)
    bench.system.check()
    bench.system.connect(a.y, b.u)
    assert "arm.tip: there is no variable 'nowhere' (line 1)" in bench.faults
    faulty = bench.taker("faulty", POSE, named("tip", p="nowhere"))
    bench.system.connect(a.y, faulty.u)
    assert "connect the ports that are meant one by one, not the units as a whole" in bench.faults
