"""Partial derivatives, as the standards allow them and as they do not."""

import ctypes
import math
import random
from typing import Any

from support.faults.foreign_unit import Variable
from support.faults.subject import Fault, Subject, references_of

FUNCTIONS = ("GetDirectionalDerivative", "GetAdjointDerivative")
MODES = ("initialisation", "stepping", "event", "terminated")
REAL = ("Real", "Float64")


def functions(s: Subject) -> list[str]:
    """Return the functions that give derivatives."""
    return [f for f in FUNCTIONS if f in s.unit.functions]


def some(s: Subject, rng: random.Random, causality: str) -> list[Variable]:
    """Return a few real variables."""
    real = [v for v in s.unit.of(causality) if v.type in REAL]
    return rng.sample(real, rng.randint(1, len(real)))


def ask(s: Subject, rng: random.Random, function: str) -> tuple[list[Any], Any]:
    """Return valid arguments and the memory for the result."""
    unknowns, knowns = some(s, rng, "output"), some(s, rng, "input")
    sides = [sum(v.size for v in vs) for vs in (knowns, unknowns)]
    n_seed, n_answer = reversed(sides) if "Adjoint" in function else sides
    seed, answer = (
        (ctypes.c_double * n_seed)(*(rng.gauss(0.0, 1.0) for _ in range(n_seed))),
        (ctypes.c_double * n_answer)(),
    )
    vectors = (seed, n_seed, answer, n_answer) if s.unit.fmi == 3 else (seed, answer)
    return [*references_of(unknowns), *references_of(knowns), *vectors], answer


def derive(s: Subject, rng: random.Random) -> None:
    """Ask for derivatives at the present inputs, where there are any: numbers."""
    if not s.unit.has_derivatives:
        return
    function = rng.choice(functions(s))
    given, answer = ask(s, rng, function)
    if s.attempt(function, *given) and not all(map(math.isfinite, answer)):
        raise Fault(f"{function} gives {list(answer)}")


def wrong_derivative(s: Subject, rng: random.Random) -> None:
    """Not offered, in a wrong mode, of what is not an output or no input, without memory, of sizes that do not fit."""
    function = rng.choice(functions(s))
    if not s.unit.has_derivatives:
        memory = ctypes.create_string_buffer(64)
        s.expect_refusal(
            function, memory, 1, memory, 1, *((memory, 1, memory, 1) if s.unit.fmi == 3 else (memory, memory))
        )
        return
    given, _ = ask(s, rng, function)
    if s.mode in MODES:
        i = rng.randrange(6)
        if i == 0:
            given[0:2], given[2:4] = given[2:4], given[0:2]
        elif i == 1:
            given[rng.choice([0, 2])] = (ctypes.c_uint32 * 64)(*[0xFFFFFFFF] * 64)
        elif i == 2:
            given[4][0] = rng.choice([math.nan, math.inf])
        elif i == 3 and s.unit.fmi == 3:
            at = rng.choice([5, 7])
            given[at] += rng.choice([-1, 1, 1 << 60])
        else:
            given[rng.choice([0, 2, 4, 6 if s.unit.fmi == 3 else 5])] = None
    s.expect_refusal(function, *given)


REFUSALS = (wrong_derivative,)
