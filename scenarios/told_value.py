"""Writes values of parameters and options as one types them."""

from typing import Any


def told_value(value: Any) -> str:
    """Return a number to six digits, true or false, and else the text of a value."""
    if isinstance(value, float):
        return f"{value:g}"
    return str(value).lower() if isinstance(value, bool) else str(value)
