"""The table of faults: what `handover run` makes of an SSP in which one unit does one thing wrong, in each way to run.

The rows say what is right: exit status, what is reported, rows recorded, and what the two sound units beside it note of
their end.
"""

import tempfile
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from handover.cosim.record.reader import Record
from support.commands import Command
from support.cosim.ssp_of import component, connection, connectors, described, pack_ssp, system
from support.faults.fault_rows import CALLS, LIMIT, Fault
from support.faults.faulty_units import faulty_fmu

STOP = 1.0

PATIENCE = 120.0
"""Seconds for a whole run, after which it counts as one that does not end; much, as the machine may be busy."""


@dataclass(frozen=True)
class Seen:
    """What a run of a row came to."""

    status: int
    output: str
    rows: int | None
    notes: tuple[str, ...]
    """Of the sound units, in their order."""
    values: bytes = b""
    """Of the sound units' outputs."""


def run_fault(fault: Fault, fmi: int, way: str, folder: Path) -> Seen:
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
    limit = LIMIT if fault.fault == "hang" else PATIENCE / 2  # in which the others must not be late, on a busy machine
    options = ("--no-report", "--call-limit", str(limit), *fault.options(way))
    environment = {"FAULTS_NOTES": str(notes), "COLUMNS": "300"}
    arguments = ("run", ssp.name, "--stop", str(STOP), *options, "--out", out.name)
    ended = Command(*arguments, cwd=folder, env=environment).wait(PATIENCE)
    record = out / "signals.parquet"
    rows, values = None, b""
    if record.is_file():
        read = Record(record)
        rows, values = len(read.time), read["a.y"].tobytes() + read["c.y"].tobytes()
    noted = tuple(notes.read_text().splitlines())
    return Seen(ended.status, ended.output + ended.errors, rows, noted, values)


@cache
def sound_values(fmi: int) -> bytes:
    """Return the outputs of a and c where b is sound, too."""
    with tempfile.TemporaryDirectory() as folder:
        return run_fault(Fault("nothing", "step"), fmi, "plan", Path(folder)).values


def _alike(seen: bytes, sound: bytes, off: float) -> bool:
    """Return whether recorded reals are the same bytes, or as near as is asked for."""
    return seen == sound or (off > 0.0 and np.allclose(np.frombuffer(seen), np.frombuffer(sound), rtol=off, atol=0.0))


def faults_of(fault: Fault, fmi: int, way: str, seen: Seen) -> list[str]:
    """Return in what a run was not as its row says."""
    right = fault.right_in(way)
    reported = [text.format(call=CALLS[fault.call][fmi - 2]) for text in right.reported]
    found = [f"{text!r} is not reported" for text in reported if text not in seen.output]
    for what, wanted, was in (
        ("status", right.status, seen.status),
        ("rows", right.rows, seen.rows),
        ("notes", sorted(right.notes), sorted(seen.notes)),
    ):
        if wanted != was:
            found.append(f"{what} {was}, not {wanted}")
    ends = [note.split()[1] for note in seen.notes]
    if ends != sorted(ends, reverse=True):
        found.append(f"units are freed before all are terminated: {', '.join(seen.notes)}")
    if right.status == 0 and not _alike(seen.values, sound_values(fmi), right.off):
        found.append("the sound units' outputs are others than without the fault")
    if "Traceback" in seen.output:
        found.append("a traceback is reported")
    return found
