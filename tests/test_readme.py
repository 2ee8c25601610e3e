"""The README's commands and programs do what it says."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```(\w*)\n(.*?)^```$", README, flags=re.DOTALL | re.MULTILINE)
COMMANDS = [line for kind, text in BLOCKS if not kind for line in text.splitlines() if line.startswith(".venv/")]
PROGRAMS = [text for kind, text in BLOCKS if kind == "python"]


def handover(command: str, folder: Path) -> "subprocess.CompletedProcess[str]":
    arguments = shlex.split(command)[1:]
    call = [sys.executable, "-c", "from scenarios.command import main; main()", *arguments]
    return subprocess.run(call, cwd=folder, capture_output=True, text=True, check=False)


def program(text: str, folder: Path) -> str:
    done = subprocess.run([sys.executable, "-c", text], cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_readme_has_what_is_tested_here():
    assert len([c for c in COMMANDS if " run " in c]) == 4
    assert len([c for c in COMMANDS if " build " in c]) == 1
    assert len(PROGRAMS) == 3


def test_the_make_targets_exist():
    targets = set(re.findall(r"^([\w-]+):", (ROOT / "Makefile").read_text(), flags=re.MULTILINE))
    named = set(re.findall(r"^make ([\w-]+)$", README, flags=re.MULTILINE))
    assert named == {"demo", "test"}
    assert named <= targets


def test_every_path_that_is_linked_exists():
    for path in re.findall(r"\]\((?!http)([^)#]+)\)", README):
        assert (ROOT / path).exists(), path


def test_a_unit_runs_in_fmpy(tmp_path: Path):
    (build,) = (c for c in COMMANDS if " build " in c)
    done = handover(build, tmp_path)
    assert done.returncode == 0, done.stderr
    printed = program(PROGRAMS[0], tmp_path)
    x, y, z = (float(n) for n in printed.strip().strip("[]").split())
    assert (x, y, z) == pytest.approx((0.0, 0.0, -0.7), abs=1e-6)


def test_a_block_of_ones_own_is_built(tmp_path: Path):
    (tmp_path / "spring.py").write_text(PROGRAMS[1])
    printed = program(PROGRAMS[2], tmp_path)
    assert (tmp_path / printed.strip()).is_file()


@pytest.mark.slow
@pytest.mark.parametrize("command", [c for c in COMMANDS if " run " in c])
def test_the_runs_succeed(command: str, tmp_path: Path):
    for build in (c for c in COMMANDS if " build " in c):
        assert handover(build, tmp_path).returncode == 0
    done = handover(command, tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "succeeded" in done.stdout
