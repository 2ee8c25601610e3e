"""The command `handover` in a process that prints when its run has passed a time, so that it can be killed there."""

import signal
import subprocess
import sys
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path
from typing import TextIO

PROGRAM = """
import sys
sys.path.insert(0, sys.argv[1])
from killed_run import tell_from
tell_from(float(sys.argv[2]), float(sys.argv[3]))
from handover.scenarios.cli.command import main
main(sys.argv[4:])
"""


def tell_from(passed: float, waits: float) -> None:
    """Let runs of this process print from one simulated time on that they have passed it, and wait at another."""
    import handover.scenarios.cli.run

    @contextmanager
    def telling(stream: TextIO) -> Generator[Callable[[float, float], None], None, None]:
        del stream
        yield tell

    def tell(t: float, _end: float) -> None:
        if t >= passed:
            sys.stdout.write("passed\n")
            sys.stdout.flush()
        if t >= waits:
            sys.stdin.read()

    handover.scenarios.cli.run.progress_bar = telling


def end_between(passed: float, waits: float, number: signal.Signals, *arguments: str | Path) -> int:
    """Call the command and end it somewhere between two simulated times; return the exit status."""
    command = [sys.executable, "-c", PROGRAM, str(Path(__file__).parent), str(passed), str(waits)]
    process = subprocess.Popen(
        [*command, *map(str, arguments)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    with process:
        assert process.stdout is not None
        assert process.stdin is not None
        assert process.stdout.readline() == "passed\n", process.communicate()
        process.send_signal(number)
        process.communicate()
    return process.returncode
