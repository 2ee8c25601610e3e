"""Limits of wall time that are no numbers are usage errors that name the option."""

import math
from typing import Any

import click
import pytest
from click.testing import CliRunner, Result

from handover.scenarios.cli.options import limit_options, limits


def call(*arguments: str) -> tuple[Result, dict[str, Any]]:
    given: dict[str, Any] = {}

    @click.command()
    @limit_options
    def command(call_limit: float, pace: float | None) -> None:
        given.update(limits(call_limit, pace))

    return CliRunner().invoke(command, arguments), given


@pytest.mark.parametrize("number", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize(("option", "range_"), [("--pace", "x>0"), ("--call-limit", "x>=0")])
def test_what_is_not_finite_is_refused_by_the_option_s_name(option: str, range_: str, number: float):
    result, given = call(option, str(number))
    assert result.exit_code == 2
    assert f"Invalid value for '{option}': " in result.output
    assert range_ in result.output
    assert not given


def test_no_limit_is_zero():
    assert call("--call-limit", "0", "--pace", "0.5")[1] == {"call_limit": None, "pace": 0.5}
