"""Runs a system as a compiled plan and on the general path, and compares the results."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

from handover.cosim.blocks.variable import Kind
from handover.cosim.exceptions import UnitFailure
from handover.cosim.master.master import Master
from handover.cosim.plan.plan_stepper import PlanStepper
from handover.cosim.record.recorder import Recorder
from handover.cosim.stepping.options import Algorithm, MasterOptions
from handover.cosim.system.signals import Signals
from handover.cosim.system.system import System

Build = Callable[[], System]

PLAIN = tuple(a for a in Algorithm if a.coupling.traits.in_plan)
"""The algorithms that a plan knows."""


@dataclass(frozen=True)
class Outcome:
    """The outcome of a run: the record's bytes, what an observer saw, and the failure in which it ended."""

    record: bytes
    seen: tuple[object, ...] = ()
    failure: UnitFailure | None = None


def recorded(
    build: Build, stops: Sequence[Fraction], folder: Path, *, compiled: bool,
    algorithm: Algorithm = Algorithm.GAUSS_SEIDEL, observed: bool = False,
) -> Outcome:  # fmt: skip
    """Run a system from stop to stop; observed, Python reads all signals at each communication point."""
    seen: list[object] = []
    system = build()

    def look(t: float, signals: Signals) -> None:
        seen.append((t, everything(system, signals)))

    file = folder / f"{algorithm.value}-{compiled}-{observed}.parquet"
    failure: UnitFailure | None = None
    with Master(system, MasterOptions(algorithm=algorithm, compiled=compiled)) as master:
        assert isinstance(master.stepper, PlanStepper) == compiled
        with Recorder(file) as recorder:
            try:
                for stop in stops:
                    master.run(stop, [recorder, look] if observed else [recorder])
            except UnitFailure as e:
                failure = e
        seen.append((master.time, everything(system, master.signals)))
    return Outcome(file.read_bytes(), tuple(seen), failure)


def everything(system: System, signals: Signals) -> tuple[object, ...]:
    """Return all outputs, texts and pictures too."""
    return tuple(
        signals.text(f"{name}.{port}") if p.kind is Kind.STRING else signals[f"{name}.{port}"].tobytes()
        for name, unit in system.units.items()
        for port, p in unit.description.outputs.items()
    )


def expect_alike(
    build: Build, stop: Fraction, folder: Path, algorithm: Algorithm, stops: Sequence[Fraction] = ()
) -> Outcome:
    """Expect that both paths, observed or not, have the same outcome; return it."""
    stops = stops or [stop]
    general = recorded(build, stops, folder, compiled=False, algorithm=algorithm, observed=True)
    observed = recorded(build, stops, folder, compiled=True, algorithm=algorithm, observed=True)
    alone = recorded(build, stops, folder, compiled=True, algorithm=algorithm)
    assert observed.record == general.record
    assert alone.record == general.record
    assert observed.seen == general.seen
    assert alone.seen == general.seen[-1:]
    for outcome in (observed, alone):
        assert type(outcome.failure) is type(general.failure)
        assert outcome.failure is None or repr(vars(outcome.failure)) == repr(vars(general.failure))
    return alone
