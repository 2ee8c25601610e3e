"""Puts units, connected, into one FMU by fmu-manipulation-toolbox's command `fmucontainer`."""

import json
import shutil
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from handover.cosim.blocks.variable import Kind, indices_of, subscript
from handover.cosim.fmu.file.description import FmuDescription, FmuPort, describe_fmu
from support.exchange.own_master import Placed
from support.exchange.systems import Wired

Output = TypeVar("Output", float, bytes)
"""A scalar output, or a picture."""

LIMIT = 120.0
"""Seconds after which building is given up."""


def put_into_container(wired: Wired, fmi: int, folder: Path, options: Sequence[str] = ()) -> Path:
    """Return an FMU of version `fmi` with a system's units inside.

    It has the inputs that are not connected, but for arrays of FMI 3, and all outputs; each is named `unit_port`, for
    the toolbox keeps `unit.port` for itself. It has no parameters: the units start with the
    values that are given for them.

    Raises:
        AssertionError: the command failed or complained; with what it wrote.
    """
    descriptions = {name: describe_fmu(placed.fmu) for name, placed in wired.units.items()}
    for name, placed in wired.units.items():
        shutil.copy(placed.fmu, folder / f"{name}.fmu")
    described = folder / "container.json"
    described.write_text(json.dumps(_described(wired, descriptions)))
    command = [sys.executable, "-m", "fmu_manipulation_toolbox.cli.fmucontainer", "-container", described.name]
    command += ["-fmi", str(fmi), "-fmu-directory", str(folder), *options]
    done = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT, cwd=folder, check=False)
    lines = done.stderr.splitlines() + done.stdout.splitlines()
    complaints = [line for line in lines if "ERROR" in line and not line.endswith("is not connected")]
    assert done.returncode == 0, done.stdout + done.stderr
    assert not complaints, complaints
    return folder / "container.fmu"


def outputs_of(unit: str, rows: Sequence[Mapping[str, Output]]) -> list[dict[str, Output]]:
    """Return the outputs of one unit in a container, by the unit's own names."""
    prefix = f"{unit}_"
    return [{n.removeprefix(prefix): x for n, x in row.items() if n.startswith(prefix)} for row in rows]


def _described(wired: Wired, descriptions: Mapping[str, FmuDescription]) -> dict[str, Any]:
    fed = {target for _, target in wired.connections}
    inputs: list[list[str]] = []
    outputs: list[list[str]] = []
    links: list[list[str]] = []
    starts: list[list[Any]] = []
    for name, d in descriptions.items():
        for port in d.inputs.values():
            if f"{name}.{port.name}" not in fed and not _is_whole_array(port):
                inputs += [[f"{name}_{n}", f"{name}.fmu", n] for n in _names(port)]
        for port in d.outputs.values():
            outputs += [[f"{name}.fmu", n, f"{name}_{n}"] for n in _names(port)]
        starts += _starts(name, d, wired.units[name])
    for source, target in wired.connections:
        (a, y), (b, u) = source.split("."), target.split(".")
        ends = zip(_names(descriptions[a].outputs[y]), _names(descriptions[b].inputs[u]), strict=True)
        links += [[f"{a}.fmu", from_, f"{b}.fmu", to] for from_, to in ends]
    return {
        "name": "container.fmu",
        "auto_link": False,
        "auto_input": False,
        "auto_output": False,
        "step_size": float(wired.step),
        "fmu": [f"{name}.fmu" for name in descriptions],
        "input": inputs,
        "output": outputs,
        "link": links,
        "start": starts,
    }


def _starts(name: str, d: FmuDescription, placed: Placed) -> list[list[Any]]:
    ports = {**d.parameters, **d.inputs}
    starts: list[list[Any]] = []
    for variable, value in placed.start.items():
        port = ports[variable]
        names = _names(port)
        if port.kind is Kind.STRING or (len(names) == 1 and port.shape):
            entries = [value if port.kind is Kind.STRING else " ".join(map(repr, np.ravel(value).tolist()))]
        else:
            entries = np.ravel(value).tolist()
        starts += [[f"{name}.fmu", n, x] for n, x in zip(names, entries, strict=True)]
    return starts


def _is_whole_array(port: FmuPort) -> bool:
    """Tell an array of FMI 3; the toolbox describes an input that is one in a way that the standard's schema refuses.

    Such an input is left unconnected, at its start value.
    """
    return bool(port.shape) and len(port.references) == 1


def _names(port: FmuPort) -> list[str]:
    """Return a port's names in its FMU: one if that has arrays, else its entries'."""
    if len(port.references) == 1:
        return [port.name]
    return [port.name + subscript(index) for index in indices_of(port.shape)]
