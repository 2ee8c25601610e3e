"""Getting and setting against the standards."""

import ctypes
import math
import random
from typing import Any

from support.faults.event_mode import advance, tick_is_due, to_step_mode
from support.faults.foreign_unit import Variable
from support.faults.subject import ERROR, NUMBERS, OK, Fault, Subject, references_of

UNKNOWN = (0xFFFFFFFF, 0x7FFFFFFF, 1_000_000)
HUGE = 1 << 60
BEFORE_START = ("instantiated", "initialisation")
REAL = ("Real", "Float64", "Float32")


def accessors(s: Subject) -> list[str]:
    """Return the types that have a getter and a setter."""
    return [kind for kind in (*NUMBERS, "Boolean", "Binary") if f"Get{kind}" in s.unit.functions]


def arguments(s: Subject, kind: str, references: Any, n: int, count: int) -> tuple[Any, ...]:
    """Return arguments for a getter or setter of a type, with memory for what may be read or written."""
    data = ctypes.create_string_buffer(16 * max(1, min(count, 10_000)))
    if kind == "Binary":
        return (references, n, ctypes.create_string_buffer(64), data, count)
    return (references, n, data, count) if s.unit.fmi == 3 else (references, n, data)


def pick(s: Subject, rng: random.Random, *causalities: str) -> Variable | None:
    """Return a random variable."""
    some = s.unit.of(*causalities)
    return rng.choice(some) if some else None


def unknown_reference(s: Subject, rng: random.Random) -> None:
    kind, n = rng.choice(accessors(s)), rng.choice([1, 2, HUGE])
    references = (ctypes.c_uint32 * 2)(rng.choice(UNKNOWN), 0)
    s.expect_refusal(rng.choice(["Get", "Set"]) + kind, *arguments(s, kind, references, n, 1))


def wrong_type(s: Subject, rng: random.Random) -> None:
    v = pick(s, rng, "input", "parameter", "output", "independent")
    if v is None:
        return
    kind = rng.choice([k for k in accessors(s) if k != v.type])
    references, n = references_of([v])
    s.expect_refusal(rng.choice(["Get", "Set"]) + kind, *arguments(s, kind, references, n, v.size))


def wrong_size(s: Subject, rng: random.Random) -> None:
    """FMI 3 only: FMI 2's functions take no number of values."""
    v = pick(s, rng, "input", "parameter", "output", "independent")
    if v is None or s.unit.fmi == 2:
        return
    references, n = references_of([v])
    size = rng.choice([v.size - 1, v.size + 1, 2 * v.size + 3, 1 << 63])
    more = arguments(s, v.type, references, n, v.size)[:-1]
    s.expect_refusal(rng.choice(["Get", "Set"]) + v.type, *more, size)


def null_pointer(s: Subject, rng: random.Random) -> None:
    v = pick(s, rng, "input", "parameter", "output", "independent")
    if v is None:
        return
    references, n = references_of([v])
    given = list(arguments(s, v.type, references, n, v.size))
    given[rng.choice([0, 2, 3] if v.type == "Binary" else [0, 2])] = None
    s.expect_refusal(rng.choice(["Get", "Set"]) + v.type, *given)


def nothing_with_null(s: Subject, rng: random.Random) -> None:
    """This is legal: no variables need no memory."""
    kind = rng.choice(accessors(s))
    more = (0,) if s.unit.fmi == 3 else ()
    middle = (None, None) if kind == "Binary" else (None,)
    verb = "Get" if s.mode == "terminated" else rng.choice(["Get", "Set"])
    s.demand(verb + kind, None, 0, *middle, *more)


def set_what_is_not_settable(s: Subject, rng: random.Random) -> None:
    """Outputs and the time never are, parameters only before the end of initialisation, inputs until the end."""
    causalities = ["output", "independent"]
    if s.mode not in BEFORE_START:
        causalities.append("parameter")
    if s.mode == "terminated":
        causalities.append("input")
    v = pick(s, rng, *causalities)
    if v is None:
        return
    references, n = references_of([v])
    s.expect_refusal(f"Set{v.type}", *arguments(s, v.type, references, n, v.size))


