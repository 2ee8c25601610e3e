"""What the page of a long run costs: 100,000 rows of 40 columns, beside reading them.

`pytest tests/benchmarks/test_report_speed.py --benchmark-enable -s` prints it.
"""

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv as csv
import pyarrow.parquet as pq
from pytest_benchmark.fixture import BenchmarkFixture

from handover.scenarios.runs.reporting.run_page import write_run_page
from handover.scenarios.runs.results.run_folder import RunFolder

ROWS, COLUMNS = 100_000, 40
TARGET = 5.0
"""Most seconds of CPU."""


def spent(act: Callable[[], object]) -> float:
    began = time.process_time()
    act()
    return time.process_time() - began


def test_the_page_of_a_long_run(benchmark: BenchmarkFixture, tmp_path: Path) -> None:
    """Writing the same record as text, which is what one would look at otherwise, is the measure."""
    random = np.random.default_rng(0)
    t = np.arange(ROWS) * 0.001
    columns = {"time": t, "arm.phase": np.floor(t / 7).astype(np.int64)}
    columns |= {f"arm.x[{k}]": np.sin(t * k) + 0.1 * random.normal(size=ROWS) for k in range(1, COLUMNS)}
    table = pa.Table.from_pydict(columns)
    folder = RunFolder(tmp_path / "run")
    folder.make()
    pq.write_table(table, folder.signals)
    folder.write_run({"scenario": "long", "parameters": {}})
    folder.write_summary({"success": True, "reason": "it ran", "metrics": {}, "simulated_seconds": t[-1].item()})
    costs: dict[str, float] = {}

    def measure() -> None:
        costs["text"] = spent(lambda: csv.write_csv(table, tmp_path / "signals.csv"))
        costs["page"] = spent(lambda: write_run_page(folder))

    benchmark.pedantic(measure)
    size = folder.report.stat().st_size / 1e6
    print(f"\n{ROWS} rows of {COLUMNS} columns, s of CPU: page {costs['page']:.2f} ({size:.1f} MB), ", end="")
    print(f"as text {costs['text']:.2f}")
    benchmark.extra_info.update(costs)
    assert costs["page"] <= 2 * costs["text"]
    if benchmark.enabled:  # else other tests run beside it
        assert costs["page"] <= TARGET
