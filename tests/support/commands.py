"""The command `handover` in processes that start in hundredths of a second, as they are forked from one that is warm.

For tests of exit status, signals and what is printed. What a command prints and returns is the same in this process by
`call`, which is cheaper still; what depends on how Python starts needs a real start.
"""

import atexit
import contextlib
import ctypes
import json
import multiprocessing
import os
import signal
import sys
import tempfile
from collections.abc import Callable, Mapping
from functools import cache
from multiprocessing import forkserver
from multiprocessing.connection import Connection
from multiprocessing.context import ForkServerContext
from pathlib import Path
from typing import Any, NamedTuple

import psutil
from click.testing import CliRunner, Result

from handover.scenarios.cli.command import main

LOADED = (
    "control",
    "handover.cosim.check.load_probe",
    "handover.cosim.check.smoke_run",
    "handover.scenarios.cli.command",
    "handover.scenarios.cli.run",
    "handover.scenarios.runs.reporting.run_page",
    "handover.scenarios.runs.reporting.run_figures",
    "handover.plants.helix.arm.tendon_arm",
    "handover.plants.ir_grasp.scene",
    "handover.controllers.helix.vision.handover_vision",
    "matplotlib.backends.backend_svg",
    "plotly.graph_objects",
    "psutil",
    "pyarrow.parquet",
    "scipy.optimize",
)
"""Modules that most commands need."""


class Ended(NamedTuple):
    """How a command ended: its status, negative for a signal, and what it printed."""

    status: int
    output: str
    errors: str


class Command:
    """Runs `handover ARGUMENTS` in a process of its own.

    Args:
        arguments: of the command.
        cwd: its working directory; this process's by default.
        env: what its environment has besides this process's.
        privileged: false takes from it the right to raise hard limits, which root has.
        before: is called in the process first; a module's function.
    """

    def __init__(
        self,
        *arguments: object,
        cwd: "Path | None" = None,
        env: Mapping[str, str] | None = None,
        privileged: bool = True,
        before: Callable[[], object] | None = None,
    ) -> None:
        self._folder = tempfile.TemporaryDirectory()
        self.output_file, self.errors_file = (Path(self._folder.name) / name for name in ("output", "errors"))
        call = [str(argument) for argument in arguments]
        place, environment = str(cwd or Path.cwd()), {**os.environ, **(env or {})}
        begun, begins = forking().Pipe(duplex=False)
        given = (call, place, environment, str(self.output_file), str(self.errors_file), privileged, begins, before)
        self._process = forking().Process(target=_main, args=given)
        self._process.start()
        begins.close()
        with contextlib.suppress(EOFError):  # where it ended at once; `wait` says how
            begun.recv()  # before that, signals are ignored

    @property
    def pid(self) -> int:
        """Its process."""
        assert self._process.pid is not None
        return self._process.pid

    def send_signal(self, number: signal.Signals) -> None:
        """Send it a signal."""
        os.kill(self.pid, number)

    def poll(self) -> int | None:
        """Return its status, or None as long as it runs."""
        return self._process.exitcode

    def join(self, seconds: float) -> int | None:
        """Wait for its end, for at most some seconds; return its status, or None as long as it runs."""
        self._process.join(seconds)
        return self._process.exitcode

    def wait(self, seconds: float = 300.0) -> Ended:
        """Return how it ends; kill it and fail if that takes longer than some seconds."""
        self._process.join(seconds)
        late = self._process.exitcode is None
        if late:
            self._process.kill()
            self._process.join()
        output, errors = (file.read_text("utf-8", "replace") for file in (self.output_file, self.errors_file))
        self._folder.cleanup()
        assert not late, f"the command had not ended after {seconds:g} s:\n{output}{errors}"
        assert self._process.exitcode is not None
        return Ended(self._process.exitcode, output, errors)


def run_command(
    *arguments: object,
    cwd: "Path | None" = None,
    env: Mapping[str, str] | None = None,
    before: Callable[[], object] | None = None,
) -> Ended:
    """Run `handover ARGUMENTS` to its end in a process of its own."""
    return Command(*arguments, cwd=cwd, env=env, before=before).wait()


def call(*arguments: object) -> Result:
    """Run `handover ARGUMENTS` in this process."""
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


def refusal(*arguments: object) -> str:
    """Return what `handover ARGUMENTS` says, in this process, of a usage error."""
    done = call(*arguments)
    assert (done.exit_code, done.exception.__class__) == (2, SystemExit), (arguments, done.output, done.exception)
    return done.output


def data_in(folder: Path, name: str = "summary") -> Any:
    """Return the content of a JSON file of a run's or campaign's folder."""
    return json.loads((folder / f"{name}.json").read_text(encoding="utf-8"))


def cpu_of_commands() -> float:
    """Return the seconds of CPU of all commands that have ended, and of the process that they are forked from."""
    server = getattr(forkserver, "_forkserver")._forkserver_pid  # noqa: B009
    return sum(psutil.Process(server).cpu_times()[:4]) if server else 0.0


@cache
def forking() -> ForkServerContext:
    """Return what forks processes from the warm one."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(list(LOADED))
    return context


def _main(
    call: list[str],
    place: str,
    environment: Mapping[str, str],
    output: str,
    errors: str,
    privileged: bool,
    begins: Connection,
    before: Callable[[], object] | None,
) -> None:
    """Become the command, as its entry point starts it."""
    if not privileged:
        drop_privilege_of_limits()
    os.environ.clear()
    os.environ.update(environment)
    tempfile.tempdir = None  # this process's environment says which it is
    os.chdir(place)
    for number, name in ((0, os.devnull), (1, output), (2, errors)):
        opened = os.open(name, os.O_RDWR | os.O_CREAT | os.O_TRUNC, 0o600)
        os.dup2(opened, number)
        os.close(opened)
    sys.stdin = open(0, encoding="utf-8", closefd=False)  # noqa: SIM115
    sys.stdout = open(1, "w", encoding="utf-8", closefd=False)  # noqa: SIM115
    sys.stderr = open(2, "w", encoding="utf-8", buffering=1, closefd=False)  # noqa: SIM115
    sys.argv[:] = ["handover", *call]
    from handover.scenarios.cli.entry import main
    from handover.scenarios.runs.execution.supervisor import renew_heartbeat

    renew_heartbeat()  # the one that was made as the module was loaded is shared with all other commands
    if before is not None:
        before()
    signal.signal(signal.SIGINT, signal.default_int_handler)
    begins.send(None)
    begins.close()
    try:
        main()
    finally:
        atexit._run_exitfuncs()  # type: ignore  # which a forked process leaves out
        sys.stdout.flush()


def drop_privilege_of_limits() -> None:
    """Take CAP_SYS_RESOURCE from this process (Linux)."""
    libc, header, sets = ctypes.CDLL(None), (ctypes.c_uint32 * 2)(0x20080522, 0), (ctypes.c_uint32 * 6)()
    assert libc.capget(header, sets) == 0
    for kind in range(3):  # effective, permitted, inheritable
        sets[kind] &= ~(1 << 24)
    assert libc.capset(header, sets) == 0
