"""A preloaded `handover` process that waits for its arguments on stdin.

So a run begins within some tenths of a second of when it is asked for. The arguments are a line of JSON on its standard
input, which then stays open: that it is closed tells a run that the process which began it has ended.
"""

import contextlib
import importlib
import json
import os
import subprocess
import sys
from collections.abc import Sequence

from handover.cosim.files import scratch_folder
from handover.cosim.python_process import code_command

_LOADED = (
    "handover.scenarios.cli.command",
    "handover.scenarios.cli.run",
    "handover.scenarios.runs.execution.runner",
    "handover.scenarios.live.process",
)
_PROGRAM = (
    "from handover.scenarios.live.waiting_command import wait_for_arguments; wait_for_arguments();"
    " from handover.scenarios.cli.entry import main; main()"
)
_ERRORS = "stderr"
"""File of what such a process writes on standard error, in the folder that is shared with it."""
_PATIENCE = 10.0
"""How long a process may take to end once its standard input is closed, s."""


class WaitingCommand:
    """Such a process, for one call of the command.

    Args:
        scenario: whose units' modules are loaded, where they are this package's.
    """

    def __init__(self, scenario: str) -> None:
        self._scratch = contextlib.ExitStack()
        self.folder = self._scratch.enter_context(scratch_folder("play"))
        """A folder for what this process and that one share."""
        with open(self.folder / _ERRORS, "wb") as errors:
            self.process = subprocess.Popen(
                code_command(_PROGRAM, scenario),
                stdin=subprocess.PIPE,
                stdout=subprocess.DEVNULL,
                stderr=errors,
                start_new_session=True,
            )

    def call(self, arguments: Sequence[str]) -> None:
        """Let it be the command with these arguments; if its process has ended, `has_exited` says so."""
        assert self.process.stdin is not None
        try:
            self.process.stdin.write(json.dumps(list(arguments)).encode() + b"\n")
            self.process.stdin.flush()
        except BrokenPipeError:
            self.process.kill()

    @property
    def has_exited(self) -> bool:
        """Whether its process has ended."""
        return self.process.poll() is not None

    @property
    def last_error(self) -> str:
        """The last line that it wrote on standard error, "" if none."""
        lines = (self.folder / _ERRORS).read_text(encoding="utf-8", errors="replace").strip().splitlines()
        return lines[-1] if lines else ""

    def close(self) -> None:
        """Wait until its process has ended, and remove the folder."""
        assert self.process.stdin is not None
        with contextlib.suppress(BrokenPipeError):
            self.process.stdin.close()
        try:
            self.process.wait(_PATIENCE)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        self._scratch.close()


def _line() -> bytes:
    """Return a line of standard input, of which nothing after it is read."""
    line = b""
    while not line.endswith(b"\n"):
        byte = os.read(0, 1)
        if not byte:
            sys.exit()
        line += byte
    return line


def wait_for_arguments() -> None:
    """Load what a run needs, and wait; then `sys.argv` is the command's."""
    from handover.scenarios.runs.execution.selection import load_units  # of the process that waits alone

    with contextlib.suppress(ImportError):  # nothing needs it; where it is installed, pyarrow imports it in the run
        importlib.import_module("pandas")
    for module in _LOADED:
        importlib.import_module(module)
    load_units(sys.argv[1])
    sys.argv = ["handover", *json.loads(_line())]
