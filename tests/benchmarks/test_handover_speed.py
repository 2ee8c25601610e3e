"""CPU time of a whole handover of the Helix, and of its control cycles beside what the thesis's program took.

Run with `pytest tests/benchmarks/test_handover_speed.py --benchmark-enable -s`. What a run costs depends on how long
the handover takes, which is printed, too.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np
from pytest_benchmark.fixture import BenchmarkFixture

import handover
from handover.scenarios.experiment.paper import paper_values

RUNS = 4


def test_handover(benchmark: BenchmarkFixture, tmp_path: Path):
    """The first run loads and imports what a process of its own has to, the others do not, as in a campaign."""
    runs: list[Any] = []

    def run() -> None:
        out, units = tmp_path / str(len(runs)), {"arm": "TendonArmFast"}
        done = handover.run("helix_handover", seed=len(runs), units=units, out=out, progress=False)
        assert done.success, done.reason
        runs.append(json.loads((out / "summary.json").read_text()))

    benchmark.pedantic(run, rounds=RUNS)
    totals = [float(r["cpu_seconds"]) for r in runs]
    first, others = totals[0], totals[1:] or totals  # without --benchmark-enable there is one run
    simulated = np.mean([float(r["simulated_seconds"]) for r in runs])
    names = [name for name in runs[0]["metrics"] if name.startswith("cpu_")]
    medians = {
        name.removeprefix("cpu_"): float(np.median([r["metrics"][name]["value"] for r in runs])) for name in names
    }
    cycle, published = medians.pop("per_cycle"), paper_values("helix", "published")["timestep_mean"]
    print(
        f"\nhandover of {simulated:.1f} simulated s: {first:.2f} CPU s, then {np.median(others):.2f} s each, of which "
        f"{', '.join(f'{name} {seconds:.2f}' for name, seconds in medians.items())}\n"
        f"control cycle, vision and servo: {1e3 * cycle:.1f} ms; the thesis's program, on its laptop, "
        f"{min(published):.2f} to {max(published):.2f} s (table 1)"
    )
    benchmark.extra_info.update(first_s=first, next_s=float(np.median(others)), cycle_s=cycle)
