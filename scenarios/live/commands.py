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

import math
from collections.abc import Collection, Sequence
from typing import Annotated, Any, NamedTuple, TypeVar

from msgspec import Meta, Struct

from handover.cosim.master.live_control import LiveControl
from handover.cosim.typed_data import InvalidData, Seed, checked, decoded
from handover.scenarios.experiment.live_inputs import Pushable
from handover.scenarios.live.played_run import Choice

T = TypeVar("T")

COMMANDS = ("pace", "pause", "go", "step", "stop", "choose", "see", "push")
LONGEST = 1000
"""Characters; no command of the page is longer."""
_MOST_CHOSEN, _MOST_PLOTS = 6, 200
_HIGHEST_PACE = 1000.0
_FAR = 5.0
"""Of a point from its body's frame along each axis, m."""


class InvalidCommand(ValueError):
    """What came over a connection is not a command of the page."""


_PACE: Any = Annotated[float, Meta(ge=0.0, le=_HIGHEST_PACE)]
_PlotNumber = Annotated[int, Meta(ge=0, lt=_MOST_PLOTS)]
_Coordinate = Annotated[float, Meta(ge=-_FAR, le=_FAR)]


class _Members(Struct, forbid_unknown_fields=True):
    """A command as it came."""

    command: str
    value: Any = None


class _Chosen(Struct, forbid_unknown_fields=True):
    """The value of `set`."""

    parameters: dict[str, str]
    seed: Seed | None = None
    push: bool = False


class _Pushed(Struct, forbid_unknown_fields=True):
    """The value of `push`."""

    body: str
    force: tuple[float, float, float]
    point: tuple[_Coordinate, _Coordinate, _Coordinate]


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
        members = decoded(text, _Members)
    except InvalidData as e:
        raise InvalidCommand(f'not {{"command": NAME, "value": VALUE}}: {e}') from e
    return Command(members.command, members.value)


def pace_of(value: Any) -> float:
    """Return the pace that a value says; infinite for as fast as it goes.

    Raises:
        InvalidCommand: it says none.
    """
    right = f"pace takes simulated seconds per second, up to {_HIGHEST_PACE:g}; 0: as fast as it goes"
    pace: float = _checked(value, _PACE, right)
    return pace or math.inf


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
    right = f"choose takes up to {_MOST_CHOSEN} names of signals"
    names = _checked(value, list[str], right)
    if not set(names) <= set(known) or len(names) > _MOST_CHOSEN:
        raise InvalidCommand(right)
    return names


def plot_numbers(value: Any) -> set[int]:
    """Return the numbers of plots that a value says.

    Raises:
        InvalidCommand: it says none.
    """
    return _checked(value, set[_PlotNumber], "see takes numbers of plots")


def choice_of(value: Any, known: Collection[str], *, seeded: bool) -> Choice:
    """Return the choice of parameters that a value says.

    Raises:
        InvalidCommand: it says none.
    """
    right = 'set takes {"parameters": {NAME: TEXT}, "seed": NUMBER}, with names of parameters'
    chosen = _checked(value, _Chosen, right)
    if not chosen.parameters.keys() <= set(known):
        raise InvalidCommand(right)
    return Choice(chosen.parameters, (chosen.seed or 0) if seeded else None, chosen.push)


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
    most = f"three finite numbers each of force, and of point, {_FAR:g} m at most"
    pushed = _checked(value, _Pushed, f"push takes a body, {most}")
    bodies = [push for push in known if pushed.body in push.labels]
    if not bodies:
        labels = ", ".join(label for push in known for label in push.labels)
        raise InvalidCommand(f"push takes a body that can be pushed: {labels}")
    if math.hypot(*pushed.force) > bodies[0].greatest * (1.0 + 1e-9):
        raise InvalidCommand(f"push takes a force of {bodies[0].greatest:g} N at most")
    return Push(bodies[0], pushed.force, pushed.point)


def run_number(value: Any, known: Collection[int]) -> int:
    """Return the number of a run.

    Raises:
        InvalidCommand: it is none of those that there are.
    """
    number = _checked(value, int, right := "it takes the number of a run that is over")
    if number not in known:
        raise InvalidCommand(right)
    return number


def _checked(value: Any, declared: type[T], right: str) -> T:
    """Return a command's value; if it is not of the declared type, raise InvalidCommand with what would be right."""
    try:
        return checked(value, declared)
    except InvalidData as e:
        raise InvalidCommand(f"{right}: {e}") from e
