"""The standards' call for directional derivatives of one instance."""

import ctypes
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.cosim.fmu_description import FmuDescription, FmuPort
from handover.cosim.state_calls import Call


def derivatives_along(
    call: Call, fmi: int, description: FmuDescription, outputs: Sequence[str], inputs: Mapping[str, Floats]
) -> dict[str, Floats]:
    """Return how outputs change with inputs; see `Instance.directional_derivative`."""
    unknowns, knowns = [description.outputs[y] for y in outputs], [description.inputs[u] for u in inputs]
    seed = np.concatenate([np.asarray(inputs[p.name], dtype=np.float64) for p in knowns])
    found = np.zeros(sum(p.size for p in unknowns))
    references = (_references(unknowns), _references(knowns))
    lengths = ((), ()) if fmi == 2 else ((len(seed),), (len(found),))
    vectors = (_doubles(seed), *lengths[0], _doubles(found), *lengths[1])
    call("GetDirectionalDerivative", *(a for r in references for a in (r, len(r))), *vectors)
    ends = np.cumsum([p.size for p in unknowns])[:-1]
    return dict(zip(outputs, np.split(found, ends), strict=True))


def _references(ports: Sequence[FmuPort]) -> Any:
    references = [r for p in ports for r in p.references]
    return (ctypes.c_uint * len(references))(*references)


def _doubles(values: Floats) -> Any:
    return values.ctypes.data_as(ctypes.POINTER(ctypes.c_double))
