"""Entry point of the command `handover`: standard streams, Ctrl-C from the first instant, and the supervised child."""

import contextlib
import errno
import io
import os
import sys
from typing import TYPE_CHECKING, Any, NoReturn

from handover.cosim.imported_elsewhere import ImportedElsewhere
from handover.cosim.python_process import import_path
from handover.scenarios.runs.execution.exit_status import UNIT_FAILED, abort

if TYPE_CHECKING:
    from handover.cosim.fmu.heartbeat import Heartbeat
    from handover.scenarios.runs.execution.child_process import ChildEnd

_SUPERVISED = ("run", "resume")
"""Commands that load units, which may crash the process that they are in."""


def open_standard_streams() -> None:
    """Open standard streams that are closed, as by a daemon or by `>&-`, to the null device.

    Otherwise the next files that are opened, such as a record, get their numbers, and what a unit prints goes there.
    """
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest free number: this one, as those below are taken
        if getattr(sys, name) is None:
            mode = "w" if number else "r"
            setattr(sys, name, open(number, mode, encoding="utf-8", closefd=False))  # noqa: SIM115


class _Terminal(io.FileIO):
    """A terminal to write to; once it was closed nobody reads, and what is written is dropped, so that a run goes on.

    The system ends a run by SIGHUP then, after its step, with record and report.
    """

    def write(self, data: Any, /) -> int:
        try:
            return super().write(data)
        except OSError as e:
            if e.errno != errno.EIO:
                raise
            return len(data)


def drop_output_to_closed_terminals() -> None:
    """Let what this process prints on a terminal be dropped once that was closed, in place of an error."""
    if sys.platform == "win32":
        return
    for number, name in ((1, "stdout"), (2, "stderr")):
        stream = getattr(sys, name)
        if stream.isatty():
            setattr(sys, name, terminal_stream(number, stream))


def terminal_stream(number: int, like: io.TextIOWrapper) -> io.TextIOWrapper:
    """Return a stream, like another one, that writes to a terminal, open under a number, as long as somebody reads."""
    terminal = io.BufferedWriter(_Terminal(number, "w", closefd=False))
    options: dict[str, Any] = {"line_buffering": True, "write_through": like.write_through}
    return io.TextIOWrapper(terminal, like.encoding, like.errors, **options)


def main() -> None:
    """Run the command; loading it takes a second or so, during which Ctrl-C aborts it as later."""
    sys.path[:] = import_path()
    ImportedElsewhere.install()
    open_standard_streams()
    drop_output_to_closed_terminals()
    try:
        if sys.argv[1:2] and sys.argv[1] in _SUPERVISED:
            from handover.scenarios.runs.execution.supervisor import can_supervise, run_to_end, supervise

            if can_supervise():
                supervise(_command, _report_crash)
            run_to_end(_command)
        _command()
    except KeyboardInterrupt:
        abort()


def _command() -> None:
    try:
        from handover.scenarios.cli.command import main as command
    except KeyboardInterrupt:
        abort()
    try:
        try:
            command()
        finally:
            with contextlib.suppress(BrokenPipeError):
                sys.stdout.flush()
    except OSError as e:
        if e.errno not in (errno.ENOSPC, errno.EDQUOT) or e.filename is not None:
            raise
        _end_unprinted(e)


def _end_unprinted(e: OSError) -> NoReturn:
    """End a command whose output has no room where it goes, as on a full disk; what is left of it goes nowhere."""
    with open(os.devnull, "w", encoding="utf-8") as nowhere:
        os.dup2(nowhere.fileno(), 1)
    print(f"Error: standard output cannot be written: {e.strerror}", file=sys.stderr)
    sys.exit(UNIT_FAILED)


def _report_crash(heartbeat: "Heartbeat", end: "ChildEnd", wall: float) -> int:
    from handover.scenarios.cli.summaries.run import report_crash  # only a run that crashed loads it

    return report_crash(heartbeat, end, wall)
