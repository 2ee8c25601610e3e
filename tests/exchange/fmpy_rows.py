"""Any FMU without arrays in FMPy, call by call, with inputs that vary from step to step."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import fmpy
import numpy as np

from handover.cosim.blocks.variable import Kind
from handover.cosim.fmu.file.description import FmuPort, describe_fmu, indices_of

HOST: Any = fmpy


def rows_in_fmpy(fmu: Path, folder: Path, step: float, driven: Sequence[Mapping[str, Any]]) -> list[dict[str, float]]:
    """Make a step with each of the inputs; return the scalar outputs before the first step and after each."""
    d = describe_fmu(fmu)
    HOST.extract(str(fmu), str(folder))
    instance = HOST.instantiate_fmu(str(folder), HOST.read_model_description(str(folder)), "CoSimulation")

    def give(values: Mapping[str, Any]) -> None:
        for name, value in values.items():
            port = d.inputs[name]
            getattr(instance, f"set{_called(port, d.fmi)}")(port.references, np.ravel(value).tolist())

    try:
        if d.fmi == 2:
            instance.setupExperiment(startTime=0.0)
        instance.enterInitializationMode()
        give(driven[0])
        instance.exitInitializationMode()
        rows = [_row(instance, d.outputs, d.fmi)]
        for k, values in enumerate(driven):
            give(values)
            instance.doStep(k * step, step)
            rows.append(_row(instance, d.outputs, d.fmi))
        instance.terminate()
    finally:
        instance.freeInstance()
    return rows


def _row(instance: Any, outputs: Mapping[str, FmuPort], fmi: int) -> dict[str, float]:
    row: dict[str, float] = {}
    for port in outputs.values():
        if port.kind is Kind.STRING:
            continue
        values = getattr(instance, f"get{_called(port, fmi)}")(port.references)
        for index, value in zip(indices_of(port.shape), values, strict=True):
            row[f"{port.name}[{','.join(map(str, index))}]" if index else port.name] = float(value)
    return row


def _called(port: FmuPort, fmi: int) -> str:
    if port.kind is Kind.ENUMERATION:
        return "Integer" if fmi == 2 else "Int64"
    return port.fmi_type
