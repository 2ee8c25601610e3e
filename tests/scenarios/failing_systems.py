"""Systems with a native unit that fails, as SSPs, and the command `handover` that runs them in a process of its own."""

import contextlib
import os
import subprocess
import sys
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path

from native_units import native_fmu

from handover.cosim.ssp.writing import write_ssp
from handover.cosim.system.system import System

_MAIN = "from handover.scenarios.cli.entry import main; main()"
IN_TERMINAL = f"import fcntl, termios; fcntl.ioctl(0, termios.TIOCSCTTY, 0); {_MAIN}"
"""The command where standard input is a terminal, which it makes the one that controls it."""


def failing_ssp(folder: Path, bad: str, fmi: int = 3) -> Path:
    """Write a system of a sine, the native unit `bad` that gets it, and an integrator, of 0.1 s steps until 1 s."""
    s = System()
    source, unit = s.add("source", native_fmu("sine", fmi)), s.add("bad", native_fmu(bad, fmi))
    reader = s.add("reader", native_fmu("integrator", fmi))
    s.connect(source.y.y, unit.u.u)
    s.connect(unit.y.y, reader.u.u)
    return write_ssp(s, folder / f"{bad}.ssp", bad, Fraction(1))


def start(folder: Path, *arguments: str | Path, program: str = _MAIN, **streams: int) -> "subprocess.Popen[str]":
    """Start `handover run` in a folder, whose `tmp` is its place for temporary files."""
    (folder / "tmp").mkdir(exist_ok=True)
    environment = {**os.environ, "TMPDIR": str(folder / "tmp")}
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    command = [sys.executable, "-c", program, "run", *map(str, arguments)]
    return subprocess.Popen(command, text=True, cwd=folder, env=environment, **{**pipes, **streams})  # type: ignore


def wait_until(there: Callable[[], bool], going: "subprocess.Popen[str]") -> None:
    """Wait until something is there, for at most a minute and as long as a process goes on."""
    for _ in range(1200):
        if there():
            return
        with contextlib.suppress(subprocess.TimeoutExpired):
            going.wait(0.05)
            break
    assert there(), going.communicate()
