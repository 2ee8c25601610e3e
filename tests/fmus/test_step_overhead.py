"""What a step of an FMU costs beyond that of the plain object.

`pytest tests/fmus/test_step_overhead.py --benchmark-enable` prints it: 12 real inputs and 13 outputs, the FMU called
through ctypes with prepared arguments.
"""

import ctypes
import itertools
from typing import Any

import pytest
from ctypes_host import BOOL, DOUBLE
from sample_units.scalars import Inputs, Params, Scalars
from workshop import Workshop

DT = 1 / 128


def test_plain_object(benchmark: Any):
    block, u = Scalars(Params()), Inputs()
    y = benchmark(lambda: block.step(0.0, DT, u))
    assert y.y13 == DT


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("apart", ["0", "1"], ids=["in the host's process", "in a process of its own"])
def test_fmu(benchmark: Any, workshop: Workshop, monkeypatch: pytest.MonkeyPatch, fmi: int, apart: str):
    monkeypatch.setenv("FMU_PYTHON_PROCESS", apart)
    host = workshop.host("scalars:Scalars", fmi)
    host.initialise()
    step = getattr(host.library, f"fmi{fmi}DoStep")
    flags, last = (BOOL * 3)(), DOUBLE()
    pointers = [ctypes.addressof(flags) + i for i in range(3)] + [ctypes.addressof(last)]
    step.argtypes = [ctypes.c_void_p, DOUBLE, DOUBLE, ctypes.c_int] + [ctypes.c_void_p] * (4 if fmi == 3 else 0)
    more = (0, *pointers) if fmi == 3 else (0,)
    instance, count = host.instance, itertools.count()
    assert benchmark(lambda: step(instance, next(count) * DT, DT, *more)) == 0
    assert host.get("y13")[0] == next(count) * DT


def test_a_call_that_does_nothing(benchmark: Any, workshop: Workshop):
    """What ctypes itself takes of the above."""
    step = workshop.host("scalars:Scalars", 2).library.fmi2DoStep
    step.argtypes = [ctypes.c_void_p, DOUBLE, DOUBLE, ctypes.c_int]
    assert benchmark(lambda: step(None, 0.0, DT, 0)) == 3
