import networkx as nx
from hypothesis import given
from hypothesis import strategies as st

from handover.cosim.system.ordering import ordered, strongly_connected


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
