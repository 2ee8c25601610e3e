"""Signals of no unit: arrays under names, as a recorder sees them."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handover.cosim.blocks.ports import Width
from handover.cosim.blocks.variable import Causality, Kind
from handover.cosim.fmu.file.description import FmuPort
from handover.cosim.system.signals import Signals

_KINDS = {"f": Kind.REAL, "i": Kind.INTEGER, "u": Kind.INTEGER, "b": Kind.BOOLEAN}


def signals_of(arrays: Mapping[str, NDArray[Any]], **more: Any) -> Signals:
    """Return outputs of a unit `unit`, named and held by these arrays; `more` are further attributes of all ports."""
    ports = {name: port_of(name, a, **more) for name, a in arrays.items()}
    return Signals({"unit": {name: (a,) for name, a in arrays.items()}}, {"unit": ports}, None)


def port_of(name: str, values: NDArray[Any], **more: Any) -> FmuPort:
    facts: dict[str, Any] = {
        "name": name,
        "kind": _KINDS[values.dtype.kind],
        "causality": Causality.OUTPUT,
        "fmi_type": "any",
        "references": (0,),
        "shape": () if len(values) == 1 else (len(values),),
        "width": Width.UINT64 if values.dtype == np.uint64 else None,
    }
    return FmuPort(**(facts | more))
