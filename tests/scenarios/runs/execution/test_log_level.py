"""`--log-level`: units' logs and the master's progress on standard error, with the same results."""

import logging
from pathlib import Path

import pytest
from support.commands import call
from support.cosim.native_units import native_fmu

STEP = "[Warning] line 1 of 1 of the step from t = 0.1 s"
CHOSEN = "debug: talks: [OK] 0 categories are chosen"
STEPPED = "info: units are stepped to t = 0.2 s"


def reported(out: Path, *options: str, fmi: int = 2) -> str:
    """Return what a run of a unit that warns at each step tells on standard error."""
    arguments = ("run", native_fmu("talks", fmi), "--stop", "0.2", "--no-report", "--out", out, *options)
    before = logging.getLogger("handover").handlers[:]
    result = call(*arguments)
    assert result.exit_code == 0, result.output
    assert logging.getLogger("handover").handlers == before
    return result.stderr


@pytest.mark.parametrize(
    ("level", "lines", "unwanted"),
    [
        ("error", [], [STEP, STEPPED]),
        ("warning", [f"warning: talks: {STEP}"], [STEPPED, "categories"]),
        ("info", [f"warning: talks: {STEP}", STEPPED, "info: talks: talks (FMI 2) of "], ["categories"]),
        ("debug", [f"warning: talks: {STEP}", STEPPED, CHOSEN], []),
    ],
)
def test_a_level_tells_of_that_and_what_is_above(tmp_path: Path, level: str, lines: list[str], unwanted: list[str]):
    printed = reported(tmp_path / "r", "--log-level", level)
    assert all(line in printed for line in lines), printed
    assert not any(text in printed for text in unwanted), printed


@pytest.mark.parametrize("fmi", [2, 3])
def test_results_are_the_same_bytes_also_of_isolated_units(tmp_path: Path, fmi: int):
    assert reported(tmp_path / "1", fmi=fmi) == ""  # units that do not fail are silent
    for number, isolate in (("2", ()), ("3", ("--isolate", "all"))):
        assert CHOSEN in reported(tmp_path / number, "--log-level", "debug", *isolate, fmi=fmi)
        record = (tmp_path / number / "signals.parquet").read_bytes()
        assert record == (tmp_path / "1" / "signals.parquet").read_bytes()
