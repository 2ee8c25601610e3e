"""Records a ring of 50 units: `python record_memory.py FMU VALUES`; prints how far the peak of resident memory grew.

In MB, from a run that is warm until the master is left and the record complete.
"""

import sys
import tempfile
from pathlib import Path

from handover.scenarios.runs.results.summary import peak_memory
from support.benchmarks.ring_hosts import HOSTS

UNITS, WARM = 50, 500_000


def main(fmu: Path, values: int) -> None:
    """Measure."""
    with tempfile.TemporaryDirectory() as folder:
        with HOSTS["recorded"](UNITS, fmu, Path(folder)) as ring:
            ring.advance(WARM // UNITS)
            before = peak_memory() or 0.0
            ring.advance((values - WARM) // UNITS)
        print(((peak_memory() or 0.0) - before) / 2**20)


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]))
