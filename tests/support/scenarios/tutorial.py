"""The tutorial's files, as its text has them, and the command run beside them in a process of its own."""

import re
from pathlib import Path

from support.commands import Ended, run_command
from support.in_process_pool import use_in_process_pool

TUTORIAL = Path(__file__).parents[3] / "docs" / "tutorials" / "own_scenario.md"
SCENE = "reach:TwoLinkReach"
QUIET = ("--no-report", "-p", "patience=0.2")
_FILE = re.compile(r"^%%writefile (?P<name>\w+\.py)\n(?P<code>.*?)^```$", re.MULTILINE | re.DOTALL)
SOFTER = """
from goal_spring import Inputs, Outputs, Params, SpringToGoal


class Softer(SpringToGoal):
    def __init__(self, params: Params) -> None:
        super().__init__(params)

    def outputs(self, t: float, u: Inputs) -> Outputs:
        y = super().outputs(t, u)
        y.tau = 0.5 * y.tau
        return y
"""
"""A controller of which an FMU can be made, after the tutorial's."""


def write_files(folder: Path) -> None:
    """Write arm.py, goal_spring.py, encoders.py and reach.py into a folder, and softer.py beside them."""
    files = {m["name"]: m["code"] for m in _FILE.finditer(TUTORIAL.read_text(encoding="utf-8"))}
    assert set(files) == {"arm.py", "goal_spring.py", "encoders.py", "reach.py"}
    for name, code in {**files, "softer.py": SOFTER}.items():
        (folder / name).write_text(code, encoding="utf-8")


def call(folder: Path, *arguments: str) -> Ended:
    """Call the command in a folder; a campaign's runs are executed by its own process."""
    return run_command(*arguments, cwd=folder, before=use_in_process_pool)


def succeeded(folder: Path, *arguments: str) -> str:
    """Call the command in a folder, assert that it succeeds, and return what it prints."""
    done = call(folder, *arguments)
    assert done.status == 0, done.errors + done.output
    return done.output


def ran(folder: Path, *arguments: str) -> None:
    """Call the command in a folder, and assert that a run ended, whether or not its task succeeded."""
    done = call(folder, *arguments)
    assert done.status in (0, 1), done.errors + done.output


def refused(folder: Path, *arguments: str) -> str:
    """Call the command in a folder, assert that it refuses in one line and writes nothing, and return the line."""
    before = {p.name for p in folder.iterdir()} | {"__pycache__"}
    done = call(folder, *arguments)
    assert done.status == 2, done.errors + done.output
    assert {p.name for p in folder.iterdir()} <= before
    (line,) = [line for line in done.errors.strip().splitlines() if not line.endswith(" ...")]
    assert "Traceback" not in line
    return line


def signals(run: Path) -> bytes:
    """Return the record of a run, which is the same of the same run."""
    return (run / "signals.parquet").read_bytes()
