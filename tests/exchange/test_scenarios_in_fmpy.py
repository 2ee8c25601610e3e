"""Whole scenarios from their FMUs in FMPy: its classes hold the units, which step in parallel as in our own master."""

from collections.abc import Mapping
from fractions import Fraction
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from support.exchange.disturbed_grasp import DISTURBED, OFF

from handover.cosim.blocks.variable import Kind
from handover.cosim.fmu.file.description import FmuPort, indices_of
from handover.cosim.master.master import Master
from handover.cosim.stepping.options import Algorithm, MasterOptions
from handover.cosim.system.signals import Signals
from handover.cosim.system.system import PlacedUnit, System
from handover.fmus.build import cached
from handover.scenarios.catalog import SCENARIOS
from handover.scenarios.execution.runner import experiment_system
from handover.scenarios.experiment.parameters import parse_parameters

HOST: Any = fmpy
SEED = 3


class FmpyUnit:
    """A unit that FMPy runs, with values by port, as the master has them."""

    def __init__(self, unit: PlacedUnit, folder: Path) -> None:
        d = unit.description
        HOST.extract(str(d.path), str(folder))
        self._settable, self._outputs = {**d.settable, **d.inputs}, d.outputs
        self._slave: Any = HOST.instantiate_fmu(str(folder), HOST.read_model_description(str(folder)), "CoSimulation")
        for name, value in unit.start.items():
            self.give(name, value)
        self._slave.enterInitializationMode()

    def give(self, name: str, value: Any) -> None:
        """Set a parameter or an input."""
        port = self._settable[name]
        entries = [value] if isinstance(value, bytes) else np.ravel(value).tolist()
        getattr(self._slave, f"set{_called(port)}")(port.references, entries)

    def take(self, name: str) -> Any:
        """Return an output: bytes of a picture, else its entries."""
        port = self._outputs[name]
        found = getattr(self._slave, f"get{_called(port)}")(port.references, int(np.prod(port.shape, dtype=int)))
        return bytes(found[0]) if port.kind is Kind.BINARY else list(found)

    @property
    def row(self) -> dict[str, float]:
        """All outputs that are numbers, by element."""
        row: dict[str, float] = {}
        for name, port in self._outputs.items():
            if port.kind not in (Kind.BINARY, Kind.STRING):
                for index, value in zip(indices_of(port.shape), self.take(name), strict=True):
                    row[f"{name}[{','.join(map(str, index))}]" if index else name] = float(value)
        return row

    def begin(self) -> None:
        """Leave the initialization mode."""
        self._slave.exitInitializationMode()

    def step(self, t: float, dt: float) -> None:
        """Make a step."""
        self._slave.doStep(t, dt)

    def free(self) -> None:
        """Terminate and free it."""
        self._slave.terminate()
        self._slave.freeInstance()


def _called(port: FmuPort) -> str:
    return "Int64" if port.kind is Kind.ENUMERATION else port.fmi_type


def in_fmpy(system: System, folder: Path, steps: int) -> dict[str, float]:
    """Make steps of all units of a system in parallel; return all outputs at the end."""
    (step,) = {unit.period for unit in system.units.values()}
    units = {name: FmpyUnit(unit, folder / name) for name, unit in system.units.items()}

    def exchange() -> None:
        values = [(c.target, units[c.source.unit].take(c.source.port)) for c in system.connections]
        for target, value in values:
            units[target.unit].give(target.port, value)

    try:
        for _ in units:  # outputs that depend directly on inputs, along chains as long as there are units
            exchange()
        for unit in units.values():
            unit.begin()
        for k in range(steps):
            exchange()
            for unit in units.values():
                unit.step(float(k * step), float(step))
        return {f"{name}.{port}": x for name, unit in units.items() for port, x in unit.row.items()}
    finally:
        for unit in units.values():
            unit.free()


def in_our_own(name: str, system: System, parameters: Any, most: Fraction) -> tuple[dict[str, float], int, str]:
    """Run until the evaluator has seen enough; return all numbers at the end, the steps, and what it says."""
    experiment = SCENARIOS[name]()
    evaluator = experiment.evaluator(parameters)
    (step,) = {unit.period for unit in system.units.values()}

    def look(t: float, signals: Signals) -> None:
        evaluator(t, signals)

    with Master(system, MasterOptions(algorithm=Algorithm.JACOBI)) as master:
        master.run(min(most, experiment.stop_time(parameters)), [look], lambda: evaluator.over)
        evaluator.finish(master.signals)
        values = {c.name: float(c.values[c.index]) for c in master.signals.columns()}
        return values, round(master.time / float(step)), evaluator.outcome().reason


def built(name: str, given: tuple[str, ...], of_units: Mapping[str, str]) -> tuple[System, Any]:
    experiment = SCENARIOS[name]()
    parameters = parse_parameters(SCENARIOS[name], list(given))
    fmus = {unit: cached(block, 3) for unit, block in experiment.units.items()}
    options = MasterOptions(algorithm=Algorithm.JACOBI)
    return experiment_system(experiment, parameters, SEED, fmus, of_units, options), parameters


@pytest.mark.parametrize(
    ("name", "given", "of_units", "most"),
    [
        pytest.param("ir_grasp", (), {}, 90, marks=pytest.mark.slow),
        pytest.param("ir_grasp", ("correction=fast",), {}, 90, marks=pytest.mark.hosts),
        pytest.param("ir_grasp", DISTURBED, OFF, 90, marks=pytest.mark.hosts),
        pytest.param("ir_sensor", (), {}, 90, marks=pytest.mark.hosts),
        pytest.param("helix_reflex_grasp", (), {}, 30, marks=pytest.mark.hosts),
    ],
)
def test_a_scenario_ends_in_fmpy_as_here(
    name: str, given: tuple[str, ...], of_units: Mapping[str, str], most: int, tmp_path: Path
):
    system, parameters = built(name, given, of_units)
    wanted, steps, reason = in_our_own(name, system, parameters, Fraction(most))
    found = in_fmpy(system, tmp_path, steps)
    assert steps > 100, reason
    assert len(found) > 20
    for port, x in found.items():
        assert x == pytest.approx(wanted[port], rel=1e-9, abs=1e-9, nan_ok=True), port
