"""A run's summary: of one declaration however the run ended, with figures as JSON can hold them."""

import json
import math
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from support.commands import data_in
from support.kept_runs import kept_run
from support.scenarios.flyer_runs import task_of

from handover.cosim.exceptions import WiringError
from handover.cosim.typed_data import decoded
from handover.scenarios.experiment.experiment import Metric
from handover.scenarios.robots.ir_grasp.ir_grasp import IrGrasp
from handover.scenarios.runs.results.folder_data import RunData, Summary
from handover.scenarios.runs.results.summary import (
    ElapsedTime,
    configuration,
    crashed_summary,
    metric_data,
    peak_memory,
    unstarted_run,
    unstarted_summary,
)
from handover.scenarios.runs.results.tables import format_metric


def assert_of(declared: type[Any], content: Any) -> None:
    """Assert that a file has all that every run has, and nothing that is not declared, or else than declared."""
    assert declared.__required_keys__ <= set(content) <= set(declared.__annotations__)
    assert decoded(json.dumps(content), declared) == json.loads(json.dumps(content))


def test_however_a_run_ends_its_files_are_of_one_declaration(tmp_path: Path):
    task, spent = task_of(IrGrasp, tmp_path / "refused"), ElapsedTime(wall=2.0, cpu=1.0)
    whole = kept_run("run", "ir_grasp", "--no-report")
    finished = data_in(whole)
    refusal = WiringError(["nothing feeds scene.goal"])
    refused = unstarted_summary(task, refusal, spent)
    units = [("scene", "GraspScene (FMI 3)", "15 ms")]
    crashed = crashed_summary(configuration(task), units, "it crashed", {"kind": "crash"}, 0.3, spent)
    assert set(finished) == set(crashed) == set(refused)
    for summary in (finished, crashed, refused):
        assert_of(Summary, summary)
    assert_of(RunData, data_in(whole, "run"))
    assert_of(RunData, unstarted_run(task, refusal))


@pytest.mark.parametrize(
    ("value", "unit", "text"), [(2e3, "Pa", "2 kPa"), (1.0, "rad", "57.3°"), (math.nan, "m", "–"), (math.inf, "m", "–")]
)
def test_a_metric_is_reported_in_the_unit_in_which_pages_show_it(value: float, unit: str, text: str):
    made = metric_data(Metric(value, unit, "a length"))
    assert made == {"value": value if math.isfinite(value) else None, "unit": unit, "description": "a length"}
    assert format_metric(made) == text


def test_without_the_system_telling_memory_there_is_no_figure_of_it(monkeypatch: pytest.MonkeyPatch):
    assert (peak_memory() or 0.0) > 1e6
    monkeypatch.setattr(Path, "is_file", lambda _path: False)  # type: ignore  # as on other systems
    assert (peak_memory() or 0.0) > 1e6
    monkeypatch.setitem(sys.modules, "resource", None)
    assert peak_memory() is None


@pytest.mark.skipif(sys.platform != "linux", reason="other systems tell of the program alone")
def test_a_small_program_that_a_large_one_started_tells_its_own_memory():
    ballast = b"x" * 300_000_000  # Python itself takes some 60 MB, and twice that where it compiles what it imports
    call = "from handover.scenarios.runs.results.summary import peak_memory; print(peak_memory())"
    done = subprocess.run([sys.executable, "-c", call], check=True, capture_output=True, text=True)
    assert 1e7 < float(done.stdout) < len(ballast)
