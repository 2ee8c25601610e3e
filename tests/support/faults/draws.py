"""Random values that a unit's XML allows."""

import random
from collections.abc import Mapping
from typing import Any

from support.faults.foreign_unit import Variable

COSTLY: Mapping[str, int] = {"discs_1": 8, "discs_2": 8, "discs_3": 8, "hinges": 8, "hinges_dynamic": 3, "N": 200}
"""Most of what makes a unit slow and that its declaration allows more of; two thousand runs have no time for it."""

STRINGS = ("", "a", "größer 100% #7#", "x" * 300)


def legal_values(v: Variable, rng: random.Random, *, wide: bool) -> list[Any]:
    """Return entries for a variable, within its bounds: near its start, or if `wide` sometimes anywhere.

    A picture or bytes come as one entry, as does a string.
    """
    if v.type == "Boolean":
        return [rng.random() < 0.5 for _ in range(v.size)]
    if v.type == "String":
        return [rng.choice(STRINGS).encode() for _ in range(v.size)]
    if v.type == "Binary":
        return [_binary(v, rng)]
    if v.items:
        return [rng.choice(v.items) for _ in range(v.size)]
    anywhere = wide and rng.random() < 0.2
    if v.type in ("Real", "Float64", "Float32"):
        values = [_real(v, x, rng, anywhere=anywhere) for x in v.start]
        return _unit_quaternion(values) if v.name.startswith("q_") and len(values) == 4 else values
    return [_whole(v, int(x), rng, anywhere=anywhere) for x in v.start]


def _real(v: Variable, start: float, rng: random.Random, *, anywhere: bool) -> float:
    if v.minimum is None or v.maximum is None:
        x = start + rng.gauss(0.0, 0.1) * (1.0 + abs(start))
        return min(max(x, x if v.minimum is None else v.minimum), x if v.maximum is None else v.maximum)
    if anywhere:
        return rng.choice([v.minimum, v.maximum, rng.uniform(v.minimum, v.maximum)])
    scale = min(0.1 * (v.maximum - v.minimum), 0.2 * abs(start) or 1.0)
    return min(max(start + rng.gauss(0.0, scale), v.minimum), v.maximum)


def _whole(v: Variable, start: int, rng: random.Random, *, anywhere: bool) -> int:
    low = start if v.minimum is None else int(v.minimum)
    high = int(min(COSTLY.get(v.name, 10_000), 10_000 if v.maximum is None else v.maximum))
    x = rng.randint(low, max(low, high)) if anywhere else start + rng.randint(-1, 1)
    return min(max(x, low), max(low, high))


def _unit_quaternion(values: list[float]) -> list[float]:
    length = sum(x * x for x in values) ** 0.5
    return [x / length for x in values] if length > 1e-6 else [1.0, 0.0, 0.0, 0.0]


def _binary(v: Variable, rng: random.Random) -> bytes:
    """Return bytes; of a picture with random bytes in its first rows, the rest black."""
    if v.exact is None:
        return rng.randbytes(rng.randrange(200))
    return b"" if rng.random() < 0.2 else rng.randbytes(4096).ljust(v.exact, b"\0")
