"""Parameters of a scenario that are parameters of its units: declared by the unit, exposed by the scenario.

`light: float = expose(CameraParams, "camera.light")` takes type, unit of measurement, default, range, text and origin
from the unit's declaration, and `carry` gives the scenario's value to `camera`. What an experiment has otherwise, such
as another default with its origin, is said beside the path.
"""

import functools
import typing
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import fields, is_dataclass, replace
from typing import Any

import numpy as np

from handover.cosim.blocks.declarations import DeclarationError, declared_variables
from handover.cosim.blocks.origins import Origin
from handover.cosim.blocks.ports import declared_field
from handover.cosim.blocks.variable import Causality
from handover.cosim.exceptions import nearest
from handover.cosim.system.system import PlacedUnit, System
from handover.scenarios.experiment.needs import Need
from handover.scenarios.experiment.places import Place

_BY_SCENARIO = "the scenario's parameter"


def expose(
    params: type[Any],
    *paths: str,
    start: Any = None,
    origin: Origin | None = None,
    minimum: float | None = None,
    maximum: float | None = None,
    description: str = "",
    needs: tuple[Need, ...] = (),
) -> Any:
    """Declare a scenario's parameter, as the default of a dataclass field, by that of a unit.

    Args:
        params: where the unit declares it, or another scenario of the same units.
        paths: `UNIT.NAME` of each parameter that gets the value, UNIT being the unit's name in the system; the first
            one's NAME is that in `params`. Of another scenario's parameter `NAME` alone, to which its own paths belong.
        start: the scenario's own default.
        origin: of that.
        minimum: the scenario's own lower bound.
        maximum: its own upper bound.
        description: the scenario's own text.
        needs: what others of the scenario's parameters must be for it to have an effect.

    Raises:
        DeclarationError: `params` does not declare it.
    """
    name = paths[0].rpartition(".")[2]
    metadata = next((f.metadata for f in fields(params) if f.name == name), {})
    if "declaration" not in metadata:
        raise DeclarationError(params.__name__, name, "it cannot be exposed, as it is not declared")
    own = {"origin": origin, "minimum": minimum, "maximum": maximum, "description": description or None, "start": start}
    declaration = replace(metadata["declaration"], **{k: v for k, v in own.items() if v is not None})
    hint = metadata.get("type", _hints(params)[name])
    own_paths = tuple(path for path in paths if "." in path)
    exposes = own_paths or metadata.get("exposes", ())
    needs = needs or metadata.get("needs", ())
    return declared_field(declaration, type=hint, exposes=exposes, of_units=bool(own_paths), needs=needs)


@functools.cache
def _hints(params: type[Any]) -> dict[str, Any]:
    return typing.get_type_hints(params, include_extras=True)


def exposed(parameters: Any) -> Iterator[tuple[str, str, str]]:
    """Yield of a class of parameters, or an instance, each name, and unit and name of what gets the value."""
    if is_dataclass(parameters):
        for f in fields(parameters):
            for path in f.metadata.get("exposes", ()):
                unit, _, name = path.partition(".")
                yield f.name, unit, name


def check_exposed(parameters: Any, units: Iterable[str]) -> None:
    """Check that each exposed parameter is one of a unit that the scenario has.

    A class of parameters may serve several scenarios, of which each has one of the units. What is exposed by way of
    another scenario's parameter, the scenario itself may read instead.

    Raises:
        DeclarationError: the scenario has none of a parameter's units.
    """
    if not is_dataclass(parameters):
        return
    known = list(units)
    for f in fields(parameters):
        of = [path.partition(".")[0] for path in f.metadata.get("exposes", ())]
        if f.metadata.get("of_units") and not set(of) & set(known):
            owner = parameters if isinstance(parameters, type) else type(parameters)
            fault = f"there is no unit {of[0]!r} to expose it of; {nearest(of[0], known)}"
            raise DeclarationError(owner.__name__, f.name, fault)


def carry(parameters: Any, system: System) -> System:
    """Return a system after giving its units the values of exposed parameters, but where they are set to others."""
    values: dict[str, dict[str, Any]] = {}
    for own, unit, name in exposed(parameters):
        values.setdefault(unit, {})[name] = getattr(parameters, own)
    for unit in values.keys() & system.units.keys():
        placed = system.units[unit]
        system.units[unit] = replace(placed, start={**values[unit], **placed.start})
    return system


def notes_on_exposed(parameters: Any, system: System) -> list[str]:
    """Return a line for each exposed parameter that is not at its default and that none of its units has."""
    if not is_dataclass(parameters):
        return []
    declared = {v.name: v for v in declared_variables(type(parameters), Causality.PARAMETER)}
    of_units: dict[str, list[tuple[PlacedUnit, str]]] = {}
    for own, unit, name in exposed(parameters):
        if unit in system.units:
            of_units.setdefault(own, []).append((system.units[unit], name))
    return [
        f"{own}: {' and '.join(f'{u.name} ({u.description.name}) has no {n}' for u, n in ends)}, so it is not set there"
        for own, ends in of_units.items()
        if not any(name in unit.description.settable for unit, name in ends)
        if not np.array_equal(getattr(parameters, own), declared[own].start)
    ]


def with_exposed(places: Mapping[str, Place], parameters: type[Any], said: str = "") -> Mapping[str, Place]:
    """Return places whose units may have the parameters that the scenario exposes.

    Of those of another scenario, whose parameters this one does not have, `said` is what there is to know.
    """
    for own, unit, name in exposed(parameters):
        if unit in places and name not in {**(place := places[unit]).required, **place.optional}:
            text = said or (_BY_SCENARIO if own == name else f"{_BY_SCENARIO} {own}")
            places = {**places, unit: replace(place, optional={**place.optional, name: text})}
    return places
