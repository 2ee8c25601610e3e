"""The table of faults: what `handover run` makes of an SSP in which one unit does one thing wrong.

Each row names the fault and the call, as `units/by_name/faults.c` knows them, and what is right: exit status, what is
told, rows recorded, and what the two sound units beside it note of their end. `python fault_table.py` prints what is.
"""

import os
import signal
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from faulty_units import faulty_fmu
from ssp_of import component, connection, connectors, described, pack_ssp, system

from handover.cosim.record.reader import Record

STOP = 1.0
WHOLE = 11
"""Rows of a run that comes to its end, one each 0.1 s."""

UNTIL_FAULT, UNTIL_OUTPUT = 4, 3
"""Rows of one that ends in a step from 0.3 s on, or in what is set for it; or in outputs that are got at 0.3 s."""

LIMIT = 2.0
"""Seconds for a call."""

PATIENCE = 40.0
"""Seconds for a whole run, after which it counts as one that does not end."""

NOTES = ("a terminated", "a freed", "c terminated", "c freed")
ALL, FREED, NONE = frozenset(NOTES), frozenset({"a freed", "c freed"}), frozenset[str]()

CALLS = {
    "load": ("loading", "loading"),
    "instantiate": ("fmi2Instantiate", "fmi3InstantiateCoSimulation"),
    "setup": ("fmi2SetupExperiment", ""),
    "enter": ("fmi2EnterInitializationMode", "fmi3EnterInitializationMode"),
    "exit": ("fmi2ExitInitializationMode", "fmi3ExitInitializationMode"),
    "set": ("fmi2SetReal", "fmi3SetFloat64"),
    "get": ("fmi2GetReal", "fmi3GetFloat64"),
    "binary": ("", "fmi3GetBinary"),
    "step": ("fmi2DoStep", "fmi3DoStep"),
    "save": ("fmi2GetFMUstate", "fmi3GetFMUState"),
    "terminate": ("fmi2Terminate", "fmi3Terminate"),
    "free": ("fmi2FreeInstance", "fmi3FreeInstance"),
    "unload": ("unloading", "unloading"),
}
"""The calls in which something goes wrong, by the name in a fault's, as FMI 2 and FMI 3 call them."""


@dataclass(frozen=True)
class Fault:
    """A row.

    Attributes:
        fault, call: what goes wrong, and where.
        status: of the command.
        told: what is printed of it, besides the unit's name; `{call}` is the standard's name of the call.
        rows: recorded; None: no folder is left.
        notes: of the sound units.
        fast: whether it is tried in the fast tier, in one of the standards.
        off: what the sound units' outputs may be off, relative to them: rounding is put back at communication points.
    """

    fault: str
    call: str
    status: int
    told: tuple[str, ...] = ()
    rows: int | None = WHOLE
    notes: frozenset[str] = ALL
    fast: bool = False
    off: float = 0.0

    @property
    def name(self) -> str:
        """What the unit's library is named."""
        return f"{self.fault}_in_{self.call}"

    @property
    def standards(self) -> tuple[int, ...]:
        """The standards that have the call."""
        return tuple(fmi for fmi in (2, 3) if CALLS[self.call][fmi - 2])


@dataclass(frozen=True)
class Seen:
    """What a run of a row came to."""

    status: int
    output: str
    rows: int | None
    notes: frozenset[str]
    values: bytes = b""
    """Of the sound units' outputs."""


