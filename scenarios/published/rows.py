"""How rows of a campaign's table are found by the parameters that their runs were given."""

import enum
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from handover.cosim.blocks.ports import Floats

Row = Mapping[str, Any]
"""A run in a campaign's table: columns and values, of which None is null."""


def has(row: Row, wanted: Mapping[str, str], names: Sequence[str], default: object) -> bool:
    """Return whether, of the named parameters, a row has those that are wanted, and of the others the defaults.

    Args:
        row: of the campaign's table.
        wanted: parameters and values, as texts.
        names: parameters that count besides those that are wanted.
        default: the scenario's parameters; those of units have the default where a run does not set them.
    """
    asked = {**wanted, **{name: None for name in names if name not in wanted}}
    return all(_is(row.get(name), text, getattr(default, name, None)) for name, text in asked.items())


def _is(value: Any, text: str | None, default: Any) -> bool:
    """Return whether a value, None or NaN if it was not set, is what a text says, or for None the default."""
    default = default.name.lower() if isinstance(default, enum.Enum) else default
    value = default if _is_unset(value) else value
    if text is None:
        return value is default or (default is not None and np.array_equal(np.asarray(value), np.asarray(default)))
    if value is None or isinstance(value, str):
        return value == text
    return np.array_equal(np.atleast_1d(value), _numbers(text))


def _is_unset(value: Any) -> bool:
    return value is None or value == "" or value != value


def _numbers(text: str) -> Floats:
    return np.array([{"true": 1.0, "false": 0.0}[x] if x in ("true", "false") else float(x) for x in text.split(",")])
