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
