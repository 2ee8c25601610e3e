"""Puts things in an order in which each comes after those that it needs, and finds those that need each other."""

import heapq
from collections import defaultdict
from collections.abc import Callable, Collection, Hashable, Mapping
from typing import TypeVar

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

T = TypeVar("T", bound=Hashable)

Needs = Mapping[T, Collection[T]]
"""What each thing needs; things that are no keys are left out of account."""

DescribeWait = Callable[[T, set[T]], None]
"""Told of a thing that is placed before others that it needs."""


def strongly_connected(needs: Needs[T]) -> list[list[T]]:
    """Return the sets of things that need each other, directly or through others; each set in the order given."""
    names = list(needs)
    if not names:
        return []
    place = {name: i for i, name in enumerate(names)}
    pairs = [(place[b], place[a]) for a, others in needs.items() for b in others if b in place]
    ends = np.array(pairs, dtype=np.int64).reshape(-1, 2)
    graph = csr_array((np.ones(len(pairs)), (ends[:, 0], ends[:, 1])), shape=(len(names), len(names)))
    _, labels = connected_components(graph, directed=True, connection="strong")
    sets: dict[int, list[T]] = defaultdict(list)
    for name, label in zip(names, labels.tolist(), strict=True):
        sets[label].append(name)
    return list(sets.values())


def ordered(firm: Needs[T], soft: Needs[T], describe_soft: DescribeWait[T], describe_firm: DescribeWait[T]) -> list[T]:
    """Order the keys of `firm` so that each follows those that it needs; as given where nothing is said.

    Where needs close a circle, a soft one is passed over first, then a firm one of a circle that nothing outside it
    holds up.
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
