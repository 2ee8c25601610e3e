"""A unit of one's own, as `handover build` is given it: the path of a block's class."""

import sys
from fractions import Fraction
from pathlib import Path

from handover.cosim.blocks.declarations import DeclarationError
from handover.cosim.blocks.description import describe
from handover.cosim.exceptions import one_line
from handover.fmus.catalog import Entry, UnknownBlock, import_block
from handover.fmus.sources import closure
from handover.scenarios.execution.errors import BadCall

_STEP = Fraction(1, 100)  # s, of a block that is not sampled


def own_unit(path: str, step: str | None) -> Entry:
    """Return the unit that a path such as `spring:Spring` names; the working directory is searched first.

    Its step is that which is given, a number or a fraction of seconds, else the block's period, else 0.01 s.

    Raises:
        BadCall: there is no such class, its module does not load, it is no block, or the step is none.
    """
    here = str(Path.cwd())
    if here not in sys.path:
        sys.path.insert(0, here)
    given = None if step is None else _seconds(step)
    try:
        closure(path)
        period = describe(import_block(path)).period
    except (UnknownBlock, DeclarationError) as e:
        raise BadCall(f"{path}: {e}" if isinstance(e, DeclarationError) else str(e)) from e
    except Exception as e:  # a module may raise anything while it is loaded
        raise BadCall(f"{path}: its module cannot be loaded: {type(e).__name__}: {one_line(e)}") from e
    return Entry(path.rpartition(":")[2], path, given or period or _STEP, "")


def _seconds(text: str) -> Fraction:
    try:
        step = Fraction(text)
    except (ValueError, ZeroDivisionError):
        step = Fraction(0)
    if not sys.float_info.min <= step <= sys.float_info.max:
        raise BadCall(f"--step {text!r} is not a positive number of seconds, such as 0.01 or 1/30")
    return step
