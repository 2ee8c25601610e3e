"""Makes and frees instances over and over, in a process of its own, and prints how the memory in use grew, as JSON.

`python tests/faults/cycles.py FMU 2|3 bare|run COUNT`. With `run` each instance is initialised, steps, saves its state
and goes back to it.
"""

import argparse
import json
import os
import sys
import tempfile
from pathlib import Path

from support.faults.call_ring import CallRing
from support.faults.foreign_unit import ForeignUnit
from support.faults.subject import Fault, Subject

WARM_UP = 1200
"""Cycles until the allocator has got what it keeps: in Python 3.13 a thousand, after which there is no growth."""


def resident() -> int:
    """Return the bytes of memory that the process has in use."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE")


def cycle(subject: Subject, *, run: bool) -> None:
    """Make an instance, use it, end it."""
    subject.handle, subject.mode = subject.instantiate(), "instantiated"
    if run:
        subject.enter()
        if not subject.exit():
            raise Fault(f"start values are refused: {subject.log}")
        saved = subject.save()
        subject.deserialised(subject.serialised(saved), saved)
        if not subject.step(subject.unit.step):
            raise Fault(f"a step is refused: {subject.log}")
        subject.restore(saved)
    subject.free()


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("fmu", type=Path)
    parser.add_argument("fmi", type=int)
    parser.add_argument("kind", choices=["bare", "run"])
    parser.add_argument("count", type=int)
    a = parser.parse_args()
    unit = ForeignUnit(a.fmu, a.fmi)
    with tempfile.TemporaryDirectory() as folder:
        subject = Subject(unit, CallRing(Path(folder) / "ring"), "x")
        subject.free()
        for _ in range(WARM_UP):
            cycle(subject, run=a.kind == "run")
        begin = resident()
        marks = [begin]
        for i in range(a.count):
            cycle(subject, run=a.kind == "run")
            if i % (a.count // 10) == 0:
                marks.append(resident())
    unit.close()
    print(json.dumps({"grown": resident() - begin, "marks": [m - begin for m in marks]}))
    return 0


if __name__ == "__main__":
    sys.exit(main())
