"""All recorded signals, to be chosen from and drawn."""

import base64
from collections.abc import Mapping
from itertools import product
from typing import Any

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from handover.cosim.blocks.ports import Floats
from handover.cosim.record.reader import Record
from handover.scenarios.experiment.display_unit import unit_symbol
from handover.scenarios.reporting.page import template
from handover.scenarios.reporting.plot_html import json_html
from handover.scenarios.reporting.section import Section
from handover.scenarios.reporting.thinned import changes_of, rows_of_curve

_BUDGET = 1_400_000
"""Bytes in the page for all signals, about."""
_FEWEST, _MOST = 60, 800
"""Points of a scalar signal."""
_A_POINT = 8 * 4 / 3
"""Bytes that a point takes: time and value as float32, in base64."""


def explorer_section(record: Record) -> Section | None:
    """Return what draws any signal of a record; None where nothing was recorded.

    A value that is held is kept exactly, as long as it does not change too often; curves by points between which
    straight lines look like them.
    """
    if len(record.time) < 2 or not record.signals:
        return None
    columns = sum(int(np.prod(record[name].shape[1:])) for name in record.signals)
    most = int(np.clip(_BUDGET / (_A_POINT * columns), _FEWEST, _MOST))
    time = record.time.astype(np.float32)
    data = {
        "span": [float(time[0]), float(time[-1])],
        "signals": [_signal(record, name, time, most) for name in record.signals],
    }
    html = template("explorer.html").render(data=json_html(data), scalars=columns, rows=len(time), most=most)
    return Section(anchor="signals", title="All signals", html=Markup(html), scripts=("explorer.js",))


def _signal(record: Record, name: str, time: NDArray[np.float32], most: int) -> dict[str, Any]:
    values = record[name]
    flat = values.reshape(len(values), -1).astype(np.float64)
    return {
        "name": name,
        "unit": unit_symbol(record.unit(name)),
        "about": record.description(name),
        "items": record.items(name) or ({0: "false", 1: "true"} if values.dtype == np.bool_ else {}),
        "columns": [
            {"of": of, **_column(flat[:, k], time, most)} for k, of in enumerate(_subscripts(values.shape[1:]))
        ],
    }


def _subscripts(shape: tuple[int, ...]) -> list[str]:
    """Return the subscripts of an array's elements, counted from 1 as in a record; [""] for a scalar."""
    return [",".join(str(i + 1) for i in index) for index in product(*map(range, shape))]


def _column(values: Floats, time: NDArray[np.float32], most: int) -> Mapping[str, Any]:
    """Return a scalar signal as the page draws it: one value, steps, or a curve."""
    changes = changes_of(values)
    if len(changes) == 0:
        return {"value": float(values[0]) if np.isfinite(values[0]) else None}
    held = len(changes) < 0.7 * len(values)
    few = held and len(changes) < most
    rows = np.union1d(changes, [0, len(values) - 1]) if few else rows_of_curve(values, most)
    return {"t": _packed(time[rows]), "y": _packed(values[rows].astype(np.float32)), "held": held}


def _packed(values: NDArray[np.float32]) -> str:
    return base64.b64encode(values.astype("<f4").tobytes()).decode()
