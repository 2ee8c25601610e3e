"""Every unit survives thousands of random calls, legal ones and illegal ones, in a process of its own.

A failure names the sequence by its seed and number, and the last calls; `python tests/faults/driver.py` plays it again.
"""

import json
import os
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

import pytest
from support.commands import forking
from support.faults import driver
from support.faults.call_ring import count_of, lines_of

from handover.fmus.build import build_block, cached
from handover.fmus.catalog import UNITS

SEED = 20
FEW = 12
MANY = 2000
SOON = 3.0
HUNG = 60.0
"""Seconds without another call."""
APART = {"FMU_PYTHON_PROCESS": "1"}
"""Has Python run in a process of its own."""

KINDS = ("legal", "illegal")
SAMPLES = ("every_kind:EveryKind", "sampled:Sampled", "tangent:Tangent", "bouncing_ball:BouncingBall")
IN_DEFAULT = [(SAMPLES[0], 2), (SAMPLES[3], 3)]
IN_SLOW = [(SAMPLES[0], 3), (SAMPLES[1], 3), (SAMPLES[2], 2), (SAMPLES[3], 2)]
OTHERS = [(block, fmi) for block in SAMPLES for fmi in (2, 3) if (block, fmi) not in IN_DEFAULT]
LIGHT = ("Push", "HybridKinematics")
ONLY_FMI3 = ("StereoCamera", "HandoverVision")


@dataclass
class Job:
    """A process: one unit, one standard, one kind of sequences."""

    fmu: Path
    fmi: int
    kind: str
    count: int
    ring: Path
    hung: float = HUNG
    environment: Mapping[str, str] = field(default_factory=dict[str, str])
    process: "BaseProcess | None" = field(default=None, init=False)

    def run(self) -> dict[str, Any]:
        """Return what the driver found; a crash or a hang is a fault, too."""
        given = (self.fmu, self.fmi, self.kind, self.count, SEED, self.ring)
        result, errors = (self.ring.with_suffix(suffix) for suffix in (".json", ".txt"))
        self.process = forking().Process(target=_drive, args=(given, self.environment, result, errors))
        self.process.start()
        seen, idle = 0, 0.0
        while self.process.exitcode is None:
            self.process.join(self.hung)
            count = count_of(self.ring) if self.ring.is_file() else 0
            seen, idle = count, idle + self.hung if count == seen else 0.0
            if self.process.exitcode is None and idle >= (self.hung if count else HUNG):
                self.process.kill()  # before the first call Python has much to load
                self.process.join()
                return self._lost(f"no call ended for {idle:g} s")
        if self.process.exitcode or not result.is_file():
            return self._lost(f"the process ended with {self.process.exitcode}: {errors.read_text()[:3000]}")
        return json.loads(result.read_text())

    def _lost(self, fault: str) -> dict[str, Any]:
        calls = lines_of(self.ring) if self.ring.is_file() else []
        sequence = next((c for c in reversed(calls) if c.startswith("---")), "before the first sequence")
        return {"faults": [{"sequence": sequence, "fault": fault, "calls": calls}], "calls": len(calls)}


def _drive(given: "tuple[Any, ...]", environment: Mapping[str, str], result: Path, errors: Path) -> None:
    os.environ.update(environment)
    opened = os.open(errors, os.O_WRONLY | os.O_CREAT, 0o600)
    os.dup2(opened, 2)
    os.close(opened)
    result.write_text(json.dumps(driver.play(*given)))


