from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import networkx as nx
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.wording import Wording

from handover.cosim.blocks.variable import Causality, Kind
from handover.cosim.exceptions import ScheduleError
from handover.cosim.fmu.file.description import FmuDescription, FmuPort
from handover.cosim.system.loops import ordered, strongly_connected
from handover.cosim.system.schedule import Schedule
from handover.cosim.system.system import PlacedUnit, PortName, System

FEEDTHROUGH = {"y": ("u",)}
NOTHING: dict[str, Any] = {key: {} for key in ("parameters", "feedthrough", "presumed_feedthrough")}


def described(**facts: Any) -> FmuDescription:
    """Return a unit of one input u and one output y."""
    u, y = (
        FmuPort(name=name, kind=Kind.REAL, causality=causality, fmi_type="Float64", references=(0,))
        for name, causality in (("u", Causality.INPUT), ("y", Causality.OUTPUT))
    )
    none: dict[str, Any] = {"path": Path("none.fmu"), "fmi": 3, "name": "None", "identifier": "None", "token": ""}
    own: dict[str, Any] = {"step": None, "inputs": {"u": u}, "outputs": {"y": y}, "sampled": False}
    given: dict[str, Any] = {**none, **NOTHING, **own, **facts}
    return FmuDescription(**given)


def system(*pairs: str, period: Fraction = Fraction(1, 10), **units: str) -> System:
    """Return units with direct feedthrough, plain, presumed or sampled ones, connected as in `a>b`."""
    kinds: dict[str, dict[str, Any]] = {
        "direct": {"feedthrough": FEEDTHROUGH},
        "plain": {},
        "presumed": {"presumed_feedthrough": FEEDTHROUGH},
        "sampled": {"feedthrough": FEEDTHROUGH, "sampled": True},
    }
    s = System()
    for kind, names in units.items():
        for name in names.split():
            s.units[name] = PlacedUnit(name, described(**kinds[kind]), {}, period, kind == "sampled")
    for a, b in (pair.split(">") for pair in pairs):
        s.connect(PortName(a, "y"), PortName(b, "u"))
    return s


@pytest.mark.parametrize(
    ("s", "sampled", "continuous"),
    [
        pytest.param(
            system("plant>a", "a>b", "b>c", "c>plant", direct="c b a", plain="plant"), "", "plant a b c", id="chain"
        ),
        pytest.param(
            system("plant>eye", "eye>see", "see>servo", "servo>plant", plain="plant", sampled="servo see eye"),
            "eye see servo",
            "plant",
            id="sampled units stand apart",
        ),
        pytest.param(system("a>b", presumed="b a"), "", "a b", id="presumed feedthrough orders"),
        pytest.param(system(direct="z y x", plain="n m"), "", "z y x n m", id="no dependencies, kept order"),
        pytest.param(system("a>p", "p>a", direct="a", plain="p"), "", "p a", id="no loop through a plant"),
    ],
)
def test_units_come_after_those_that_they_depend_on(s: System, sampled: str, continuous: str):
    schedule = Schedule(s)
    assert [x.unit for x in schedule.sampled] == sampled.split()
    assert [x.unit for x in schedule.continuous] == continuous.split()
    assert not schedule.loops


def test_presumed_feedthrough_does_not_make_a_loop(caplog: pytest.LogCaptureFixture):
    assert [x.unit for x in Schedule(system("a>b", "b>a", presumed="a b")).slots] == ["a", "b"]
    assert "a does not declare its direct feedthrough" in caplog.text


def test_units_of_a_loop_stand_together_between_those_before_and_after():
    schedule = Schedule(system("a>b", "b>c", "c>a", "b>after", direct="after b c a", plain="plant"))
    assert schedule.loops
    assert [g.units for g in schedule.continuous_groups] == [("b", "c", "a"), ("after",), ("plant",)]
    assert schedule.continuous_groups[0].message.startswith("b.y -> c.u, c.u feeds through to c.y, c.y -> a.u")
    assert [str(c.source) for c in schedule.continuous_groups[0].back(["a", "b", "c"])] == ["a.y"]
    assert [str(c.source) for c in schedule.continuous_groups[0].back(["a", "b"])] == ["a.y"]
    assert schedule.continuous_groups[0].back(["b", "c"]) == []


