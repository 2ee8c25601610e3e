"""Terminals are connected by the standard's rules; what does not match is refused, and nothing of it connected."""

from collections.abc import Mapping
from pathlib import Path

import pytest
from support.cosim.terminal_units import described_unit, terminal_xml
from support.wording import Wording

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
    def pairs(self) -> str:
        self.system.check()
        return " ".join(f"{c.source}>{c.target}" for c in self.system.connections)

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


TIP, PALM = named("tip", p="p", q="q"), named("palm", p="p", q="q")


SEEN, AT = named("seen", "bus", p="p", certain="c"), {"at": "m 3", "c": "1"}
JOINTS, GRIP = named("joints", "sequence", x="x", y="y"), {**POSE, "grip": "1"}
CASES: dict[str, tuple[Mapping[str, str], str, Mapping[str, str], str, str]] = {
    "members by their names": (
        {"p_WG": "m 3", "q_WG": "1 4"}, named("tip", p="p_WG", q="q_WG"),
        {"at": "m 3", "turned": "1 4", "grip": "1"}, named("tip", q="turned", p="at"), "a.p_WG>b.at a.q_WG>b.turned",
    ),
    "others by name": (GRIP, TIP, GRIP, TIP, "a.p>b.p a.q>b.q a.grip>b.grip"),
    "of a bus what both have": (
        {"p": "m 3", "c": "1"}, SEEN, {"at": "m 3", "q": "1 4"}, named("seen", "bus", p="at", q="q"), "a.p>b.at",
    ),
    "of a bus and by name": (
        {"p": "m 3", "c": "1"}, SEEN, AT, named("seen", "bus", p="at", sure="c"), "a.p>b.at a.c>b.c",
    ),
    "not belonging together, by name": (
        {"p": "m 3", "r": "1 4", "c": "1"}, named("tip", p="p", q="r"),
        POSE, named("palm", at="p", turned="q"), "a.p>b.p",
    ),
    "a sequence by order": (
        {"x": "m", "y": "N"}, JOINTS,
        {"s": "m", "f": "N"}, named("joints", "sequence", s="s", f="f"), "a.x>b.s a.y>b.f",
    ),
    "by their kind": (
        {"x": "m 3"}, named("corrected", "bus", p="x"), {"y": "m 3"}, named("measured", "bus", p="y"), "a.x>b.y",
    ),
    "a fault is harmless elsewhere": (POSE, named("tip", p="nowhere"), POSE, "", "a.p>b.p a.q>b.q"),
    "a member of a plug misses": ({"p": "m 3"}, named("tip", p="p"), POSE, TIP, ""),
    "a sequence of other length": ({"x": "m", "y": "N"}, JOINTS, {"s": "m"}, named("joints", "sequence", s="s"), ""),
    "shapes differ": (POSE, TIP, {"p": "m 2", "q": "1 4"}, TIP, ""),
    "a flow and a signal": ({"x": "N"}, named("pin", f="x inflow"), {"z": "N"}, named("pin", f="z"), ""),
    "a fault of the giver's": (POSE, named("tip", p="nowhere"), POSE, TIP, ""),
    "a fault of the taker's": (POSE, "", POSE, named("tip", p="nowhere"), "a.p>b.p a.q>b.q"),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_which_terminals_match(case: str, bench: Bench, wording: Wording):
    outputs, given, inputs, taken, pairs = CASES[case]
    a, b = bench.giver("a", outputs, given), bench.taker("b", inputs, taken)
    wording.check(bench.system.connect(a.y, b.u))
    if pairs:
        assert bench.pairs == pairs
    else:
        assert not bench.system.connections
        wording.check(bench.faults)


def test_faulty_terminals_of_both_ends_are_refused_as_a_whole(bench: Bench):
    a, b = bench.giver("arm", POSE, named("tip", p="nowhere")), bench.taker("hand", POSE, TIP)
    bench.system.connect(a.y, b.u)
    bench.system.connect(a.y, bench.taker("faulty", POSE, named("tip", p="nowhere")).u)
    assert "connect the ports that are meant one by one, not the units as a whole" in bench.faults


def test_an_ambiguity_names_the_candidates_and_is_settled_by_naming_terminals_in_pairs(bench: Bench, wording: Wording):
    a = bench.giver("robot", {"x": "m", "y": "m"}, named("left", p="x"), named("right", p="y"))
    b = bench.taker("scene", {"z": "m", "w": "m"}, named("first", p="z"), named("second", p="w"))
    reported = bench.system.connect(a.y, b.u)
    assert (bench.system.connections, set(reported.left)) == ([], {"z", "w"})
    wording.check(bench.faults)
    bench.system.connect(a.y.left, b.u.second)
    wording.check(bench.faults)
    bench.system.connect(a.y.right, b.u.first)
    assert bench.pairs == "robot.x>scene.w robot.y>scene.z"


def test_an_ambiguity_is_settled_once_other_units_feed_all_inputs(bench: Bench, wording: Wording):
    a = bench.giver("robot", {"x": "m"}, named("tip", p="x"))
    other = bench.giver("other", {"z": "m", "w": "m"})
    b = bench.taker("scene", {"z": "m", "w": "m"}, named("first", p="z"), named("second", p="w"))
    bench.system.connect(a.y, b.u)
    wording.check(bench.faults)
    bench.system.connect(other.y.z, b.u.z)
    wording.check(bench.faults)
    bench.system.connect(other.y.w, b.u.w)
    bench.system.check()


def test_two_named_terminals_are_connected_refused_and_disconnected_as_a_whole(bench: Bench, wording: Wording):
    a = bench.giver("arm", {**POSE, "grip": "1"}, TIP)
    b = bench.taker("hand", {**POSE, "grip": "1"}, PALM, named("no", p="nowhere"))
    wording.check(bench.system.connect(a.y.tip, b.u.palm))
    assert bench.pairs == "arm.p>hand.p arm.q>hand.q"
    for end in (b.u.palm, a.y.tip):
        bench.system.connect(a.y, b.u)
        assert len(bench.system.connections) == 3
        bench.system.disconnect(end)
        assert bench.pairs == "arm.grip>hand.grip"
    with pytest.raises(ValueError, match=r"terminal hand\.no: .*'nowhere'.*; disconnect its ports one by one"):
        bench.system.disconnect(b.u.no)
    c = bench.taker("other", {"p": "m 3"}, named("palm", p="p"))
    wording.check(bench.system.connect(a.y.tip, c.u.palm))
    assert len(bench.system.connections) == 1
    bench.system.connect(a.y.tip, b.u.p)  # a terminal and a port
    wording.check(bench.faults)
    with pytest.raises(TypeError, match="a transformation is for one connection"):
        bench.system.connect(a.y.tip, b.u.palm, LinearTransformation(2.0))


@pytest.mark.parametrize("gone", ["robot", "scene"])
def test_what_is_ambiguous_or_at_fault_ends_with_either_of_its_units(bench: Bench, gone: str):
    a = bench.giver("robot", {"x": "m"}, named("tip", p="x"))
    b = bench.taker("scene", {"z": "m", "w": "m"}, named("first", p="z"), named("second", p="w"))
    bench.system.connect(a.y, b.u)
    with pytest.raises(WiringError):
        bench.system.check()
    bench.system.remove(gone)
    bench.system.check()


def test_a_single_connection_takes_precedence_over_a_terminal_before_and_after(bench: Bench):
    a, other = bench.giver("arm", POSE, TIP), bench.giver("other", POSE)
    b = bench.taker("hand", POSE, TIP)
    bench.system.connect(other.y.p, b.u.p)
    assert dict(bench.system.connect(a.y, b.u).left) == {"p": "other.p feeds it"}
    bench.system.connect(other.y.q, b.u.q)
    assert bench.pairs == "other.p>hand.p other.q>hand.q"


@pytest.mark.parametrize("is_before", [True, False])
def test_terminals_that_do_not_match_are_settled_once_all_inputs_are_connected_one_by_one(
    bench: Bench, is_before: bool
):
    a, b = bench.giver("arm", {**POSE, "x": "m 3"}, named("tip", p="p")), bench.taker("hand", POSE, TIP)
    if not is_before:
        bench.system.connect(a.y, b.u)
    bench.system.connect(a.y.x, b.u.p)
    if is_before:
        bench.system.connect(a.y, b.u)
    cure = "connect its inputs one by one, which are hand.u.p, hand.u.q, or make both terminals alike"
    assert cure in bench.faults
    bench.system.connect(a.y.q, b.u.q)
    assert bench.pairs == "arm.x>hand.p arm.q>hand.q"


def test_two_units_whose_terminals_match_one_are_refused(bench: Bench, wording: Wording):
    a, b = (bench.giver(name, {"x": "m"}, named("tip", p="x")) for name in "ab")
    c = bench.taker("c", {"z": "m"}, named("tip", p="z"))
    bench.system.connect(a.y, c.u)
    assert dict(bench.system.connect(b.y, c.u).left) == {"z": "a.x matches it, too"}
    wording.check(bench.faults)


@pytest.mark.parametrize(
    ("given", "taken", "unit", "factor"),
    [
        ("outflow", "inflow", "N", None),
        ("inflow", "inflow", "N", -1.0),
        ("outflow", "outflow", "N", -1.0),
        ("signal", "signal", "mm", 1000.0),
    ],
)
def test_flows_that_both_count_inwards_get_the_opposite_sign_and_units_are_converted(
    bench: Bench, given: str, taken: str, unit: str, factor: float | None
):
    a = bench.giver("a", {"x": unit.removeprefix("m")}, named("pin", f=f"x {given}"))
    b = bench.taker("b", {"z": unit}, named("pin", f=f"z {taken}"))
    bench.system.connect(a.y, b.u)
    bench.system.check()
    transformation = bench.system.transformation_of(bench.system.connections[0])
    assert (transformation and transformation.factor) == factor