def run_fault(fault: Fault, fmi: int, folder: Path) -> Seen:
    """Run a system with a faulty unit b between two sound ones, with relative paths, as people type them."""
    sound = faulty_fmu("sound", fmi, folder)
    faulty = faulty_fmu(fault.name, fmi, folder, blob=fault.call == "binary")
    ends = connectors(u="input", y="output")
    parts = [component(n, ends, f"resources/{'faulty' if n == 'b' else 'sound'}.fmu") for n in "abc"]
    joined = connection("a.y", "b.u") + connection("b.y", "c.u")
    ssp = pack_ssp(
        folder / "system.ssp",
        described(system("".join(parts), joined)),
        {"resources/sound.fmu": sound, "resources/faulty.fmu": faulty},
    )
    out, notes = folder / "out", folder / "notes"
    notes.touch()
    saves = ("--repeat-discarded",) if fault.call == "save" else ()
    options = ("--no-report", "--call-limit", str(LIMIT), *saves)
    command = ["-c", "from handover.scenarios.cli.entry import main; main()"]
    process = subprocess.Popen(
        [sys.executable, *command, "run", ssp.name, "--stop", str(STOP), *options, "--out", out.name],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        stdin=subprocess.DEVNULL,
        env={**os.environ, "FAULTS_NOTES": str(notes), "COLUMNS": "300"},
        cwd=folder,
    )
    try:
        printed, _ = process.communicate(timeout=PATIENCE)
    except subprocess.TimeoutExpired:
        running = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
        for pid in (process.pid, *map(int, running)):  # the run that hangs has a process group of its own
            os.kill(pid, signal.SIGKILL)
        printed, _ = process.communicate()
    record = out / "signals.parquet"
    rows, values = None, b""
    if record.is_file():
        read = Record(record)
        rows, values = len(read.time), read["a.y"].tobytes() + read["c.y"].tobytes()
    return Seen(
        process.returncode, printed.decode("utf-8", "replace"), rows, frozenset(notes.read_text().splitlines()), values
    )


@cache
def sound_values(fmi: int) -> bytes:
    """Return the outputs of a and c where b is sound, too."""
    with tempfile.TemporaryDirectory() as folder:
        return run_fault(Fault("nothing", "step", 0), fmi, Path(folder)).values


def _crash(fault: str, call: str, how: str, rows: int | None, **more: Any) -> Fault:
    return Fault(fault, call, 3, ("unit b crashed in {call}", how), rows, more.pop("notes", NONE), **more)


SEGMENT = "segmentation fault"
_ONLY_A = frozenset({"a freed"})
_HANG = "did not return within 2 s"

FAULTS = [
    _crash("crash", "load", SEGMENT, None, fast=True),
    _crash("crash", "instantiate", SEGMENT, None),
    _crash("crash", "setup", SEGMENT, None),
    _crash("crash", "enter", SEGMENT, None),
    _crash("crash", "exit", SEGMENT, None),
    _crash("crash", "set", SEGMENT, UNTIL_FAULT),
    _crash("crash", "get", SEGMENT, UNTIL_OUTPUT),
    _crash("crash", "step", SEGMENT, UNTIL_FAULT, fast=True),
    _crash("crash", "save", SEGMENT, UNTIL_FAULT),
    _crash("crash", "terminate", f"at t = 1 s: {SEGMENT}", WHOLE, notes=frozenset({"c terminated"})),
    _crash("crash", "free", f"at t = 1 s: {SEGMENT}", WHOLE, notes=ALL - {"a freed"}),
    _crash("crash", "unload", SEGMENT, WHOLE, notes=ALL - {"a freed"}),
    _crash("divide", "step", "", UNTIL_FAULT),
    _crash("abort", "load", "aborted", None),
    _crash("abort", "step", "aborted", UNTIL_FAULT),
    _crash("exit", "step", "it ended the process with status 0", UNTIL_FAULT, fast=True),
    _crash("leave", "load", "it ended the process with status 0", None),
    _crash("leave", "step", "it ended the process with status 0", UNTIL_FAULT),
    _crash("overflow", "step", SEGMENT, UNTIL_FAULT),
    _crash("overrun", "step", SEGMENT, UNTIL_FAULT),
    _crash("double_free", "step", "aborted", UNTIL_FAULT),
    Fault("null", "binary", 3, ("b", "{call}"), UNTIL_OUTPUT),
    _crash("garbage", "binary", SEGMENT, UNTIL_OUTPUT),
    Fault("hang", "load", 3, ("b", _HANG), None, NONE),
    Fault("hang", "enter", 3, ("b", "{call}", _HANG), None, FREED),
    Fault("hang", "step", 3, ("b: {call} at t = 0.3 s", _HANG), UNTIL_FAULT, fast=True),
    Fault("hang", "terminate", 3, ("b: {call} at t = 1 s", _HANG)),
    Fault("hang", "free", 3, ("b: {call} at t = 1 s", _HANG)),
    Fault("hang", "unload", 3, ("b", _HANG)),
    Fault("error", "instantiate", 2, (".fmu: b: ", "the solver failed"), None, _ONLY_A),
    Fault("error", "setup", 2, ("b does not start", "the solver failed"), None, FREED),
    Fault("error", "enter", 2, ("b does not start", "the solver failed"), None, FREED, fast=True),
    Fault("error", "exit", 2, ("b does not start", "the solver failed"), None, ALL - {"c terminated"}),
    Fault("error", "set", 3, ("b: {call} at t = 0.3 s", "the solver failed"), UNTIL_FAULT),
    Fault("error", "get", 3, ("b: {call} at t = 0.3 s", "the solver failed"), UNTIL_OUTPUT),
    Fault("error", "step", 3, ("b: {call} at t = 0.3 s", "the solver failed"), UNTIL_FAULT, fast=True),
    Fault("error", "terminate", 3, ("b: {call} at t = 1 s", "the solver failed")),
    Fault("fatal", "enter", 2, ("b does not start", "memory is corrupt"), None, FREED),
    Fault("fatal", "step", 3, ("b: {call} at t = 0.3 s", "memory is corrupt"), UNTIL_FAULT, fast=True),
    Fault("discard", "step", 3, ("b: {call} at t = 0.3 s", "Discard"), UNTIL_FAULT),
    Fault("unknown", "step", 3, ("b: {call} at t = 0.3 s", "77"), UNTIL_FAULT),
    Fault("negative", "step", 3, ("b: {call} at t = 0.3 s", "-2"), UNTIL_FAULT),
    Fault("nan", "get", 3, ("b: {call} at t = 0.3 s", "y = NaN"), UNTIL_OUTPUT, fast=True),
    Fault("infinity", "get", 3, ("b: {call} at t = 0.3 s", "y = infinity"), UNTIL_OUTPUT),
    _crash("exhaust", "step", "", UNTIL_FAULT),
    Fault("flood", "step", 0),
    Fault("log_null", "step", 0, fast=True),
    Fault("log_bytes", "step", 0, fast=True),
    Fault("log_huge", "step", 0),
    Fault("chdir", "load", 0),
    Fault("chdir", "step", 0, fast=True),
    Fault("close_output", "step", 0),
    Fault("close_all", "load", 0),
    Fault("close_all", "step", 0),
    Fault("handlers", "load", 0),
    Fault("handlers", "step", 0),
    Fault("rounding", "load", 0),
    Fault("rounding", "step", 0, off=1e-14),
    Fault("fork", "step", 0, fast=True),
]


