"""A short run of one unit through the calls that a master makes, in an isolated process (`isolated_process`).

The run covers instantiation, steps, state, a second instance, reset and termination; `main` is the process's entry.
"""

import math
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from handover.cosim.blocks.variable import Kind
from handover.cosim.exceptions import InvalidFmu, UnitFailure
from handover.cosim.fmu.file.archive import DESCRIPTION
from handover.cosim.fmu.file.description import FmuDescription, FmuPort, describe_fmu
from handover.cosim.fmu.file.internal_variables import LOCAL, ports_inside
from handover.cosim.fmu.file.large_description import LARGE
from handover.cosim.fmu.file.xml import parse_xml
from handover.cosim.probe.finding import Finding, abbreviated, fault, note, warning
from handover.cosim.probe.isolated_process import Journal
from handover.cosim.probe.probed_instance import ProbedInstance, failure, log_tail, probed

STEPS = 10
_REPEATED = 5  # steps that are done again from a state
_TOO_MUCH = 1e-3  # of a signal's largest value: what outputs from a restored state may be off by, with a warning
_MAX_RESTARTS = 60  # to find the variables that cannot be read


@dataclass
class SmokeRun:
    """Instantiate, initialise, steps, state, a second instance, reset, terminate, free.

    Attributes:
        description: what the FMU says of itself.
        folder: where it is unpacked.
        journal: where calls and findings are noted.
        start: time of the start, in seconds.
        step: communication step, in seconds.
        keeps_state: whether it says that its state can be kept and restored.
        serialises: whether it says that its state can be made bytes.
        allows_two: whether it allows two instances in a process.
        internal: its local variables and calculated parameters, which any host may read.
    """

    description: FmuDescription
    folder: Path
    journal: Journal
    start: float
    step: float
    keeps_state: bool
    serialises: bool
    allows_two: bool
    internal: Sequence[FmuPort] = ()
    _reported: set[str] = field(default_factory=set[str])

    def run_all(self) -> None:
        """Run everything until a call fails; findings go to the journal."""
        try:
            unit = self._instance("unit")
        except InvalidFmu as e:
            self.journal.found(fault(e.fault, where="instantiation", log=log_tail(e.log)))
            return
        try:
            self._run(unit)
        except UnitFailure as e:
            self.journal.found(failure(e))
        except InvalidFmu as e:
            what = f"a second instance beside the first: {e.fault}"
            self.journal.found(fault(what, where="instantiation", log=log_tail(e.log)))
        finally:
            unit.free()

    def _run(self, unit: ProbedInstance) -> None:
        unit.start(self.start)
        at_start = unit.seen()
        self._check_values(unit)
        for _ in range(STEPS - _REPEATED):
            unit.advance(self.step)
            self._check_values(unit)
        steps = self._steps_from_a_state(unit) if self.keeps_state else self._steps(unit)
        self.journal.record(steps=STEPS, step=self.step)
        if self.allows_two:
            self._beside(unit, at_start, steps)
        unit.reset()
        unit.start(self.start)
        self._compare(
            at_start,
            unit.seen(),
            f"fmi{self.description.fmi}Reset",
            "a reset unit starts with other outputs than a new one",
        )
        unit.advance(self.step)
        unit.end()
        self.journal.record(ended=True)
        self._check_internal(unit)

    def _instance(self, name: str) -> ProbedInstance:
        return probed(name, self.description, self.folder, self.journal)

    def _steps(self, unit: ProbedInstance) -> list[dict[str, bytes]]:
        seen: list[dict[str, bytes]] = []
        for _ in range(_REPEATED):
            unit.advance(self.step)
            self._check_values(unit)
            seen.append(unit.seen())
        return seen

    def _steps_from_a_state(self, unit: ProbedInstance) -> list[dict[str, bytes]]:
        """Take steps, roll back and repeat them, with the state as it was kept and as bytes."""
        t, before = unit.time, unit.seen()
        state = unit.keep_state()
        seen = self._steps(unit)
        two = self.description.fmi == 2
        same = self._again(unit, state, t, [before, *seen], f"fmi{'2SetFMUstate' if two else '3SetFMUState'}")
        if self.serialises and same:
            made = unit.deserialised(unit.serialised(state))
            call = "fmi2DeSerializeFMUstate" if two else "fmi3DeserializeFMUState"
            self._again(unit, made, t, [before, *seen], call)
            unit.drop_state(made)
        unit.drop_state(state)
        return seen

    def _again(self, unit: ProbedInstance, state: Any, t: float, expected: list[dict[str, bytes]], call: str) -> bool:
        """Roll back, repeat the steps, and return whether the outputs are the same; report by how much they differ."""
        unit.restore(state, t)
        repeated = [unit.seen(), *self._steps(unit)]
        shares = {
            name: share
            for name, port in self.description.outputs.items()
            if name in expected[0]
            and (share := _difference(port, [e[name] for e in expected], [r[name] for r in repeated]))
        }
        if not shares:
            return True
        level = fault if max(shares.values()) >= _TOO_MUCH else warning
        what = f"steps from a restored state (t = {t:.6g} s) give other outputs than the first time"
        sizes = {n: "" if math.isinf(share) else f" by {share:.2g} of its largest value" for n, share in shares.items()}
        differing = [name + size for name, size in sizes.items()]
        self.journal.found(
            level(f"{what}: {abbreviated(differing)}", where=call, cure="the state must hold all that changes")
        )
        return False

    def _beside(self, unit: ProbedInstance, at_start: dict[str, bytes], steps: list[dict[str, bytes]]) -> None:
        """Run a second instance beside the first: it does the same, and the first does not notice."""
        before = unit.seen()
        second = self._instance("second")
        try:
            second.start(self.start)
            text = "a second instance"
            if not self._compare(at_start, second.seen(), text, "it starts with other outputs than the first"):
                for _ in range(STEPS - _REPEATED):
                    second.advance(self.step)
                self._compare(steps[-1], self._steps(second)[-1], text, "its outputs differ from the first's")
            unit.get_outputs()
            self._compare(before, unit.seen(), text, "its steps changed the first one's outputs", level=fault)
            second.end()
        finally:
            second.free()

    def _check_internal(self, unit: ProbedInstance) -> None:
        """Report the variables inside of the unit, such as states and their derivatives, that it does not give."""
        by_type: dict[str, list[FmuPort]] = defaultdict(list)
        for port in self.internal:
            by_type[port.fmi_type].append(port)
        left = _MAX_RESTARTS
        pending = list(by_type.values())
        while pending and left:
            left -= 1
            ports = pending.pop()
            unit.reset()
            unit.start(self.start)
            try:
                unit.check_readable(ports)
            except UnitFailure as e:
                if e.status == "Discard":  # a value that cannot be computed at this time
                    continue
                if len(ports) == 1:
                    what = f"its value cannot be read: {e.call} answered {e.status}"
                    cure = f"value reference {ports[0].references[0]} must be one of its library"
                    where = f"variable {ports[0].name!r}"
                    self.journal.found(fault(what, where=where, cure=cure, log=log_tail(list(e.log)[-1:])))
                else:
                    pending += [ports[len(ports) // 2 :], ports[: len(ports) // 2]]
        if unread := [port.name for ports in pending for port in ports]:
            what = f"after {_MAX_RESTARTS} restarts it is not known which of these can be read: {abbreviated(unread)}"
            self.journal.found(note(what, where="variables inside", cure="mend those that cannot, and check again"))

    def _compare(
        self,
        a: Mapping[str, bytes],
        b: Mapping[str, bytes],
        where: str,
        what: str,
        *,
        level: Any = warning,
    ) -> bool:
        """Return whether outputs differ, and report those that do."""
        different = [name for name, content in a.items() if b[name] != content]
        if different:
            self.journal.found(level(f"{what}: {abbreviated(different)}", where=where))
        return bool(different)

    def _check_values(self, unit: ProbedInstance) -> None:
        """Report outputs with invalid values, each of them once."""
        for name, views in unit.y.items():
            for finding in (
                () if name in self._reported else _value_findings(self.description.outputs[name], views[0], unit.time)
            ):
                self._reported.add(name)
                self.journal.found(finding)


def _difference(port: FmuPort, first: Sequence[bytes], second: Sequence[bytes]) -> float:
    """Return by how much an output's values differ, relative to their largest magnitude; infinity where not by numbers.

    The values are those of some instants, as bytes.
    """
    if first == second:
        return 0.0
    if port.kind is not Kind.REAL:
        return math.inf
    dtype = np.float32 if port.fmi_type == "Float32" else np.float64
    a, b = (np.frombuffer(b"".join(values), dtype).astype(np.float64) for values in (first, second))
    largest = float(np.max(np.abs(a)))
    share = float(np.max(np.abs(a - b))) / largest if largest > 0 else math.inf
    return math.inf if math.isnan(share) else share


def _value_findings(port: FmuPort, values: Any, t: float) -> Iterator[Finding]:
    where = f"output {port.name!r} at t = {t:.6g} s"
    if port.kind is Kind.REAL and not np.all(np.isfinite(values)):
        yield fault(f"not finite: {float(values[~np.isfinite(values)][0])}", where=where)
    elif port.kind in (Kind.REAL, Kind.INTEGER):
        low, high = port.minimum, port.maximum
        out = [x for x in values.tolist() if (low is not None and x < low) or (high is not None and x > high)]
        if out:
            yield warning(f"{out[0]:g} is out of its declared range", where=where)
    elif port.kind is Kind.ENUMERATION and (
        wrong := [x for x in values.tolist() if x not in [value for _, value in port.items]]
    ):
        yield warning(f"{wrong[0]} is not an item of its type", where=where)


def main(task: Mapping[str, Any]) -> None:
    """Run the FMU `task["fmu"]`, unpacked in `task["folder"]`."""
    journal = Journal(Path(task["journal"]))
    description, folder = describe_fmu(Path(task["fmu"])), Path(task["folder"])
    content = (folder / DESCRIPTION).read_bytes()
    inside = {} if len(content) > LARGE else ports_inside(parse_xml(content), description.fmi, LOCAL)
    run = SmokeRun(
        description,
        folder,
        journal,
        start=task["start"],
        step=task["step"],
        keeps_state=task["keeps_state"],
        serialises=task["serialises"],
        allows_two=task["allows_two"],
        internal=tuple(port for _, port in inside.values()),
    )
    run.run_all()
    journal.begins("unloading the library")
    journal.ends()
