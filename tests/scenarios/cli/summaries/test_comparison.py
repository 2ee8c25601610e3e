"""What `handover compare` prints: tables that fit a screen."""

import io

import pytest
from rich.console import Console

from handover.scenarios.cli.summaries import comparison


@pytest.mark.parametrize(("rows", "told"), [(25, "and 1 more row, in the report"), (26, "and 2 more rows, in the")])
def test_rows_that_are_left_out_are_counted(rows: int, told: str):
    console = Console(file=io.StringIO(), width=100)
    comparison._print_table(console, ["at"], [[str(k)] for k in range(rows)])  # type: ignore
    assert isinstance(console.file, io.StringIO)
    assert told in console.file.getvalue()
