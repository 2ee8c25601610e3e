from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import networkx as nx
import pytest
from hypothesis import given
from hypothesis import strategies as st

from handover.cosim.blocks.variable import Causality, Kind
from handover.cosim.exceptions import ScheduleError
from handover.cosim.fmu.file.description import FmuDescription, FmuPort
from handover.cosim.system.ordering import ordered, strongly_connected
from handover.cosim.system.schedule import Schedule
from handover.cosim.system.system import PlacedUnit, PortName, System


def description(feedthrough: bool, presumed: bool, sampled: bool) -> FmuDescription:
    def ports(causality: Causality, *names: str) -> dict[str, FmuPort]:
        made = [
            FmuPort(name=n, kind=Kind.REAL, causality=causality, fmi_type="Float64", references=(0,)) for n in names
        ]
        return {p.name: p for p in made}

    return FmuDescription(
        path=Path("none.fmu"),
        fmi=3,
        name="None",
        identifier="None",
        token="",
        step=None,
        parameters={},
        inputs=ports(Causality.INPUT, "u"),
        outputs=ports(Causality.OUTPUT, "y"),
        feedthrough={"y": ("u",)} if feedthrough else {},
        presumed_feedthrough={"y": ("u",)} if presumed else {},
        sampled=sampled,
    )


def system(
    direct: str = "", plain: str = "", presumed: str = "", sampled: str = "", period: Fraction = Fraction(1, 10)
) -> System:
    s = System()
    for names, facts in (
        (direct, (True, False, False)),
        (plain, (False, False, False)),
        (presumed, (False, True, False)),
        (sampled, (True, False, True)),
    ):
        for name in names.split():
            d = description(*facts)
            s.units[name] = PlacedUnit(name, d, {}, period, d.sampled)
    return s


def connect(s: System, *pairs: str) -> None:
    for pair in pairs:
        a, b = pair.split(">")
        s.connect(PortName(a, "y"), PortName(b, "u"))


def test_a_chain_of_feedthrough_is_ordered_from_its_source():
    s = system("c b a", plain="plant")
    connect(s, "plant>a", "a>b", "b>c", "c>plant")
    assert [x.unit for x in Schedule(s).continuous] == ["plant", "a", "b", "c"]


def test_sampled_units_stand_apart_and_after_their_sources():
    s = system(plain="plant", sampled="servo vision camera")
    connect(s, "plant>camera", "camera>vision", "vision>servo", "servo>plant")
    schedule = Schedule(s)
    assert [x.unit for x in schedule.sampled] == ["camera", "vision", "servo"]
    assert [x.unit for x in schedule.continuous] == ["plant"]


def test_presumed_feedthrough_orders_but_does_not_make_a_loop(caplog: pytest.LogCaptureFixture):
    chain = system(presumed="b a")
    connect(chain, "a>b")
    assert [x.unit for x in Schedule(chain).slots] == ["a", "b"]
    loop = system(presumed="a b")
    connect(loop, "a>b", "b>a")
    assert [x.unit for x in Schedule(loop).slots] == ["a", "b"]
    assert "a does not declare its direct feedthrough" in caplog.text


def test_units_that_do_not_depend_on_each_other_keep_their_order():
    s = system("z y x", plain="n m")
    assert [x.unit for x in Schedule(s).slots] == ["z", "y", "x", "n", "m"]


def test_units_of_a_loop_stand_together_between_those_before_and_after():
    s = system("after b c a", plain="plant")
    connect(s, "a>b", "b>c", "c>a", "b>after")
    schedule = Schedule(s)
    assert schedule.loops
    assert [g.units for g in schedule.groups] == [("b", "c", "a"), ("after",), ("plant",)]
    assert schedule.groups[0].message.startswith("b.y -> c.u, c.u feeds through to c.y, c.y -> a.u")
    assert [str(c.source) for c in schedule.groups[0].back(["a", "b", "c"])] == ["a.y"]
    assert [str(c.source) for c in schedule.groups[0].back(["a", "b"])] == ["a.y"]
    assert schedule.groups[0].back(["b", "c"]) == []


