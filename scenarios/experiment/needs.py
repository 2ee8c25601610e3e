"""What a scenario's parameter needs of others: while they are otherwise, nothing comes of it, whatever its value.

`waypoints: str = parameter("", "...", needs=(being("path", Path.CUSTOM),))`: where a path is not custom, another value
than the default is refused (`check_effects` in `handover.scenarios.experiment.parameters`). `expose` takes needs, too.
A unit's parameters have none: which others it goes by, its `Params` check themselves.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields, is_dataclass
from typing import Any, TypeVar

import numpy as np

from handover.cosim.blocks.declarations import DeclarationError
from handover.cosim.blocks.origins import Origin
from handover.cosim.blocks.ports import Declaration, declared_field

T = TypeVar("T")


@dataclass(frozen=True)
class Need:
    """What others of a scenario's parameters must be for one to have an effect, see `any_of` and `being`.

    Attributes:
        names: of the parameters, one of which has to be so.
        values: that it has one of; without any, all but 0, false and empty will do.
    """

    names: tuple[str, ...]
    values: tuple[Any, ...] = ()

    def is_met(self, parameters: Any) -> bool:
        """Return whether one of the parameters is so."""
        given = [getattr(parameters, name) for name in self.names]
        if not self.values:
            return any(np.any(value) if not isinstance(value, str) else value for value in given)
        return any(np.array_equal(value, right) for value in given for right in self.values)


def any_of(*names: str) -> Need:
    """Return the need that one of these parameters is set to something: it is not 0, false, empty or the first item."""
    return Need(names)


def being(name: str, *values: Any) -> Need:
    """Return the need that a parameter has one of these values."""
    return Need((name,), values)


def parameter(
    default: T,
    description: str,
    *,
    minimum: float | None = None,
    maximum: float | None = None,
    origin: Origin | None = None,
    needs: tuple[Need, ...] = (),
) -> T:
    """Declare a scenario's parameter like `handover.cosim.blocks.ports.parameter`, and what it needs: all of it."""
    d = Declaration(description=description, start=default, minimum=minimum, maximum=maximum, origin=origin)
    return declared_field(d, needs=needs)


def needs_of(parameters: Any) -> Mapping[str, tuple[Need, ...]]:
    """Return the needs of the parameters that have any, of a class of parameters or an instance.

    Raises:
        DeclarationError: a parameter needs one that is not a field beside it.
    """
    declared = fields(parameters) if is_dataclass(parameters) else ()
    found = {f.name: needs for f in declared if (needs := f.metadata.get("needs"))}
    known = {f.name for f in declared}
    for name, needs in found.items():
        if unknown := [other for need in needs for other in need.names if other not in known]:
            owner = parameters if isinstance(parameters, type) else type(parameters)
            fault = f"it needs {', '.join(unknown)}, which is not a field beside it"
            raise DeclarationError(owner.__name__, name, fault)
    return found
