"""Whether a class has what a block has, looked at before its ports are."""

from collections.abc import Mapping
from fractions import Fraction
from typing import Any, cast

from handover.cosim.declared_fields import DeclarationError

_ATTRIBUTES = ("feedthrough", "period")
_METHODS = ("outputs", "step", "get_state", "set_state")


def check_form(block: type[Any]) -> None:
    """Check a block class's attributes and methods.

    Raises:
        DeclarationError: some are missing, all of which are told, or an attribute is of a type that it cannot be of.
    """
    missing = [name for name in _ATTRIBUTES if not hasattr(block, name)]
    missing += [name for name in _METHODS if not callable(getattr(block, name, None))]
    if missing:
        what = "a block has these" if len(missing) > 1 else "a block has this"
        raise DeclarationError(block.__name__, ", ".join(missing), f"{what}; see handover.cosim.block.Block")
    for name, fault in (("period", _period_fault(block.period)), ("feedthrough", _feedthrough_fault(block))):
        if fault:
            raise DeclarationError(block.__name__, name, fault)


def _period_fault(period: object) -> str:
    if period is None:
        return ""
    if isinstance(period, Fraction):
        return "" if period > 0 else f"{period} s is not positive"
    try:
        exact = Fraction(str(period))
    except (ValueError, ZeroDivisionError):
        exact = Fraction(0)
    cure = repr(exact if exact > 0 else Fraction(1, 100))
    return f"{period!r} is not a fraction of seconds; {cure} is right, or None for a block that is not sampled"


def _feedthrough_fault(block: type[Any]) -> str:
    given: object = block.feedthrough
    example = 'such as {"y": ("u",)}, or {} where no input acts on an output at once'
    if not isinstance(given, Mapping):
        return f"{given!r} is not a mapping of outputs' names to tuples of inputs' names, {example}"
    for y, us in cast("Mapping[object, object]", given).items():
        if isinstance(us, str):
            return f"{y!r}: {us!r} is a text, not a tuple of inputs' names; ({us!r},) is right"
        if not isinstance(us, (tuple, list)):
            return f"{y!r}: {us!r} is not a tuple of inputs' names, {example}"
    return ""
