"""A native unit driven through FMPy, without the master."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import fmpy
import fmpy.fmi2
import fmpy.fmi3
from native_units import declarations, native_fmu


class DrivenUnit:
    """Sets, gets and steps a unit, whose FMU is unpacked into a folder, by the names of its variables."""

    def __init__(self, name: str, fmi: int, folder: Path) -> None:
        self._declaration, self._fmi = declarations()[name], fmi
        fmpy.extract(str(native_fmu(name, fmi)), str(folder))
        slave = fmpy.fmi2.FMU2Slave if fmi == 2 else fmpy.fmi3.FMU3Slave
        self.fmu: Any = slave(guid=name, modelIdentifier=name, unzipDirectory=str(folder), instanceName=name)
        kind = "Real" if fmi == 2 else "Float64"
        self.get: Any = getattr(self.fmu, f"get{kind}")
        self.set: Any = getattr(self.fmu, f"set{kind}")

    def start(self, *, event_mode: bool = False, **values: float) -> None:
        """Set parameters and go through initialisation."""
        self.fmu.instantiate(**({"eventModeUsed": True, "earlyReturnAllowed": True} if event_mode else {}))
        for parameter, value in values.items():
            self[parameter] = value
        if self._fmi == 2:
            self.fmu.setupExperiment(startTime=0.0)
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()

    def references(self, *names: str) -> list[int]:
        return [self._declaration.reference(name, self._fmi) for name in names]

    def __getitem__(self, name: str) -> float:
        return self.get(self.references(name))[0]

    def __setitem__(self, name: str, value: float) -> None:
        self.set(self.references(name), [value])

    def step(self, t: float, h: float) -> Any:
        return self.fmu.doStep(currentCommunicationPoint=t, communicationStepSize=h)


Started = Callable[..., DrivenUnit]
"""Takes a unit's name, the version of FMI, `event_mode` and values of parameters."""
