"""Graph algorithms of the schedule: topological order, and strongly connected components.

They work on units, on ports and on groups of units alike, which are called items here.
"""

import heapq
from collections import defaultdict
from collections.abc import Callable, Collection, Hashable, Iterator, Mapping
from typing import TypeVar

T = TypeVar("T", bound=Hashable)

Needs = Mapping[T, Collection[T]]
"""The items that each item needs; needed items that are no keys are ignored."""

DescribeWait = Callable[[T, set[T]], None]
"""Called for an item that is placed before others that it needs, with those others."""


def strongly_connected(needs: Needs[T]) -> list[list[T]]:
    """Return the strongly connected components: sets of items that need each other; each in the order given.

    Tarjan's algorithm, without recursion: systems have more units than Python has stack.
    """
    found: dict[T, int] = {}  # when each item was found
    lowest: dict[T, int] = {}  # the earliest item on the path that an item leads back to
    component: dict[T, T] = {}  # by item, the item at which its component was closed
    open_items: list[T] = []  # items of no component yet, as they were found
    for start in needs:
        if start in found:
            continue
        path: list[tuple[T, Iterator[T]]] = [(start, iter(needs[start]))]
        found[start] = lowest[start] = len(found)
        open_items.append(start)
        while path:
            item, others = path[-1]
            for other in others:
                if other not in found:
                    if other in needs:
                        found[other] = lowest[other] = len(found)
                        open_items.append(other)
                        path.append((other, iter(needs[other])))
                        break
                elif other not in component and found[other] < lowest[item]:
                    lowest[item] = found[other]
            else:
                path.pop()
                if path and lowest[item] < lowest[path[-1][0]]:
                    lowest[path[-1][0]] = lowest[item]
                while lowest[item] == found[item] and item not in component:
                    component[open_items.pop()] = item
    members: dict[T, list[T]] = defaultdict(list)
    for item in needs:
        members[component[item]].append(item)
    return list(members.values())


def ordered(firm: Needs[T], soft: Needs[T], describe_soft: DescribeWait[T], describe_firm: DescribeWait[T]) -> list[T]:
    """Order the keys of `firm` so that each follows those that it needs; otherwise in the order given.

    Where needs form a cycle, it is broken at a soft need if there is one, else at a firm need of a cycle that does not
    wait for anything outside of it. The callbacks are called for each item at which a cycle was broken.
    """
    rank = {name: i for i, name in enumerate(firm)}
    waits_firm = {n: {m for m in firm[n] if m in rank} for n in rank}
    waits_soft = {n: {m for m in soft.get(n, ()) if m in rank} - waits_firm[n] for n in rank}
    followers: dict[T, list[T]] = defaultdict(list)
    for n in rank:
        for m in waits_firm[n] | waits_soft[n]:
            followers[m].append(n)
    ready = [(rank[n], n) for n in rank if not waits_firm[n] and not waits_soft[n]]
    left = dict.fromkeys(rank)
    order: list[T] = []
    while left:
        if ready:
            _, chosen = heapq.heappop(ready)
        elif (free := next((n for n in left if not waits_firm[n]), None)) is not None:
            chosen = free
            describe_soft(chosen, waits_soft[chosen])
        else:
            chosen = _blocked_by_its_cycle({n: waits_firm[n] for n in left})
            describe_firm(chosen, waits_firm[chosen])
        del left[chosen]
        order.append(chosen)
        for n in followers[chosen]:
            waits_firm[n].discard(chosen)
            waits_soft[n].discard(chosen)
            if n in left and not waits_firm[n] and not waits_soft[n]:
                heapq.heappush(ready, (rank[n], n))
    return order


def _blocked_by_its_cycle(waits: Needs[T]) -> T:
    cycles = strongly_connected(waits)
    return next(c[0] for c in cycles if all(set(waits[n]) <= set(c) for n in c))