def test_loops_that_share_a_unit_are_one_group():
    s = system("a b c")
    d = description(feedthrough=True, presumed=False, sampled=False)
    inputs = {n: replace(d.inputs["u"], name=n) for n in ("u", "w")}
    two = replace(d, inputs=inputs, feedthrough={"y": ("u", "w")})
    s.units["b"] = replace(s.units["b"], description=two)
    connect(s, "a>b", "b>a", "b>c")
    s.connect(PortName("c", "y"), PortName("b", "w"))
    (group,) = Schedule(s).groups
    assert set(group.units) == {"a", "b", "c"}
    assert len(group.cycle) == 4
    assert "(and 2 more connections between these outputs and inputs)" in group.message


def test_a_loop_through_a_plant_is_no_algebraic_loop():
    s = system("controller", plain="plant")
    connect(s, "controller>plant", "plant>controller")
    assert [x.unit for x in Schedule(s).slots] == ["plant", "controller"]


def test_the_tick_divides_all_periods_exactly():
    s = system("a", period=Fraction(1, 30))
    s.units |= system(plain="b", period=Fraction(1, 50)).units
    schedule = Schedule(s)
    assert schedule.tick == Fraction(1, 150)
    assert {x.unit: x.every for x in schedule.slots} == {"a": 5, "b": 3}


def test_time_does_not_drift():
    schedule = Schedule(system("a", period=Fraction(1, 10)))
    assert schedule.time(3) == 0.3
    assert schedule.time(10**9) == 1e8
    assert schedule.ticks(Fraction(1, 3)) == 4


def test_steps_that_fit_no_common_grid_are_refused():
    s = system("a", period=Fraction(33333, 999991))
    s.units |= system(plain="b", period=Fraction(1, 50)).units
    with pytest.raises(ScheduleError, match="a 33333/999991 s, b 1/50 s"):
        Schedule(s)


class DescribeWait:
    def __init__(self) -> None:
        self.soft: list[tuple[str, set[str]]] = []
        self.firm: list[tuple[str, set[str]]] = []

    def order(self, firm: dict[str, str], soft: dict[str, str] | None = None) -> str:
        def of_soft(name: str, waits: set[str]) -> None:
            self.soft.append((name, set(waits)))

        def of_firm(name: str, waits: set[str]) -> None:
            self.firm.append((name, set(waits)))

        return "".join(ordered(firm, soft or {}, of_soft, of_firm))


def test_things_keep_their_order_where_nothing_is_needed():
    assert DescribeWait().order({"c": "", "a": "", "b": ""}) == "cab"


def test_each_follows_what_it_needs_firmly_or_not():
    assert DescribeWait().order({"a": "b", "b": "c", "c": ""}) == "cba"
    assert DescribeWait().order({"a": "", "b": "", "c": ""}, {"a": "b", "b": "c"}) == "cba"


def test_a_soft_need_gives_way_before_a_firm_one():
    value = DescribeWait()
    assert value.order({"a": "b", "b": ""}, {"b": "a"}) == "ba"
    assert value.soft == [("b", {"a"})]
    assert value.firm == []


def test_a_cycle_of_firm_needs_opens_where_nothing_else_holds_it_up():
    value = DescribeWait()
    assert value.order({"after": "b", "b": "c", "c": "b"}) == "b" + "after" + "c"
    assert value.firm == [("b", {"c"})]
    assert value.soft == []


def test_what_needs_itself_softly_is_reported():
    value = DescribeWait()
    assert value.order({"a": ""}, {"a": "a"}) == "a"
    assert value.soft == [("a", {"a"})]


def test_those_that_need_each_other_are_together_in_the_order_given():
    sets = strongly_connected({"d": "c", "c": "b", "b": "c", "a": "x"})
    assert sorted(map("".join, sets)) == ["a", "cb", "d"]
    assert strongly_connected({}) == []


@given(st.dictionaries(st.integers(0, 11), st.lists(st.integers(0, 13), max_size=4), max_size=12))
def test_those_that_need_each_other_are_the_components_that_networkx_finds(needs: dict[int, list[int]]):
    graph = nx.DiGraph([(a, b) for a, others in needs.items() for b in others if b in needs])
    graph.add_nodes_from(needs)
    rank = list(needs).index
    expected = [sorted(c, key=rank) for c in nx.strongly_connected_components(graph)]
    assert strongly_connected(needs) == sorted(expected, key=lambda component: rank(component[0]))


def test_a_chain_may_be_longer_than_pythons_stack():
    assert len(strongly_connected({i: [i + 1] for i in range(20000)})) == 20000
