"""What the free-flyer's runs are otherwise than usual, and how rows of a campaign's table are found by it."""

import enum
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.plants.free_flyer.robot.navigation import Params as NavigationParams
from handover.scenarios.campaign.table import CampaignTable
from handover.scenarios.free_flyer.parameters import Task

Row = Mapping[str, Any]
"""A run in a campaign's table: columns and values, of which None is null."""

TASKS = {
    Task.ROBOT_TO_HUMAN: "robot to human",
    Task.HUMAN_TO_ROBOT: "human to robot",
    Task.FAILED_RECEPTION: "failed reception",
    Task.COLLABORATIVE: "collaborative",
}
"""The four handovers in words."""

PATIENCE = "30"
"""Time after which a robot that feels nothing gives up, s: its flights take half of that."""

ESTIMATED = ("position", "attitude", "velocity", "rate")
"""What the navigation estimates, as its parameters are named."""


@dataclass(frozen=True)
class Variation:
    """Something that is otherwise than in the scenario's defaults.

    Attributes:
        label: what, and by how much, in words.
        parameters: that make it, as texts; {} for the defaults.
    """

    label: str
    parameters: Mapping[str, str] = field(default_factory=dict[str, str])


USUAL = Variation("")

EXACT = {f"navigation.{what}_noise": "0" for what in ESTIMATED}
"""Parameters of a navigation without noise."""


def noise_times(factor: float) -> Variation:
    """Return a navigation whose four noises are a factor times the default ones."""
    usual = vars(NavigationParams())
    names = [f"{what}_noise" for what in ESTIMATED]
    return Variation(f"noise x {factor:g}", {f"navigation.{name}": f"{factor * usual[name]:g}" for name in names})


def names_of(variations: Sequence[Variation]) -> tuple[str, ...]:
    """Return the parameters that variations set, each once."""
    return tuple(dict.fromkeys(name for v in variations for name in v.parameters))


def has(row: Row, wanted: Mapping[str, str], names: Sequence[str], default: object) -> bool:
    """Return whether, of the named parameters, a row has those that are wanted, and of the others the defaults.

    Args:
        row: of the campaign's table.
        wanted: parameters and values, as texts.
        names: parameters that count besides those that are wanted.
        default: the scenario's parameters; those of units have the default where a run does not set them.
    """
    if not all(_is(row.get(name), text, getattr(default, name, None)) for name, text in wanted.items()):
        return False
    others = (name for name in names if name not in wanted)
    return all(_is(row.get(name), None, getattr(default, name, None)) for name in others)


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


def values_of(rows: Sequence[Row], column: str) -> Floats:
    """Return a column's values in those rows that have it, in their order."""
    found = [row.get(column) for row in rows]
    return np.array([float(x) for x in found if x is not None and x == x])


def acted_alone(rows: Sequence[Row]) -> int:
    """Return in how many runs the robot let go or closed with nobody at the gripper."""
    return int((values_of(rows, "unprovoked") > 0).sum())


def succeeded(rows: Sequence[Row]) -> int:
    """Return how many of some runs succeeded; one that did not come to its end did not."""
    return sum(is_done(row) and bool(row["success"]) for row in rows)


def succeeded_touched(rows: Sequence[Row]) -> int:
    """Return how many succeeded and had the robot act only on a touch; success after it acted untouched is luck."""
    return sum(succeeded([row]) for row in rows if not acted_alone([row]))


def changed_hands(rows: Sequence[Row]) -> int:
    """Return in how many the object went where it should, even if the robot gave up on its way back."""
    return int((values_of(rows, "handed_over") > 0).sum())


def known_rows(table: CampaignTable) -> Sequence[Row]:
    """Return the runs of which something is known: one that was lost says nothing, and the same call tries it again."""
    return [row for row in table.rows if row["status"] != "lost"]


def is_done(row: Row) -> bool:
    """Return whether a run came to its end."""
    return row["status"] == "done"


def unfinished_note(rows: Sequence[Row]) -> str:
    """Return a sentence on the runs that did not come to their end; "" if all did."""
    count = sum(not is_done(row) for row in rows)
    return f"{count} of {len(rows)} runs did not come to their end, and count as failures." if count else ""
