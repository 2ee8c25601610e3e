"""Measures units in processes of their own: `python isolated_units.py FMU ISOLATED STEPS N [WORK]`.

Prints the microseconds of wall time that a unit's step takes in a ring of N units under Jacobi, set and get included;
the best of some repeats.
"""

import json
import sys
import time
from fractions import Fraction
from pathlib import Path
from typing import Any

from handover.cosim.master.master import Master
from handover.cosim.stepping.options import Algorithm, MasterOptions
from handover.cosim.system.system import System

H = Fraction(1, 128)
REPEATS = 5


def measure(fmu: Path, isolated: tuple[str, ...], steps: int, n: int, work: int | None) -> float:
    """Return the wall time of a step of the whole ring, in microseconds."""
    system = System()
    values: dict[str, Any] = {} if work is None else {"work": work}
    units = [system.add(f"u{i}", fmu, period=H, **values) for i in range(n)]
    for i, unit in enumerate(units):
        system.connect(unit.y.y, units[(i + 1) % n].u.u)
    best = float("inf")
    with Master(system, MasterOptions(algorithm=Algorithm.JACOBI, isolated=isolated)) as master:
        for i in range(1, REPEATS + 1):
            began = time.perf_counter()
            master.run(i * steps * H)
            best = min(best, time.perf_counter() - began)
    return best / steps * 1e6


if __name__ == "__main__":
    _, fmu, isolated, steps, n, *work = sys.argv
    names = tuple(isolated.split(",")) if isolated else ()
    print(json.dumps(measure(Path(fmu), names, int(steps), int(n), int(work[0]) if work else None)))
