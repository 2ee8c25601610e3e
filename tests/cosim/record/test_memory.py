import subprocess
import sys
from pathlib import Path

import pytest

PROGRAM = """
from pathlib import Path
import numpy as np
from handover.cosim.record.recorder import Recorder
from handover.scenarios.results.system_facts import peak_memory
from signals_of import signals_of

def record(name, rows):
    x = np.zeros(100)
    signals = signals_of({"x": x})
    noise = np.random.default_rng(1)
    with Recorder(Path(name), ["csv", "mat"]) as recorder:
        for i in range(rows):
            x[:] = noise.random(100)
            recorder(i / 100, signals)
    return peak_memory()

print(record("short.parquet", 40_000), record("long.parquet", 100_000))
"""


@pytest.mark.slow
def test_a_record_of_ten_million_values_takes_no_more_memory_than_one_of_four(tmp_path: Path):
    pytest.importorskip("resource")
    done = subprocess.run(
        [sys.executable, "-c", f"import sys; sys.path.insert(0, {str(Path(__file__).parents[1])!r})\n{PROGRAM}"],
        cwd=tmp_path,
        check=True,
        capture_output=True,
        text=True,
    )
    short, long = (float(n) for n in done.stdout.split())
    assert (tmp_path / "long.parquet").stat().st_size > 70e6
    assert long - short < 20e6
