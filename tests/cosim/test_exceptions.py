"""Which names an error suggests for an unknown one, and which line of a log it shows."""

import traceback
from pathlib import Path

import pytest

from handover.cosim.exceptions import (
    InvalidOptions,
    InvalidSsp,
    NotExportable,
    WiringError,
    hints,
    last_line,
    nearest,
    one_line,
    suggestion,
    visible,
)


@pytest.mark.parametrize(
    ("name", "valid", "text"),
    [
        ("p[4]", ["p[3]", "p[1]", "p[2]"], "did you mean p[1] or p[2] or p[3]?"),
        ("p[0]", [f"p[{k}]" for k in (9, 7, 5, 3, 1)], "did you mean p[1] or p[3] or p[5]?"),
        ("forse", ["force_2", "force", "torque"], "did you mean force or force_2"),
        ("k", ["tether.f", "tether.k", "k_0"], "did you mean tether.k"),
        ("k", ["b.k", *(f"a.x_{i}" for i in range(200)), "a.k"], "did you mean a.k or b.k?"),
        ("x", ["alpha", "beta"], "valid: alpha, beta"),
        ("x", [], "there are none"),
    ],
)
def test_the_nearest_come_first_and_those_as_near_by_name(name: str, valid: list[str], text: str):
    assert nearest(name, iter(valid)).startswith(text)


def test_a_suggestion_is_empty_where_no_name_is_near():
    assert suggestion("forse", iter(["force", "mass"])) == "did you mean force?"
    assert suggestion("x", ["alpha", "beta"]) == suggestion("x", []) == ""


def test_among_very_many_names_the_nearest_is_found_and_of_long_ones_their_beginning_is_compared():
    names = [f"model.body_{k}.frame[{j}].force" for k in range(200) for j in range(50)]
    assert suggestion("model.body_77.frame[5].forse", names).startswith("did you mean model.body_77.frame[5].force")
    assert suggestion("x" * 10**6, names) == ""


def test_of_a_traceback_all_that_was_raised_is_the_last_line():
    try:
        raise ValueError("the arm is lost\n  (see the manual)\n")
    except ValueError:
        log = ["[Warning] fmi3DoStep: slow", f"[Error] fmi3DoStep: {traceback.format_exc()}"]
    assert last_line(log) == "ValueError: the arm is lost (see the manual)"
    assert last_line([*log, "[Error] fmi3DoStep: given up"]) == "given up"
    assert last_line(["[Error] fmi3DoStep: two\nlines"]) == "lines"


@pytest.mark.parametrize(("file", "place"), [("arm.py", " (arm.py, line 1)"), ("handover/arm.py", "")])
def test_with_the_line_of_the_units_author_that_led_to_it(file: str, place: str):
    with pytest.raises(ZeroDivisionError) as raised:
        exec(compile("1 / 0", f"/tmp/x/resources/sources/{file}", "exec"))
    log = ["[Error] fmi3DoStep: " + "".join(traceback.format_exception(raised.value))]
    assert last_line(log) == f"ZeroDivisionError: division by zero{place}"
    ours = log[0].replace("ZeroDivisionError", "handover.fmus.exchange.OtherReturn")
    assert last_line([ours]) == f"division by zero{place}"


@pytest.mark.parametrize("c", ["\x1b", "\x07", "\x9b", "\x08", "\x7f", "\u202e", "\u2066", "\udc80", "\x00"])
def test_nothing_that_steers_a_terminal_is_shown(c: str):
    assert visible(f"arm{c}[31m\n näher") == "arm\ufffd[31m\n näher"
    assert one_line(ValueError(f"arm{c}]0;x")) == "arm\ufffd]0;x"


def test_spaces_of_all_kinds_are_shown_as_one_and_long_lines_are_cut():
    assert visible("a\tb\r\u00a0c") == "a b  c"
    assert len(visible("A" * 300_000 + "\nlast")) < 4100
    assert visible("A" * 300_000 + "\nlast").endswith("(296000 characters more)\nlast")


def test_a_message_has_the_first_of_very_many_faults_and_an_exception_has_all():
    faults = [f"fault {k}" for k in range(1, 1021)]
    for error in (
        InvalidSsp(Path("a.ssp"), faults),
        NotExportable(faults),
        WiringError(faults),
        InvalidOptions(faults),
    ):
        assert str(error).endswith("and 1,000 more")
        assert "fault 20" in str(error)
        assert "fault 21" not in str(error)
        assert list(error.faults) == faults
    assert str(InvalidOptions(faults[:20])) == "; ".join(faults[:20])


def test_valid_names_are_sought_for_the_first_of_very_many():
    assert [bool(near) for _, near in hints(map(str, range(30)), ["a"])] == 20 * [True] + 10 * [False]
