"""What libcosim is asked to run, and what it answers, by variables' names."""

import json
import subprocess
import sys
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from cosim.fmu_description import FmuDescription, FmuPort, describe_fmu, indices_of

LIMIT = 120.0
"""Seconds after which a run is ended."""

KINDS = {"Real": "real", "Integer": "integer", "Enumeration": "integer", "Boolean": "boolean", "String": "string"}
"""libcosim's words for FMI 2's types."""

Row = dict[str, float]


@dataclass
class Placed:
    """A unit in a system: its FMU, the values that it starts with, and those that it is given at every step."""

    fmu: Path
    initial: Mapping[str, Any] = field(default_factory=dict[str, Any])
    driven: Sequence[Mapping[str, Any]] = ()


@dataclass
class Job:
    """Units by name, connections between ports written `unit.port`, and how far to go."""

    units: Mapping[str, Placed]
    step: Fraction
    steps: int
    connections: Sequence[tuple[str, str]] = ()

    def run(self, folder: Path) -> dict[str, list[Row]]:
        """Run in a process of its own; return each unit's scalar outputs at every step's end.

        Raises:
            AssertionError: libcosim gave up; with what it wrote.
        """
        job, result = folder / "job.json", folder / "result.json"
        job.write_text(json.dumps(self._as_json()))
        host = Path(__file__).with_name("libcosim_host.py")
        command = [sys.executable, str(host), str(job), str(result)]
        done = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT, cwd=folder, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
        rows = json.loads(result.read_text())
        return {name: [self._row(name, row[i]) for row in rows] for i, name in enumerate(self.units)}

    def description(self, unit: str) -> FmuDescription:
        """Return what a unit's FMU says of itself."""
        return describe_fmu(self.units[unit].fmu)

    def _as_json(self) -> dict[str, Any]:
        numbers = {name: i for i, name in enumerate(self.units)}
        connections: list[Any] = []
        for source, target in self.connections:
            (a, y), (b, u) = source.split("."), target.split(".")
            output, input_ = self.description(a).outputs[y], self.description(b).inputs[u]
            for r, s in zip(output.references, input_.references, strict=True):
                connections.append((KINDS[output.fmi_type], numbers[a], r, numbers[b], s))
        return {
            "step": round(self.step * 10**9),
            "steps": self.steps,
            "units": [self._unit(name, placed) for name, placed in self.units.items()],
            "connections": connections,
        }

    def _unit(self, name: str, placed: Placed) -> dict[str, Any]:
        d = self.description(name)
        ports = {**d.parameters, **d.inputs}
        outputs: dict[str, list[int]] = defaultdict(list)
        for port in d.outputs.values():
            outputs[KINDS[port.fmi_type]] += port.references
        driven = [_by_kind(ports, values) for values in placed.driven] or [{}] * self.steps
        initial = _by_kind(ports, placed.initial)
        return {"name": name, "fmu": str(placed.fmu), "initial": initial, "driven": driven, "outputs": outputs}

    def _row(self, unit: str, by_kind: Mapping[str, Sequence[Any]]) -> Row:
        values = {kind: iter(numbers) for kind, numbers in by_kind.items()}
        row: Row = {}
        for port in self.description(unit).outputs.values():
            for index in indices_of(port.shape):
                value = next(values[KINDS[port.fmi_type]])
                if port.fmi_type != "String":
                    row[f"{port.name}[{','.join(map(str, index))}]" if index else port.name] = float(value)
        return row


def _by_kind(ports: Mapping[str, FmuPort], values: Mapping[str, Any]) -> dict[str, list[tuple[int, Any]]]:
    made: dict[str, list[tuple[int, Any]]] = defaultdict(list)
    for name, value in values.items():
        port = ports[name]
        entries = [value] if isinstance(value, str) else np.ravel(value).tolist()
        made[KINDS[port.fmi_type]] += zip(port.references, entries, strict=True)
    return made