def get_output_too_early(s: Subject, rng: random.Random) -> None:
    v = pick(s, rng, "output")
    if v is None or s.mode != "instantiated":
        return
    references, n = references_of([v])
    s.expect_refusal(f"Get{v.type}", *arguments(s, v.type, references, n, v.size))


def bad_string(s: Subject, rng: random.Random) -> None:
    """NULL, or not UTF-8, perhaps after a valid one."""
    strings = [v for v in settable(s) if v.type == "String"]
    if not strings:
        return
    chosen = rng.sample(strings, rng.randint(1, len(strings)))
    values = [b"fine"] * (len(chosen) - 1) + [rng.choice([None, b"\xff\xfe", b"\xc3", b"x" * 100_000 + b"\x80"])]
    references, n = references_of(chosen)
    more = (n,) if s.unit.fmi == 3 else ()
    s.expect_refusal("SetString", references, n, (ctypes.c_char_p * n)(*values), *more)


def bad_binary(s: Subject, rng: random.Random) -> None:
    """A picture of another size, more bytes than fit, or NULL with a size above 0."""
    binaries = [v for v in settable(s) if v.type == "Binary"]
    if not binaries:
        return
    v = rng.choice(binaries)
    references, n = references_of([v])
    size = rng.choice([HUGE, (1 << 64) - 1, (v.exact or 1 << 30) + 1, *([v.exact - 1] if v.exact else [])])
    value, size = rng.choice([(b"xyz", size), (None, v.exact or 3)])
    s.expect_refusal("SetBinary", references, n, (ctypes.c_size_t * 1)(size), (ctypes.c_char_p * 1)(value), 1)


def settable(s: Subject) -> list[Variable]:
    """Return what may be set in the present mode."""
    if s.mode == "terminated":
        return []
    return s.unit.of("input", "parameter") if s.mode in BEFORE_START else s.unit.of("input")


def huge_string(s: Subject, rng: random.Random) -> None:
    """A megabyte is legal; what a block makes of it is its own business."""
    strings = [v for v in settable(s) if v.type == "String"]
    if strings:
        s.set([rng.choice(strings)], [[b"x" * 1_000_000]])
        go_on(s, must_fail=False)


def not_a_number(s: Subject, rng: random.Random) -> None:
    poison(s, rng, [v for v in settable(s) if v.type in REAL], rng.choice([math.nan, math.inf, -math.inf]))


def out_of_range(s: Subject, rng: random.Random) -> None:
    bounded = [v for v in settable(s) if v.causality == "parameter" and v.maximum is not None and v.type != "Binary"]
    if bounded:
        v = rng.choice(bounded)
        poison(s, rng, [v], 2 * (v.maximum or 0.0) + 1)


def unknown_item(s: Subject, rng: random.Random) -> None:
    poison(s, rng, [v for v in settable(s) if v.items], rng.choice([-1, 99, 1 << 30]))


def poison(s: Subject, rng: random.Random, variables: list[Variable], bad: float) -> None:
    """Set an entry of a variable to a value with which the unit must not go on, unless it rejects that immediately."""
    if not variables:
        return
    v = rng.choice(variables)
    values = [bad if v.start == () else x for x in v.start] or [bad] * v.size
    values[rng.randrange(v.size)] = bad
    if v.type not in REAL:
        values = [int(x) for x in values]
    status = s.set([v], [values])
    if status == OK:
        go_on(s, must_fail=True)
    elif status != ERROR:
        raise Fault(f"setting {v.name} to {values} is answered with {status}")


def go_on(s: Subject, *, must_fail: bool) -> None:
    """Make the call that uses what was set."""
    if s.mode == "instantiated":
        s.enter()
    if s.mode == "initialisation":
        passed = s.exit()
    elif s.next_tick < math.inf:
        passed = (tick_is_due(s) or advance(s, s.unit.period)) and to_step_mode(s)
    else:
        passed = advance(s, s.unit.step)
    if passed and must_fail:
        raise Fault("the unit goes on with a value that it should refuse")


REFUSALS = (
    unknown_reference,
    unknown_reference,
    wrong_type,
    wrong_type,
    wrong_size,
    null_pointer,
    nothing_with_null,
    set_what_is_not_settable,
    set_what_is_not_settable,
    get_output_too_early,
    bad_string,
    bad_binary,
)
POISONS = (huge_string, not_a_number, not_a_number, out_of_range, unknown_item)
