"""What a live page may ask for: texts of the form `{"command": NAME, "value": VALUE}`, checked before they do anything.

| command | value | what it does |
|---|---|---|
| `pace` | simulated seconds per second, up to 1000; 0: as fast as it goes | changes the pace of the run |
| `pause`, `go` | - | lets the run wait, or go on |
| `step` | - | pauses the run and lets it take one step |
| `stop` | - | ends the run after its step |
| `choose` | names of signals | lets the page have plots of them, too |
| `see` | numbers of plots | says which plots the page shows: only these are sent |
| `push` | `{"body": LABEL, "point": [x, y, z], "force": [x, y, z]}`, or null | pushes, in the body's frame and N in W |

Of a session of runs, besides:

| command | value | what it does |
|---|---|---|
| `set` | `{"parameters": {NAME: TEXT}, "seed": NUMBER, "push": BOOL}` | begins a run with these, others at defaults |
| `show` | number of a run that is over | shows it once more |
| `report` | number of a run that is over | writes its page |
"""

import json
import math
from collections.abc import Collection, Sequence
from typing import Any, NamedTuple, cast

from handover.cosim.master.live_control import LiveControl
from handover.scenarios.experiment.live_inputs import Pushable
from handover.scenarios.live.played_run import Choice

COMMANDS = ("pace", "pause", "go", "step", "stop", "choose", "see", "push")
LONGEST = 1000
"""Characters; no command of the page is longer."""
_MOST_CHOSEN, _MOST_PLOTS = 6, 200
_HIGHEST_PACE = 1000.0
_FAR = 5.0
"""Of a point from its body's frame along each axis, m."""


class InvalidCommand(ValueError):
    """What came over a connection is no command of the page."""


class Command(NamedTuple):
    """A command by its name, and its value as it came."""

    name: str
    value: Any


def parse_command(text: str, longest: int = LONGEST) -> Command:
    """Return a command of at most `longest` characters.

    Raises:
        InvalidCommand: it is none.
    """
    if len(text) > longest:
        raise InvalidCommand(f"a command has {longest} characters at most, this one {len(text)}")
    try:
        content: Any = json.loads(text)
    except (ValueError, RecursionError) as e:  # the latter of brackets within brackets
        raise InvalidCommand("it is not JSON") from e
    if not isinstance(content, dict):
        raise InvalidCommand('it is not of the form {"command": NAME, "value": VALUE}')
    members = cast(dict[str, Any], content)
    if not isinstance(members.get("command"), str):
        raise InvalidCommand('it is not of the form {"command": NAME, "value": VALUE}')
    return Command(members["command"], members.get("value"))


def pace_of(value: Any) -> float:
    """Return the pace that a value says; infinite for as fast as it goes.

    Raises:
        InvalidCommand: it says none.
    """
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0.0 <= value <= _HIGHEST_PACE:
        raise InvalidCommand(f"pace takes simulated seconds per second, up to {_HIGHEST_PACE:g}; 0: as fast as it goes")
    return float(value) or math.inf


def control_run(control: LiveControl, command: Command) -> None:
    """Carry out a command that controls a run.

    Raises:
        InvalidCommand: its value is not right.
    """
    name, value = command
    if name == "pace":
        control.pace = pace_of(value)
    elif name == "pause":
        control.paused = True
    elif name == "go":
        control.paused = False
    elif name == "step":
        control.ask_for_step()
    elif name == "stop":
        control.stop, control.paused = True, False


def signal_names(value: Any, known: Collection[str]) -> list[str]:
    """Return the signals that a value names.

    Raises:
        InvalidCommand: it names no signals, unknown ones, or too many.
    """
    names: list[Any] = cast(list[Any], value) if isinstance(value, list) else [None]
    if not all(isinstance(name, str) and name in known for name in names) or len(names) > _MOST_CHOSEN:
        raise InvalidCommand(f"choose takes up to {_MOST_CHOSEN} names of signals")
    return [str(name) for name in names]


def plot_numbers(value: Any) -> set[int]:
    """Return the numbers of plots that a value says.

    Raises:
        InvalidCommand: it says none.
    """
    numbers: list[Any] = cast(list[Any], value) if isinstance(value, list) else [None]
    if not all(isinstance(n, int) and 0 <= n < _MOST_PLOTS for n in numbers):
        raise InvalidCommand("see takes numbers of plots")
    return {int(n) for n in numbers}


def choice_of(value: Any, known: Collection[str], *, seeded: bool) -> Choice:
    """Return the choice of parameters that a value says.

    Raises:
        InvalidCommand: it says none.
    """
    right = InvalidCommand('set takes {"parameters": {NAME: TEXT}, "seed": NUMBER}, with names of parameters')
    members = cast(dict[str, Any], value) if isinstance(value, dict) else {}
    parameters: Any = members.get("parameters")
    seed: Any = members.get("seed")
    if not isinstance(parameters, dict) or not members.keys() <= {"parameters", "seed", "push"}:
        raise right
    texts = cast(dict[str, Any], parameters)
    if not all(name in known and isinstance(text, str) for name, text in texts.items()):
        raise right
    if seed is not None and (isinstance(seed, bool) or not isinstance(seed, int) or seed < 0):
        raise right
    return Choice(dict(texts), (seed or 0) if seeded else None, members.get("push") is True)


class Push(NamedTuple):
    """A push: of what, with which force, N, in W, and at which point, m, in the body's frame."""

    body: Pushable
    force: tuple[float, ...]
    point: tuple[float, ...]


def push_of(value: Any, known: Sequence[Pushable]) -> Push | None:
    """Return the push that a value says; None where it lets go.

    Raises:
        InvalidCommand: it says none of what can be pushed, or none with numbers that are finite and not too large.
    """
    if not known:
        raise InvalidCommand("nothing can be pushed in this run")
    if value is None:
        return None
    members = cast(dict[str, Any], value) if isinstance(value, dict) else {}
    bodies = [push for push in known if members.get("body") in push.labels]
    if not bodies:
        labels = ", ".join(label for push in known for label in push.labels)
        raise InvalidCommand(f"push takes a body that can be pushed: {labels}")
    greatest = bodies[0].greatest * (1.0 + 1e-9)
    force, point = _three(members.get("force"), greatest), _three(members.get("point"), _FAR)
    if force is None or point is None or math.hypot(*force) > greatest:
        most = f"{bodies[0].greatest:g} N at most"
        raise InvalidCommand(f"push takes three finite numbers each of force, {most}, and of point, {_FAR:g} m at most")
    return Push(bodies[0], force, point)


def _three(value: Any, most: float) -> tuple[float, ...] | None:
    """Return three finite numbers of at most `most` each, None if it is something else."""
    numbers: list[Any] = cast(list[Any], value) if isinstance(value, list) else []
    fit = all(isinstance(n, (int, float)) and not isinstance(n, bool) and abs(n) <= most for n in numbers)
    return tuple(map(float, numbers)) if fit and len(numbers) == 3 else None


def run_number(value: Any, known: Collection[int]) -> int:
    """Return the number of a run.

    Raises:
        InvalidCommand: it is none of those that there are.
    """
    if isinstance(value, bool) or not isinstance(value, int) or value not in known:
        raise InvalidCommand("it takes the number of a run that is over")
    return int(value)