class WorkerPool:
    """Runs jobs two at a time and ends what is left of them."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.jobs: list[Job] = []

    def add(
        self, fmus: Iterable[tuple[Path, int]], count: int, *, kinds: Sequence[str] = KINDS, apart: bool = False
    ) -> None:
        """Add jobs for kinds of sequences on every FMU, perhaps with Python in a process of its own."""
        for fmu, fmi in fmus:
            for kind in kinds:
                ring = self.folder / f"{len(self.jobs)}.ring"
                self.jobs.append(Job(fmu, fmi, kind, count, ring, environment=APART if apart else {}))

    def run(self) -> None:
        """Run the jobs, print a line for each, and expect no fault."""
        with ThreadPoolExecutor(2) as pool:
            found = list(pool.map(Job.run, self.jobs))
        entries: list[str] = []
        for job, result in zip(self.jobs, found, strict=True):
            apart = " with Python apart" if job.environment else ""
            line = f"{job.fmu.name} {job.kind}{apart}: {job.count} sequences of seed {SEED}, {result['calls']} calls"
            print(f"{line}, {result.get('refused', 0)} refused by the block, {result.get('cpu', 0.0):.1f} s of CPU")
            for fault in result["faults"]:
                calls = "\n    ".join(fault["calls"])
                entries.append(f"{line}; sequence {fault['sequence']}: {fault['fault']}\n    {calls}")
            enough = job.kind == "illegal" or result.get("refused", 0) <= 0.02 * result["calls"]
            if not enough:
                entries.append(f"{line}: {result['refused']} legal calls were refused")
        assert not entries, "\n".join(entries)

    def end(self) -> None:
        """Kill what still runs."""
        for process in (job.process for job in self.jobs if job.process):
            process.kill()
            process.join()


@pytest.fixture
def pool(tmp_path: Path) -> Iterator[WorkerPool]:
    made = WorkerPool(tmp_path)
    yield made
    made.end()


def sample_fmus(folder: Path, samples: "list[tuple[str, int]]") -> list[tuple[Path, int]]:
    return [(build_block(f"support.sample_units.{block}", fmi, folder), fmi) for block, fmi in samples]


def catalog_fmus(names: "tuple[str, ...]") -> list[tuple[Path, int]]:
    return [(cached(n, fmi), fmi) for n in names for fmi in ((3,) if n in ONLY_FMI3 else (2, 3))]


def test_a_few_sequences_on_light_units(pool: WorkerPool, tmp_path: Path):
    pool.add(sample_fmus(tmp_path, IN_DEFAULT), FEW)
    pool.run()


@pytest.mark.slow
def test_a_few_sequences_on_others_and_with_python_apart(pool: WorkerPool, tmp_path: Path):
    push, kinematics = (cached(name, fmi) for name, fmi in zip(LIGHT, (2, 3), strict=True))
    pool.add([*sample_fmus(tmp_path, IN_SLOW), (push, 2), (kinematics, 3)], FEW)
    pool.add([(push, 2)], FEW, apart=True)
    pool.run()


@pytest.mark.slow
def test_a_unit_that_crashes_or_hangs_is_reported_with_its_last_calls(pool: WorkerPool, tmp_path: Path):
    for name in ("Crashing", "Hanging"):
        fmu = build_block(f"support.sample_units.fatal:{name}", 3, tmp_path)
        pool.jobs.append(Job(fmu, 3, "legal", MANY, tmp_path / f"{name}.ring", hung=SOON))
    with pytest.raises(AssertionError) as caught:
        pool.run()
    crash, hang = str(caught.value).split("Hanging.fmi3.fmu", 1)
    assert re.search(r"the process ended with -?\d+: Fatal Python error", crash), crash
    assert f"no call ended for {SOON:g} s" in hang
    for entries in (crash, hang):
        assert re.search(rf"sequence --- legal sequence \d+ of seed {SEED}: ", entries), entries
        assert re.fullmatch(r"x\d \[stepping\] DoStep\(.+", re.findall(r"^ +(x\d .+)$", entries, re.MULTILINE)[-1]), (
            entries
        )
    assert [job.process.is_alive() for job in pool.jobs if job.process] == [False, False]


@pytest.mark.fuzz
def test_many_sequences_on_every_unit(pool: WorkerPool, tmp_path: Path):
    slowest_first = sorted(UNITS, key=lambda n: (n not in ONLY_FMI3, n != "TendonArm"))
    pool.add([*catalog_fmus(tuple(slowest_first)), *sample_fmus(tmp_path, IN_DEFAULT + OTHERS)], MANY)
    pool.add(catalog_fmus(LIGHT[:1]), MANY // 5, apart=True)
    pool.run()
