"""A disk that is full at one of the files of a run: reported in one line, with status 3, and no file is incomplete."""

import errno
import os
from pathlib import Path
from typing import Any

import pytest
from support.commands import call
from support.failing_systems import failing_ssp

from handover.cosim.record.reader import Record

FILES = ["run.json", "signals.csv", "summary.json", "report.html"]


@pytest.mark.usefixtures("empty_figures")
@pytest.mark.parametrize("full", FILES)
def test_a_full_disk_is_reported_and_the_record_is_kept(full: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    replace = os.replace

    def refuse(source: Any, target: Any) -> None:
        if Path(target).name == full:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(source), str(target))
        replace(source, target)

    file, out = failing_ssp(tmp_path, "gain"), tmp_path / "out"
    monkeypatch.setattr(os, "replace", refuse)
    more = () if full == "report.html" else ("--no-report",)
    result = call("run", file, "--format", "csv", "--out", out, *more)
    text = out / ("signals.parquet" if full == "signals.csv" else full)
    assert result.exit_code == 3
    assert result.output.splitlines()[-1] == f"Error: {text} cannot be written: No space left on device"
    there = {p.name for p in out.iterdir()}
    assert full not in there
    assert not any(name.endswith(".part") for name in there)
    if full != "run.json":
        assert Record(out / "signals.parquet").time[-1] == 1.0
