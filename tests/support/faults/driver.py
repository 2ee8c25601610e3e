"""Makes random sequences of legal and of illegal calls to a unit, in a process of its own.

`python tests/faults/driver.py FMU 2|3 legal|illegal COUNT SEED RING [FIRST]` prints what it found as a line of JSON and
ends with 0 if that is nothing. RING is a file that holds the last calls if the process does not get so far. A sequence
is known by the seed and its number; FIRST begins with another number than 0.
"""

import argparse
import faulthandler
import json
import random
import sys
import time
from pathlib import Path
from typing import Any

from support.faults.call_ring import CallRing
from support.faults.foreign_unit import ForeignUnit
from support.faults.illegal.calls import IllegalCalls
from support.faults.legal_calls import Effort, LegalCalls, performance
from support.faults.subject import Fault, Saved, Subject

INSTANCES = 3
MAX_FAULTS = 5
EFFORTS = {
    "StereoCamera": Effort(from_scratch=0.03, steps=1, bytes=0.1),
    "HandoverVision": Effort(from_scratch=0.1, steps=1, bytes=0.1),
    "TendonArm": Effort(from_scratch=0.2, steps=3),
    "TendonArmFast": Effort(from_scratch=0.5),
    "AdmittanceController": Effort(from_scratch=0.12),
    "ArmImpedanceController": Effort(from_scratch=0.2),
    "ImpedanceController": Effort(from_scratch=0.08),
    "PoseController": Effort(from_scratch=0.12),
    "GraspScene": Effort(from_scratch=0.2),
    "TrajectoryPlanner": Effort(from_scratch=0.2),
}
"""Of the units that are slow to make or to step."""


class Driver:
    """Drives a few instances of one unit."""

    def __init__(self, unit: ForeignUnit, ring: CallRing, seed: int) -> None:
        self.unit, self.ring, self.seed = unit, ring, seed
        self.effort = EFFORTS.get(unit.name, Effort())
        self.subjects: list[Subject] = []
        self.ready: dict[str, Saved] = {}
        self.shown: list[object] = []
        self.made = self.refused = self.calls = 0
        while len(self.subjects) < INSTANCES:
            self._add()

    def legal(self, k: int) -> None:
        """Make legal sequence k: its calls go to one instance or two, turn by turn."""
        rng = random.Random(f"{self.seed} legal {k}")
        if rng.random() < 0.02 * self.effort.from_scratch:
            self._remove(rng.choice(self.subjects))
            self._add()
        chosen = rng.sample(self.subjects, rng.choice([1, 1, 2]))
        walks = [LegalCalls(s, self.ready[s.name], rng, self.effort) for s in chosen]
        for walk in walks:
            walk.begin()
        for _ in range(rng.randint(5, 12)):
            rng.choice(walks).one()
        if rng.random() < 0.1 * self.effort.from_scratch:
            chosen[0].reset()
            if performance(chosen[0], self.unit) != self.shown:
                raise Fault("a reset instance does not do what a new one does")

    def illegal(self, k: int) -> None:
        """Make illegal sequence k."""
        rng = random.Random(f"{self.seed} illegal {k}")
        subject, other = rng.sample(self.subjects, 2)
        IllegalCalls(subject, self.ready[other.name], self.ready[subject.name], rng, self.effort).run()

    def replace_all(self) -> None:
        """Begin with other instances, after a fault."""
        for subject in list(self.subjects):
            self._remove(subject)
        while len(self.subjects) < INSTANCES:
            self._add()

    def _add(self) -> None:
        name = f"x{self.made}"
        event_mode = self.unit.fmi == 3 and self.unit.has_event_mode and self.made % 3 != 0
        early_return = event_mode and self.made % 3 == 2
        subject = Subject(self.unit, self.ring, name, event_mode=event_mode, early_return=early_return)
        self.made += 1
        if not self.shown:
            self.shown = performance(subject, self.unit)
            subject.reset()
        subject.enter()
        if not subject.exit():
            raise Fault(f"start values are refused: {subject.log[-1:]}")
        self.ready[name] = subject.save()
        subject.reset()
        self.subjects.append(subject)

    def _remove(self, subject: Subject) -> None:
        self.refused += subject.refused
        self.calls += subject.answered
        self.subjects.remove(subject)
        del self.ready[subject.name]
        subject.free()

    def close(self) -> None:
        """End all instances."""
        for subject in list(self.subjects):
            self._remove(subject)


def play(fmu: Path, fmi: int, kind: str, count: int, seed: int, ring_file: Path, first: int = 0) -> dict[str, Any]:
    """Make sequences; return the faults, how many calls were made and how many of them refused, and seconds of CPU."""
    faulthandler.enable()
    ring = CallRing(ring_file)
    unit = ForeignUnit(fmu, fmi)
    driver = Driver(unit, ring, seed)
    sequence = driver.legal if kind == "legal" else driver.illegal
    faults: list[dict[str, object]] = []
    begin = time.process_time()
    for k in range(first, first + count):
        ring.note(f"--- {kind} sequence {k} of seed {seed}")
        try:
            sequence(k)
        except Fault as fault:
            faults.append({"sequence": k, "fault": str(fault), "calls": ring.lines()})
            if len(faults) == MAX_FAULTS:
                break
            driver.replace_all()
    driver.close()
    unit.close()
    spent = time.process_time() - begin
    return {"faults": faults, "calls": driver.calls, "refused": driver.refused, "cpu": spent}


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("fmu", type=Path)
    parser.add_argument("fmi", type=int)
    parser.add_argument("kind", choices=["legal", "illegal"])
    parser.add_argument("count", type=int)
    parser.add_argument("seed", type=int)
    parser.add_argument("ring", type=Path)
    parser.add_argument("first", type=int, nargs="?", default=0)
    a = parser.parse_args()
    found = play(a.fmu, a.fmi, a.kind, a.count, a.seed, a.ring, a.first)
    print(json.dumps(found))
    return bool(found["faults"])


if __name__ == "__main__":
    sys.exit(main())
