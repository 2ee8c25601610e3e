"""Modules that only some commands need are not loaded by the others: help does not wait for plots."""

import json
import subprocess
import sys
from pathlib import Path

import click
import pytest
from click.testing import CliRunner

from handover.scenarios.catalog import SCENARIOS, SYSTEMS
from handover.scenarios.cli.command import COMMANDS, DeferredCommand, DeferringGroup, main

PAGES = {"scipy.stats", "plotly", "networkx", "tsdownsample", "distributed", "handover.scenarios.runs.reporting.page"}
HEAVY = {"matplotlib", "scipy", "cv2", "plotly", "distributed", "dask", "pyarrow", "fmpy", "control", "exudyn"}
HELP = HEAVY | {"numpy", "rich", "pymunk", "handover.cosim.blocks", "handover.cosim.fmu", "handover.fmus"}
OTHER_ROBOTS = {"handover.scenarios.robots.vsl", "handover.scenarios.robots.free_flyer"}
CALLS = (
    (["--version"], HELP),
    (["--help"], HELP),
    (["list", "ir_grasp"], HEAVY | OTHER_ROBOTS),
    (["list"], HEAVY),
    (["list", "helix_handover"], HEAVY),
    (["list", "TendonArm"], HEAVY),
    (["list", "StereoCamera"], HEAVY - {"cv2"}),  # which draws its pictures by it
)
"""Calls, one after another in a process, and what is not loaded then."""
_PROGRAM = """
import json, sys
from handover.scenarios.cli.entry import main

for call in json.loads(sys.argv[1]):
    sys.argv[:] = ["handover", *call]
    try:
        main()
    except SystemExit as e:
        assert not e.code, e.code
    print(json.dumps([*sys.modules]), file=sys.stderr)
"""


def test_what_executes_runs_loads_neither_pages_nor_statistics():
    line = "import sys, handover.scenarios.cli.run, handover.scenarios.cli.sweep; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", line], capture_output=True, text=True, check=True)
    assert not (PAGES | {"matplotlib"}) & set(done.stdout.split())


def test_help_and_lists_load_no_physics_plots_or_records():
    given = json.dumps([call for call, _ in CALLS])
    done = subprocess.run([sys.executable, "-c", _PROGRAM, given], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    for (call, lazy), line in zip(CALLS, done.stderr.splitlines(), strict=True):
        assert not lazy & {*json.loads(line)}, call


@pytest.mark.parametrize("name", [c.name for c in COMMANDS])
def test_a_command_is_in_the_help_as_it_says_itself(name: str):
    context = click.Context(main)
    deferred, loaded = main.get_command(context, name), main.resolve_command(context, [name])[1]
    assert deferred is not None
    assert loaded is not None
    assert deferred is not loaded
    assert loaded.name == name
    for width in (20, 50, 120):
        assert deferred.get_short_help_str(width) == loaded.get_short_help_str(width)


def test_scenarios_and_units_have_the_names_and_titles_by_which_they_are_listed():
    listed = {name: entry.title for system in SYSTEMS for name, entry in system.scenarios.items()}
    assert listed == {experiment.name: experiment.title for experiment in SCENARIOS.values()}
    assert [*SCENARIOS] == [*listed]
    for system in SYSTEMS:
        used = {unit for name in system.scenarios for unit in SCENARIOS[name].units.values()}
        assert set(system.units) - {"AdmittanceController", "TendonArmFast"} == used  # which are for --unit


def test_ctrl_c_while_a_command_loads_aborts_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "interrupted_command.py").write_text("raise KeyboardInterrupt\n")
    monkeypatch.syspath_prepend(tmp_path)
    group = DeferringGroup("main", commands=[DeferredCommand("interrupted", "interrupted_command:command")])
    assert CliRunner().invoke(group, ["interrupted"]).exit_code == 130
