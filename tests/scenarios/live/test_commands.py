"""What a live page may ask for, and which texts are none of it."""

import json
import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest
from support.wording import Wording

from handover.cosim.master.live_control import LiveControl
from handover.scenarios.free_flyer.robot_wiring import PUSHES
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


def chosen(value: Any) -> object:
    return choice_of(value, ["force"], seeded=True)


def pushed(value: Any) -> object:
    return push_of(value, PUSHES)


def choosing(value: Any) -> object:
    return signal_names(value, ["a.y"])


def of_first_run(value: Any) -> object:
    return run_number(value, [1])


def pushing_nothing(value: Any) -> object:
    return push_of(value, ())


def controlled(name: str) -> Callable[[Any], object]:
    return lambda value: control_run(LiveControl.in_memory(1.0), Command(name, value))


@pytest.mark.parametrize(
    "text",
    [
        pytest.param("{", id="cut off"),
        pytest.param("[]", id="a list"),
        pytest.param("{}", id="nothing"),
        pytest.param('{"command": "pace", "value": NaN}', id="no number of JSON"),
        pytest.param('{"command": "pause", "more": 1}', id="another member"),
        pytest.param(" " * (LONGEST + 1), id="too long"),
    ],
)
def test_what_is_no_command_is_refused(text: str, wording: Wording):
    with pytest.raises(InvalidCommand) as refused:
        parse_command(text)
    wording.check(refused.value)


@pytest.mark.parametrize(
    ("taken_by", "value"),
    [
        pytest.param(controlled("pace"), -1, id="a pace backwards"),
        pytest.param(controlled("pace"), 1001.0, id="a pace beyond all"),
        pytest.param(choosing, ["secret"], id="an unknown signal"),
        pytest.param(choosing, ["a.y"] * 7, id="seven signals"),
        pytest.param(plot_numbers, "all", id="no numbers of plots"),
        pytest.param(chosen, "all", id="no parameters"),
        pytest.param(chosen, {"parameters": {"secret": "1"}}, id="an unknown parameter"),
        pytest.param(chosen, {"parameters": {"force": 3}}, id="a parameter that is no text"),
        pytest.param(chosen, {"parameters": {}, "seed": -1}, id="a negative seed"),
        pytest.param(chosen, {"parameters": {}, "out": "/tmp"}, id="another option"),
        pytest.param(of_first_run, 7, id="a run that is not over"),
        pytest.param(pushed, {"body": "object", "point": [0, 0, 0], "force": [1, 0, 0]}, id="a push of another body"),
        pytest.param(pushed, {"body": "robot", "point": [0, 0, 0], "force": [4, 4, 0]}, id="a push too strong"),
        pytest.param(pushed, {"body": "robot", "point": [0, 0], "force": [1, 0, 0]}, id="a push at no point"),
        pytest.param(pushed, {"body": "robot", "point": [0, 0, 6], "force": [1, 0, 0]}, id="a push far away"),
        pytest.param(
            pushed, {"body": "robot", "point": [0, 0, 1e300], "force": [1, 0, 0]}, id="a push at a huge point"
        ),
        pytest.param(pushed, "robot", id="a push of a text"),
        pytest.param(pushing_nothing, None, id="a push where there is none"),
    ],
)
def test_a_value_that_is_not_right_is_refused(taken_by: Callable[[Any], object], value: Any, wording: Wording):
    with pytest.raises(InvalidCommand) as refused:
        taken_by(value)
    wording.check(refused.value)


def test_commands_control_a_run():
    control = LiveControl.in_memory(1.0)
    for name, value in (("pace", 0), ("pause", None)):
        control_run(control, parse_command(json.dumps({"command": name, "value": value})))
    assert (control.pace, control.paused) == (math.inf, True)
    control_run(control, Command("step", None))
    assert control.take_step()
    control_run(control, Command("stop", None))
    assert (control.stop, control.paused) == (True, False)


def test_a_push_is_as_strong_as_its_body_bears():
    strong = [replace(push, greatest=40.0) for push in PUSHES]
    asked = {"body": "robot", "force": [30.0, 0, 0], "point": [0.1, 0, 0]}
    push = push_of(asked, strong)
    assert push is not None
    assert (push.force, push.point) == ((30.0, 0.0, 0.0), (0.1, 0.0, 0.0))
    with pytest.raises(InvalidCommand, match="40 N"):
        push_of({**asked, "force": [41.0, 0, 0]}, strong)
    assert push_of(None, strong) is None
