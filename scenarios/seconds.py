"""Numbers of seconds in a call."""

import re
import sys
from fractions import Fraction
from typing import Any

import click

_FORM = re.compile(r"[\d.]+(e[-+]?\d{1,3})?|\d+/\d+", re.IGNORECASE)
"""Larger exponents would take long to reckon with."""


class Seconds(click.ParamType):  # pyright: ignore[reportMissingTypeArgument] (generic in newer versions only)
    """A positive number of seconds, such as 0.01 or 1/30, taken exactly."""

    name = "seconds"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Fraction:
        """Return the number."""
        try:
            seconds = Fraction(value) if _FORM.fullmatch(value) else Fraction(0)
        except (ValueError, ZeroDivisionError):
            seconds = Fraction(0)
        if not sys.float_info.min <= seconds <= sys.float_info.max:
            self.fail(f"{value!r} is not a positive number of seconds, such as 0.01 or 1/30", param, ctx)
        return seconds
