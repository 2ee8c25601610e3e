"""A job for libcosim and its result, by variables' names."""

import ctypes
import importlib.util
import json
import subprocess
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from handover.cosim.blocks.variable import indices_of
from handover.cosim.fmu.file.description import FmuDescription, FmuPort, describe_fmu
from support.exchange.own_master import Placed
from support.processes import program, with_path

LIMIT = 120.0
"""Seconds after which a run is ended."""

KINDS = {"Real": "real", "Integer": "integer", "Boolean": "boolean", "String": "string"}
"""libcosim's words for FMI 2's types; it leaves out enumerations, saying so in its log."""

Row = dict[str, float]


def _missing() -> str:
    """Return what libcosim lacks on this machine; empty if it runs."""
    if importlib.util.find_spec("libcosimpy") is None:
        return "libcosimpy has wheels for few platforms"
    try:
        ctypes.CDLL("libatomic.so.1")  # its wheel does not bring it
    except OSError:
        return "libcosim needs libatomic.so.1 (Debian: libatomic1)"
    return ""


needs_libcosim = pytest.mark.skipif(bool(_missing()), reason=_missing())


@dataclass
class Job:
    """Units by name, how far to go, and by unit the values that are set before each step.

    With an SSP, which has the units inside, start values and connections are those in it, and without a step that too.
    """

    units: Mapping[str, Placed]
    step: Fraction | None
    steps: int
    driven: Mapping[str, Sequence[Mapping[str, Any]]] = field(default_factory=dict[str, Any])
    ssp: Path | None = None

    def run(self, folder: Path) -> dict[str, list[Row]]:
        """Run in a process of its own; return each unit's scalar outputs at every step's end.

        Raises:
            AssertionError: libcosim gave up; with what it wrote.
        """
        return self.run_and_repeat(folder, ())[0]

    def run_and_repeat(self, folder: Path, repeats: Sequence[int]) -> tuple[dict[str, list[Row]], list[float]]:
        """Run likewise, and then make the steps again, some number of times, as often as there are numbers.

        Returns:
            What `run` does, and of each repetition the seconds of CPU, those of processes that units have started
            included.
        """
        job, result = folder / "job.json", folder / "result.json"
        job.write_text(json.dumps(self._as_json() | {"repeats": list(repeats)}))
        command = program("exchange/libcosim_host.py", job, result)
        done = subprocess.run(
            command, capture_output=True, text=True, timeout=LIMIT, cwd=folder, env=with_path(), check=False
        )
        assert done.returncode == 0, done.stdout + done.stderr
        found = json.loads(result.read_text())
        rows = found["rows"]
        outputs = [known(self.description(name).outputs) for name in self.units]
        named = {name: [_row(outputs[i], row[i]) for row in rows] for i, name in enumerate(self.units)}
        return named, found["spent"]

    def description(self, unit: str) -> FmuDescription:
        """Return what a unit's FMU says of itself."""
        return describe_fmu(self.units[unit].fmu)

    def _as_json(self) -> dict[str, Any]:
        return {
            "step": None if self.step is None else round(self.step * 10**9),
            "steps": self.steps,
            "ssp": str(self.ssp) if self.ssp else "",
            "units": [self._unit(name, placed) for name, placed in self.units.items()],
        }

    def _unit(self, name: str, placed: Placed) -> dict[str, Any]:
        d = self.description(name)
        ports = {**d.parameters, **d.inputs}
        outputs: dict[str, list[int]] = defaultdict(list)
        for port in known(d.outputs):
            outputs[KINDS[port.fmi_type]] += port.references
        values_by_step = self.driven[name] if name in self.driven else [dict[str, Any]()] * self.steps
        driven = [_by_kind(ports, values) for values in values_by_step]
        initial = _by_kind(ports, placed.start)
        return {"name": name, "fmu": str(placed.fmu), "initial": initial, "driven": driven, "outputs": outputs}


def known(ports: Mapping[str, FmuPort]) -> list[FmuPort]:
    """Return the ports of types that libcosim knows."""
    return [port for port in ports.values() if port.fmi_type in KINDS]


def _row(ports: Sequence[FmuPort], by_kind: Mapping[str, Sequence[Any]]) -> Row:
    values = {kind: iter(numbers) for kind, numbers in by_kind.items()}
    row: Row = {}
    for port in ports:
        for index in indices_of(port.shape):
            value = next(values[KINDS[port.fmi_type]])
            if port.fmi_type != "String":
                row[f"{port.name}[{','.join(map(str, index))}]" if index else port.name] = float(value)
    return row


def _by_kind(ports: Mapping[str, FmuPort], values: Mapping[str, Any]) -> dict[str, list[tuple[int, Any]]]:
    made: dict[str, list[tuple[int, Any]]] = defaultdict(list)
    for name, value in values.items():
        port = ports[name]
        if port.fmi_type == "Enumeration":
            continue
        entries = [value] if isinstance(value, str) else np.ravel(value).tolist()
        made[KINDS[port.fmi_type]] += zip(port.references, entries, strict=True)
    return made
