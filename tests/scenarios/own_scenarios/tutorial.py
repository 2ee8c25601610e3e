"""The tutorial's files, as its text has them, and the command run beside them in a process of its own."""

import re
import subprocess
import sys
from pathlib import Path

TUTORIAL = Path(__file__).parents[3] / "docs" / "tutorial.md"
_FILE = re.compile(r"^##+ [^\n]*`(?P<name>\w+\.py)`\n.*?^```python\n(?P<code>.*?)^```$", re.MULTILINE | re.DOTALL)
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
COMMAND = [sys.executable, "-c", "from handover.scenarios.cli.entry import main; main()"]


def write_files(folder: Path) -> None:
    """Write arm.py, goal_spring.py, encoders.py and reach.py into a folder."""
    files = {m["name"]: m["code"] for m in _FILE.finditer(TUTORIAL.read_text(encoding="utf-8"))}
    assert set(files) == {"arm.py", "goal_spring.py", "encoders.py", "reach.py"}
    for name, code in files.items():
        (folder / name).write_text(code, encoding="utf-8")


def call(folder: Path, *arguments: str, limit: float = 300.0) -> subprocess.CompletedProcess[str]:
    """Call the command in a folder, for so many seconds at most."""
    return subprocess.run([*COMMAND, *arguments], cwd=folder, capture_output=True, text=True, timeout=limit)


def succeeded(folder: Path, *arguments: str, limit: float = 300.0) -> str:
    """Call the command in a folder, assert that it succeeds, and return what it prints."""
    done = call(folder, *arguments, limit=limit)
    assert done.returncode == 0, done.stderr + done.stdout
    return done.stdout


def ran(folder: Path, *arguments: str) -> None:
    """Call the command in a folder, and assert that a run ended, whether or not its task succeeded."""
    done = call(folder, *arguments)
    assert done.returncode in (0, 1), done.stderr + done.stdout


def refused(folder: Path, *arguments: str) -> str:
    """Call the command in a folder, assert that it refuses in one line and writes nothing, and return the line."""
    before = {p.name for p in folder.iterdir()} | {"__pycache__"}
    done = call(folder, *arguments)
    assert done.returncode == 2, done.stderr + done.stdout
    assert {p.name for p in folder.iterdir()} <= before
    (line,) = [line for line in done.stderr.strip().splitlines() if not line.endswith(" ...")]
    assert "Traceback" not in line
    return line
