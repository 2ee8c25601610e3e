"""A host of values of every type and of states: FMPy, by variables' names."""

import hashlib
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from handover.cosim.blocks.variable import Kind
from handover.cosim.fmu.file.description import FmuPort, describe_fmu
from handover.cosim.fmu.file.fmpy_edge import unpack
from handover.cosim.fmu.loading import load_unit

Digests = dict[str, str]
"""A digest of every output's bytes, by name."""


class FmpyHost:
    """One instance of an FMU. Use as a context manager.

    Attributes:
        description: what the FMU says of itself.
        log: messages so far.
    """

    def __init__(self, fmu: Path) -> None:
        self.description = d = describe_fmu(fmu)
        self.log: list[str] = []
        self._folder = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        folder = Path(self._folder.name)
        unpack(fmu, folder, d.fmi, d.identifier)

        def log(_status: int, message: str) -> None:
            self.log.append(message)

        self.fmu = load_unit(d, folder, "unit", log, lambda _call: None)

    def __enter__(self) -> "FmpyHost":
        return self

    def __exit__(self, *_: object) -> None:
        self.fmu.freeInstance()
        self._folder.cleanup()

    def enter(self) -> None:
        """Enter initialisation mode."""
        if self.description.fmi == 2:
            self.fmu.setupExperiment()
        self.fmu.enterInitializationMode()

    def leave(self) -> None:
        """Leave initialisation mode."""
        self.fmu.exitInitializationMode()

    def step(self, t: float, dt: float) -> None:
        """Do a step."""
        self.fmu.doStep(t, dt)

    def set(self, values: Mapping[str, Any]) -> None:
        """Set parameters or inputs."""
        ports = {**self.description.parameters, **self.description.inputs}
        for name, value in values.items():
            port = ports[name]
            entries = [value] if isinstance(value, str) else np.ravel(value).tolist()
            if port.kind is Kind.BINARY:
                entries = [value.tobytes()]
            getattr(self.fmu, f"set{self._type(port)}")(port.references, entries)

    def outputs(self) -> Digests:
        """Return digests of all outputs, as they are bit by bit."""
        return {name: _digest(self._bytes(port)) for name, port in self.description.outputs.items()}

    def saved(self) -> bytes:
        """Return the state, serialised."""
        state = self.fmu.getFMUState()
        data = self.fmu.serializeFMUState(state)
        self.fmu.freeFMUState(state)
        return data

    def restore(self, data: bytes) -> None:
        """Go to a serialised state."""
        state = self.fmu.deserializeFMUState(data)
        self.fmu.setFMUState(state)
        self.fmu.freeFMUState(state)

    def _bytes(self, port: FmuPort) -> bytes:
        get = getattr(self.fmu, f"get{self._type(port)}")
        counts = () if self.description.fmi == 2 else (int(np.prod(port.shape)),)
        values = get(port.references, *counts)
        if port.kind is Kind.BINARY:
            return values[0]
        return repr(values).encode() if port.kind is Kind.STRING else np.asarray(values).tobytes()

    def _type(self, port: FmuPort) -> str:
        if port.fmi_type == "Enumeration":
            return "Integer" if self.description.fmi == 2 else "Int64"
        return port.fmi_type


def _digest(data: bytes) -> str:
    return hashlib.blake2b(data, digest_size=8).hexdigest()
