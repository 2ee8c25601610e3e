"""Runs a part of a check in an isolated process, which may crash or hang, and reads its journal.

The process writes a line of JSON for each call that begins and for each finding (`Journal`); from that and from how the
process ended, its parent makes a `ProcessReport`.
"""

import contextlib
import json
import os
import signal
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from handover.cosim.probe.finding import Finding, Level, fault, warning
from handover.cosim.python_process import code_command

_START = "import importlib, json; importlib.import_module(sys.argv[1]).main(json.loads(sys.argv[2]))"
_MAX_LINES = 8
_MEANINGS = {
    "SIGSEGV": "it used memory that is not its own",
    "SIGBUS": "it used memory that is not there",
    "SIGABRT": "it gave up: abort(), a failed assertion or a C++ exception that nothing caught",
    "SIGILL": "it has an instruction that this processor does not know",
    "SIGFPE": "it divided an integer by zero",
    "SIGKILL": "the system ended it, perhaps for want of memory",
}
_WINDOWS = {0xC0000005: "SIGSEGV", 0xC000001D: "SIGILL", 0xC0000094: "SIGFPE", 0xC0000409: "SIGABRT"}


@dataclass
class ProcessReport:
    """What an isolated process reported, and how it ended.

    Attributes:
        findings: what it found, and how it ended if it crashed, hung or failed.
        facts: other results, by name.
        finished: whether it ran to its end.
    """

    findings: list[Finding] = field(default_factory=list[Finding])
    facts: dict[str, Any] = field(default_factory=dict[str, Any])
    finished: bool = False


def run_isolated(module: str, task: Mapping[str, Any], folder: Path, timeout: float) -> ProcessReport:
    """Run a module's `main` with a task in a process of its own, for at most `timeout` seconds; `folder` is scratch."""
    name = module.rpartition(".")[2]
    journal, output = folder / f"{name}.jsonl", folder / f"{name}.txt"
    journal.touch()
    whole = {**task, "journal": str(journal)}
    with output.open("wb") as written:
        process = subprocess.Popen(
            code_command(_START, module, json.dumps(whole)),
            stdin=subprocess.DEVNULL,
            stdout=written,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
        try:
            code = process.wait(timeout)
        except subprocess.TimeoutExpired:
            code = None
        finally:
            _end(process)
    return _report(journal, output, code, timeout)


def _end(process: "subprocess.Popen[bytes]") -> None:
    """End the process and what it started, if any of it is left."""
    if hasattr(os, "killpg"):
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(process.pid, signal.SIGKILL)
    process.kill()
    process.wait()


def _report(journal: Path, output: Path, code: int | None, timeout: float) -> ProcessReport:
    report = ProcessReport()
    call, t = "the process's start", None
    logged: list[str] = []
    for line in journal.read_text(encoding="utf-8").splitlines():
        try:
            data: dict[str, Any] = json.loads(line)
        except ValueError:  # cut off where the process was ended
            continue
        if "call" in data:
            call, t = str(data["call"]), data["t"]
        elif "log of the unit" in data:
            logged = [*logged, *str(data["log of the unit"]).splitlines()][-_MAX_LINES:]
        elif "facts" in data:
            report.facts.update(data["facts"])
        elif "end" in data:
            report.finished = True
        else:
            report.findings.append(_finding(data))
    at = call if t is None else f"{call} at t = {t:.6g} s"
    if code is None:
        cure = "if it only needs longer: --timeout"
        report.findings.append(
            fault(f"{at} was not done after {timeout:g} s", cure=cure, log=(*logged, *_last_lines(output)))
        )
    elif not report.finished:
        report.findings.append(_end_of_process(at, code, (*logged, *_last_lines(output))))
    elif code != 0:
        report.findings.append(warning(f"{_how(code)} at the end of its process", cure="after everything was freed"))
    return report


def _finding(data: Mapping[str, Any]) -> Finding:
    level, log = Level(data["level"]), tuple(data["log"])
    return Finding(level=level, what=data["what"], where=data["where"], cure=data["cure"], log=log)


def _end_of_process(at: str, code: int, lines: tuple[str, ...]) -> Finding:
    if code == 1 and any(line.startswith("Traceback ") for line in lines):
        return fault(f"the check itself failed in {at}; this is not the FMU's fault", log=lines)
    how = _how(code)
    meaning = _MEANINGS.get(how.removeprefix("crashed with "), "a unit must not end its host's process")
    return fault(f"{how} in {at}: {meaning}", log=lines)


def _how(code: int) -> str:
    """Return how a process ended, by its status: with a signal's name where it was one."""
    if code < 0:
        with contextlib.suppress(ValueError):
            return f"crashed with {signal.Signals(-code).name}"
        return f"crashed with signal {-code}"
    windows = _WINDOWS.get(code & 0xFFFFFFFF)
    return f"crashed with {windows}" if windows else f"ended its process with status {code}"


def _last_lines(output: Path) -> tuple[str, ...]:
    """Return the last lines that the process wrote."""
    with output.open("rb") as file:
        file.seek(0, os.SEEK_END)
        file.seek(max(0, file.tell() - 8192))
        lines = file.read().decode("utf-8", "replace").splitlines()
    kept = [line.rstrip() for line in lines if line.strip()]
    return tuple(line[:300] for line in kept[-_MAX_LINES:])


_MAX_MESSAGE_LENGTH = 2000


class Journal:
    """Writes a line before each call begins and flushes it, so that a crash loses none."""

    def __init__(self, file: Path) -> None:
        self._room = 1_000_000  # characters
        self._file = file.open("a", encoding="utf-8")

    def begins(self, call: str, t: float | None = None) -> None:
        """Note that a call begins, at a simulated time or before there is one."""
        self._write({"call": call, "t": t})

    def found(self, finding: Finding) -> None:
        """Note a finding."""
        self._write({"level": finding.level, "what": finding.what, "where": finding.where, "cure": finding.cure,
                     "log": finding.log})  # fmt: skip

    def logs(self, message: str) -> None:
        """Note what the unit logged; of a unit that logs without end, the beginning."""
        if self._room > 0:
            self._room -= len(message)
            self._write({"log of the unit": message[:_MAX_MESSAGE_LENGTH]})

    def record(self, **facts: Any) -> None:
        """Note facts by name."""
        self._write({"facts": facts})

    def ends(self) -> None:
        """Note that everything was run."""
        self._write({"end": True})

    def _write(self, line: dict[str, Any]) -> None:
        self._file.write(json.dumps(line) + "\n")
        self._file.flush()
