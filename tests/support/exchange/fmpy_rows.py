"""Any FMU in FMPy, call by call, with inputs that vary from step to step: all values of a type in one call."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import fmpy
import numpy as np

from handover.cosim.blocks.variable import Kind, indices_of
from handover.cosim.fmu.file.description import FmuPort, describe_fmu
from support.exchange.reference import Record

HOST: Any = fmpy

Calls = Sequence[tuple[Any, list[int], list[Any]]]
"""Functions of the instance that set values, with references and values."""


class FmpyInstance:
    """An FMU's instance. Use as a context manager, which initialises it and in the end frees it.

    Args:
        fmu: the file.
        folder: where it is unpacked.
        step: length of a step, s.
        start: parameters.
        inputs: with which it is initialised.
    """

    def __init__(
        self, fmu: Path, folder: Path, step: float, start: Mapping[str, Any], inputs: Mapping[str, Any]
    ) -> None:
        self._d, self._step, self._done = describe_fmu(fmu), step, 0
        HOST.extract(str(fmu), str(folder))
        self._instance = HOST.instantiate_fmu(str(folder), HOST.read_model_description(str(folder)), "CoSimulation")
        self._start, self._inputs = start, inputs
        self._outputs: dict[str, list[FmuPort]] = defaultdict(list)
        for port in self._d.outputs.values():
            if port.kind is not Kind.STRING:
                self._outputs[self._called(port)].append(port)
        self._gets = [
            (
                getattr(self._instance, f"get{called}"),
                [r for port in ports for r in port.references],
                sum(port.size for port in ports),
            )
            for called, ports in self._outputs.items()
        ]

    def __enter__(self) -> "FmpyInstance":
        if self._d.fmi == 2:
            self._instance.setupExperiment(startTime=0.0)
        self.give(self.calls(self._start))
        self._instance.enterInitializationMode()
        self.give(self.calls(self._inputs))
        self._instance.exitInitializationMode()
        return self

    def __exit__(self, *failure: object) -> None:
        if failure[0] is None:
            self._instance.terminate()
        self._instance.freeInstance()

    def calls(self, values: Mapping[str, Any]) -> Calls:
        """Return the calls that set values of inputs or parameters."""
        references: dict[str, list[int]] = defaultdict(list)
        entries: dict[str, list[Any]] = defaultdict(list)
        ports = {**self._d.parameters, **self._d.inputs}
        for name, value in values.items():
            port = ports[name]
            references[self._called(port)] += port.references
            if port.kind is Kind.BINARY:
                entries["Binary"].append(value.tobytes())
            else:
                entries[self._called(port)] += [value] if isinstance(value, str) else np.ravel(value).tolist()
        return [(getattr(self._instance, f"set{called}"), references[called], entries[called]) for called in references]

    def give(self, calls: Calls) -> None:
        """Set values."""
        for function, references, entries in calls:
            function(references, entries)

    def advance(self, calls: Calls) -> list[list[Any]]:
        """Set inputs, make a step, get the outputs: a list for each of their types."""
        self.give(calls)
        self._instance.doStep(self._done * self._step, self._step)
        self._done += 1
        return self.outputs()

    def outputs(self) -> list[list[Any]]:
        """Get the outputs, but for texts: a list for each of their types."""
        if self._d.fmi == 2:
            return [function(references) for function, references, _ in self._gets]
        return [function(references, size) for function, references, size in self._gets]

    def record(self, outputs: Sequence[Sequence[list[Any]]]) -> Record:
        """Return what was got at several times by the names of scalars, and of pictures."""
        rows: list[dict[str, float]] = []
        pictures: list[dict[str, bytes]] = []
        for found in outputs:
            rows.append({})
            pictures.append({})
            for ports, values in zip(self._outputs.values(), found, strict=True):
                entries = iter(values)
                for port in ports:
                    if port.kind is Kind.BINARY:
                        pictures[-1][port.name] = next(entries)
                        continue
                    for index in indices_of(port.shape):
                        name = f"{port.name}[{','.join(map(str, index))}]" if index else port.name
                        rows[-1][name] = float(next(entries))
        return Record(rows, pictures)

    def _called(self, port: FmuPort) -> str:
        if port.kind is Kind.ENUMERATION:
            return "Integer" if self._d.fmi == 2 else "Int64"
        return port.fmi_type


def record_in_fmpy(
    fmu: Path, folder: Path, step: float, driven: Sequence[Mapping[str, Any]], start: Mapping[str, Any] | None = None
) -> Record:
    """Make a step with each of the inputs; return the outputs before the first step and after each."""
    with FmpyInstance(fmu, folder, step, start or {}, driven[0]) as instance:
        first = instance.outputs()
        return instance.record([first, *(instance.advance(instance.calls(values)) for values in driven)])
