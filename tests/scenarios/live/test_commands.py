"""What a live page may ask for, and which texts are none of it."""

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import pytest
from support.wording import Wording

from handover.cosim.master.live_control import LiveControl
from handover.scenarios.experiment.live_inputs import Pushable
from handover.scenarios.live.commands import (
    LONGEST,
    Command,
    InvalidCommand,
    choice_of,
    control_run,
    parse_command,
    plot_numbers,
    push_of,
    run_number,
    signal_names,
)
from handover.scenarios.robots.free_flyer.robot_wiring import PUSHES

STRONG = [replace(push, greatest=40.0) for push in PUSHES]
PUSH = {"body": "robot", "force": [1.0, 0.0, 0.0], "point": [0.1, 0.0, 0.0]}


def chosen(value: Any) -> object:
    return choice_of(value, ["force"], seeded=True)


def pushed(known: Sequence[Pushable] = PUSHES, **other: Any) -> object:
    return push_of({**PUSH, **other}, known)


def controlled(name: str, value: Any = None, control: LiveControl | None = None) -> None:
    control_run(control or LiveControl.in_memory(1.0), Command(name, value))


REFUSED: dict[str, Callable[[], object]] = {
    "cut off": lambda: parse_command("{"),
    "a list": lambda: parse_command("[]"),
    "nothing": lambda: parse_command("{}"),
    "no number of JSON": lambda: parse_command('{"command": "pace", "value": NaN}'),
    "another member": lambda: parse_command('{"command": "pause", "more": 1}'),
    "too long": lambda: parse_command(" " * (LONGEST + 1)),
    "a pace backwards": lambda: controlled("pace", -1),
    "a pace beyond all": lambda: controlled("pace", 1001.0),
    "an unknown signal": lambda: signal_names(["secret"], ["a.y"]),
    "seven signals": lambda: signal_names(["a.y"] * 7, ["a.y"]),
    "no numbers of plots": lambda: plot_numbers("all"),
    "no parameters": lambda: chosen("all"),
    "an unknown parameter": lambda: chosen({"parameters": {"secret": "1"}}),
    "a parameter that is not a text": lambda: chosen({"parameters": {"force": 3}}),
    "a negative seed": lambda: chosen({"parameters": {}, "seed": -1}),
    "another option": lambda: chosen({"parameters": {}, "out": "/tmp"}),
    "a run that is not over": lambda: run_number(7, [1]),
    "a push of another body": lambda: pushed(body="object"),
    "a push too strong": lambda: pushed(force=[4, 4, 0]),
    "a push too strong for its body": lambda: pushed(STRONG, force=[41, 0, 0]),
    "a push at no point": lambda: pushed(point=[0, 0]),
    "a push far away": lambda: pushed(point=[0, 0, 6]),
    "a push at a huge point": lambda: pushed(point=[0, 0, 1e300]),
    "a push of a text": lambda: push_of("robot", PUSHES),
    "a push where there is none": lambda: push_of(None, ()),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_no_command_or_has_no_right_value_is_refused(case: str, wording: Wording):
    with pytest.raises(InvalidCommand) as refused:
        REFUSED[case]()
    wording.check(refused.value)


def test_commands_control_a_run_and_push_as_strongly_as_a_body_bears():
    control = LiveControl.in_memory(1.0)
    for name, value in (("pace", 0), ("pause", None)):
        control_run(control, parse_command(json.dumps({"command": name, "value": value})))
    assert (control.pace, control.paused) == (math.inf, True)
    controlled("step", control=control)
    assert control.take_step()
    controlled("stop", control=control)
    assert (control.stop, control.paused) == (True, False)
    push = push_of({**PUSH, "force": [40.0, 0, 0]}, STRONG)
    assert push is not None
    assert (push.force, push.point) == ((40.0, 0.0, 0.0), (0.1, 0.0, 0.0))
    assert push_of(None, STRONG) is None
