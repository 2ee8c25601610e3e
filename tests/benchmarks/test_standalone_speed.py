"""How long units that bring their interpreter take to start, and a step of theirs beside one in the host's process.

Run with `pytest tests/benchmarks/test_standalone_speed.py --benchmark-enable -s`. The host is a program in C.
"""

from pathlib import Path

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture
from support.fmus.bare_folder import BareFolder, can_be_entered

from handover.fmus.build import build, cached
from handover.fmus.catalog import UNITS

pytestmark = [
    pytest.mark.skipif(not can_be_entered(), reason="only the superuser may enter a folder as the root"),
]

ROUNDS = 5


@pytest.mark.parametrize("name", ["Push", "TendonArm"])
def test_start_and_step(benchmark: BenchmarkFixture, tmp_path: Path, name: str):
    """The unit with its interpreter in a folder that has none, and as it usually is, by turns."""
    entry = UNITS[name]
    root = BareFolder(tmp_path / "root")
    bundled, plain = root.unpack(build(entry, 3, tmp_path, standalone=True)), root.unpack(cached(name, 3))
    first: list[float] = []
    steps: dict[str, list[float]] = {"bundled": [], "plain": []}
    fastest: dict[str, list[float]] = {"bundled": [], "plain": []}

    def measure() -> None:
        inside = root.step(bundled, float(entry.step), 500, inside=True)
        outside = root.step(plain, float(entry.step), 500, inside=False)
        first.append(inside.figure(r"first step after ([\d.]+) s"))
        for kind, stepped in (("bundled", inside), ("plain", outside)):
            steps[kind].append(stepped.figure(r"([\d.]+) us a step"))
            fastest[kind].append(stepped.figure(r"([\d.]+) us the fastest"))

    benchmark.pedantic(measure, rounds=ROUNDS if benchmark.enabled else 1)
    apart, within = (float(np.median(steps[kind])) for kind in ("bundled", "plain"))
    print(
        f"\n{name}: instance and first step take {np.median(first):.2f} s ({np.max(first):.2f} at most), a further one "
        f"{apart:.1f} us, {within:.1f} us in the host's process: {apart - within:.1f} us more; "
        f"of the fastest {min(fastest['bundled']) - min(fastest['plain']):.1f} us more"
    )
    benchmark.extra_info.update(first=float(np.median(first)), apart=apart, within=within)
