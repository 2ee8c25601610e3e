"""Numbers of a call that are neither infinite nor none."""

import math
from typing import Any

import click


class FiniteRange(click.FloatRange):
    """A number of a range; `click.FloatRange` lets infinity and not-a-number through."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Return the number."""
        number = float(super().convert(value, param, ctx))
        if not math.isfinite(number):
            self.fail(f"{value} is not a finite number in the range {self._describe_range()}.", param, ctx)
        return number
