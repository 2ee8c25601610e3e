"""Records a ring of 50 units: `python record_memory.py FMU VALUES`; prints how far the peak of resident memory grew.

In MB, from a run that is warm until the master is left and the record complete.
"""

import resource
import sys
import tempfile
from pathlib import Path

from ring_hosts import recorded

UNITS, WARM = 50, 500_000


def peak() -> float:
    """Return the largest resident memory that this process had, in MB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (2**20 if sys.platform == "darwin" else 2**10)


def main(fmu: Path, values: int) -> None:
    """Measure."""
    with tempfile.TemporaryDirectory() as folder:
        with recorded(UNITS, fmu, Path(folder)) as ring:
            ring.advance(WARM // UNITS)
            before = peak()
            ring.advance((values - WARM) // UNITS)
        print(peak() - before)


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]))
