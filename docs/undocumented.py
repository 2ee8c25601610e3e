"""What lacks a description: public names, options, ports, parameters, scenarios and metrics, all at once.

Tests ask the same without building the site.
"""

import inspect
from collections.abc import Iterable, Iterator, Mapping

import click
from gallery import MetricRow
from loaded_commands import loaded

import handover
from handover.cosim.blocks.description import describe
from handover.fmus.catalog import UNITS, import_class
from handover.scenarios.catalog import SCENARIOS
from handover.scenarios.cli.command import main


class Undocumented(ValueError):
    """Something has no description; `names` lists all of it."""

    def __init__(self, names: Iterable[str]) -> None:
        self.names = tuple(names)
        super().__init__(f"no description of: {'; '.join(self.names)}")


def undocumented() -> list[str]:
    """Return what of the product's declarations has no description."""
    return [*_public_names(), *_options(), *_units(), *_scenarios()]


def undocumented_metrics(metrics: Mapping[str, Iterable[MetricRow]]) -> list[str]:
    """Return the metrics that have no description, of each scenario's."""
    return [f"metric {row.name} of {name}" for name, rows in metrics.items() for row in rows if not row.description]


def commands() -> Iterator[tuple[str, click.Command]]:
    """Return all commands with their names, `handover` itself as ""."""
    waiting: list[tuple[str, click.Command]] = [("", loaded(main))]
    while waiting:
        name, command = waiting.pop(0)
        yield name, command
        for child, found in sorted(getattr(command, "commands", {}).items()):
            waiting.append((f"{name} {child}".strip(), found))


def _public_names() -> Iterator[str]:
    for name in handover.__all__:
        offered = getattr(handover, name)
        if not _docstring(offered):
            yield f"handover.{name}"
        if inspect.isclass(offered) and offered.__module__.startswith("handover"):
            for member, value in vars(offered).items():
                described = isinstance(value, property) or inspect.isfunction(value)
                if described and not member.startswith("_") and not _docstring(value):
                    yield f"handover.{name}.{member}"


def _docstring(value: object) -> str:
    return getattr(value, "__doc__", None) or ""


def _options() -> Iterator[str]:
    for name, command in commands():
        if not command.help:
            yield f"command {name}"
        for parameter in command.params:
            if isinstance(parameter, click.Option) and not parameter.help and not parameter.hidden:
                yield f"option {parameter.opts[-1]} of handover {name}"


def _units() -> Iterator[str]:
    for entry in UNITS.values():
        declared = describe(import_class(entry.block))
        if not declared.doc:
            yield f"unit {entry.name}"
        yield from (f"{v.causality.value} {v.name} of {entry.name}" for v in declared.variables if not v.description)


def _scenarios() -> Iterator[str]:
    for name, kind in SCENARIOS.items():
        if not vars(kind).get("__doc__"):
            yield f"scenario {name}"
        yield from (f"parameter {v.name} of {name}" for v in kind.parameters() if not v.description)