def _alike(seen: bytes, sound: bytes, off: float) -> bool:
    """Return whether recorded reals are the same bytes, or as near as is asked for."""
    return seen == sound or (off > 0.0 and np.allclose(np.frombuffer(seen), np.frombuffer(sound), rtol=off, atol=0.0))


def faults_of(fault: Fault, fmi: int, seen: Seen) -> list[str]:
    """Return in what a run was not as its row says."""
    told = [text.format(call=CALLS[fault.call][fmi - 2]) for text in fault.told]
    found = [f"{text!r} is not told" for text in told if text not in seen.output]
    for what, wanted, was in (
        ("status", fault.status, seen.status),
        ("rows", fault.rows, seen.rows),
        ("notes", sorted(fault.notes), sorted(seen.notes)),
    ):
        if wanted != was:
            found.append(f"{what} {was}, not {wanted}")
    if fault.status == 0 and not _alike(seen.values, sound_values(fmi), fault.off):
        found.append("the sound units' outputs are others than without the fault")
    if "Traceback" in seen.output:
        found.append("a traceback is told")
    return found


def main() -> None:
    """Print the table of the faults whose names contain one of the arguments, all without any."""
    words = sys.argv[1:]
    print("| fault | FMI | status | rows | terminated, freed | told |\n|---|---|---|---|---|---|")
    for fault in FAULTS:
        for fmi in fault.standards if not words or any(w in fault.name for w in words) else ():
            with tempfile.TemporaryDirectory() as folder:
                seen = run_fault(fault, fmi, Path(folder))
                wrong = "; ".join(faults_of(fault, fmi, seen))
                lines = [line.replace(folder, "") for line in seen.output.splitlines() if line.strip()]
            told = next((line for line in lines if "b" in line.split(":")[0].split() or "unit b" in line), "")
            ended = f"{sum('term' in n for n in seen.notes)}, {sum('freed' in n for n in seen.notes)}"
            flaw = f" **{wrong}**" if wrong else ""
            line = f"| {fault.name} | {fmi} | {seen.status} | {seen.rows} | {ended} | {told[:150]}{flaw} |"
            print(line, flush=True)
            if wrong:
                print("\n".join(lines[:12])[:2500], file=sys.stderr)


if __name__ == "__main__":
    main()