def test_loops_that_share_a_unit_are_one_group():
    s = system("a>b", "b>a", "b>c", direct="a b c")
    inputs = {n: replace(s.units["b"].description.inputs["u"], name=n) for n in ("u", "w")}
    s.units["b"] = replace(s.units["b"], description=described(inputs=inputs, feedthrough={"y": ("u", "w")}))
    s.connect(PortName("c", "y"), PortName("b", "w"))
    (group,) = Schedule(s).continuous_groups
    assert set(group.units) == {"a", "b", "c"}
    assert len(group.cycle) == 4
    assert "(and 2 more connections between these outputs and inputs)" in group.message


def test_the_tick_divides_all_periods_exactly_and_time_does_not_drift(wording: Wording):
    s = system(direct="a", period=Fraction(1, 30))
    s.units |= system(plain="b", period=Fraction(1, 50)).units
    schedule = Schedule(s)
    assert schedule.tick == Fraction(1, 150)
    assert {x.unit: x.every for x in schedule.slots} == {"a": 5, "b": 3}
    schedule = Schedule(system(direct="a"))
    assert schedule.time(3) == 0.3
    assert schedule.time(10**9) == 1e8
    assert schedule.ticks(Fraction(1, 3)) == 4
    s.units |= system(direct="a", period=Fraction(33333, 999991)).units
    with pytest.raises(ScheduleError) as refused:
        Schedule(s)
    wording.check(refused.value)


@pytest.mark.parametrize(
    ("firm", "soft", "order", "soft_waits", "firm_waits"),
    [
        pytest.param({"c": "", "a": "", "b": ""}, {}, "cab", [], [], id="nothing is needed"),
        pytest.param({"a": "b", "b": "c", "c": ""}, {}, "cba", [], [], id="firmly"),
        pytest.param({"a": "", "b": "", "c": ""}, {"a": "b", "b": "c"}, "cba", [], [], id="softly"),
        pytest.param({"a": "b", "b": ""}, {"b": "a"}, "ba", [("b", {"a"})], [], id="a soft need gives way first"),
        pytest.param(
            {"after": "b", "b": "c", "c": "b"}, {}, "bafterc", [], [("b", {"c"})], id="a cycle opens where it holds up"
        ),
        pytest.param({"a": ""}, {"a": "a"}, "a", [("a", {"a"})], [], id="needs itself"),
    ],
)
def test_each_follows_what_it_needs(
    firm: dict[str, str], soft: dict[str, str], order: str, soft_waits: list[Any], firm_waits: list[Any]
):
    softly, firmly = list[Any](), list[Any]()
    found = ordered(firm, soft, lambda n, w: softly.append((n, {*w})), lambda n, w: firmly.append((n, {*w})))
    assert ("".join(found), softly, firmly) == (order, soft_waits, firm_waits)


@given(st.dictionaries(st.integers(0, 11), st.lists(st.integers(0, 13), max_size=4), max_size=12))
@settings(max_examples=50)
def test_those_that_need_each_other_are_the_components_that_networkx_finds(needs: dict[int, list[int]]):
    graph = nx.DiGraph([(a, b) for a, others in needs.items() for b in others if b in needs])
    graph.add_nodes_from(needs)
    rank = list(needs).index
    expected = [sorted(c, key=rank) for c in nx.strongly_connected_components(graph)]
    assert strongly_connected(needs) == sorted(expected, key=lambda component: rank(component[0]))


def test_a_chain_may_be_longer_than_pythons_stack():
    assert len(strongly_connected({i: [i + 1] for i in range(20000)})) == 20000


def test_steps_end_where_they_are_more_than_a_double_can_count():
    schedule = Schedule(system(plain="a", period=Fraction(1, 10**4)))
    assert schedule.end_of_steps(schedule.slots[0], Fraction(10**307)) == 1e307
