"""Runs of an FMU from its start or from a state, with inputs that depend on nothing but the step's number."""

from pathlib import Path

from support.exchange import drive
from support.exchange.reference import description
from support.fmus.fmpy_host import Digests, FmpyHost

STEPS = 8
"""Steps before a state is taken, and after."""

HELD = 3
"""Every so many steps, from the first one on, no input is set: what was set before must hold, and be in the state."""


def run(host: FmpyHost, first: int) -> list[Digests]:
    """Make STEPS steps, beginning with number `first`; return the outputs after each."""
    seen: list[Digests] = []
    step = host.description.step
    assert step is not None
    for k in range(first, first + STEPS):
        if k % HELD:
            host.set(inputs_at(host.description.name, k))
        host.step(k * step, step)
        seen.append(host.outputs())
    return seen


def run_on(fmu: Path, state: Path, first: int, *, initialising: bool = False) -> list[Digests]:
    """Go on in an instance of its own from a state in a file, one saved in initialisation mode or later."""
    with FmpyHost(fmu) as host:
        host.restore(state.read_bytes())
        if initialising:
            host.leave()
        return [host.outputs(), *run(host, first)]


def inputs_at(unit: str, k: int) -> drive.Values:
    """Return inputs near their start values: a unit must take them, and its state must depend on them."""
    return drive.inputs(description(unit), k % drive.STEPS)


def other_parameters(unit: str) -> drive.Values:
    """Return parameters that are not the start values, and still a unit's that works."""
    return drive.parameters(description(unit))
