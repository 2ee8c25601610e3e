"""A system that a program steps itself: it sets free inputs, steps, reads signals, saves and restores the state."""

import contextlib
import copy
import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handover.cosim.blocks.block import InvalidState
from handover.cosim.blocks.start_values import fault_of
from handover.cosim.exceptions import first_faults, nearest, visible
from handover.cosim.fmu.file.description import FmuPort
from handover.cosim.master.checkpoint import Checkpoint, check_states, take_checkpoint
from handover.cosim.master.master import Master
from handover.cosim.stepping.options import Algorithm, MasterOptions
from handover.cosim.system.signals import Signals
from handover.cosim.system.system import PortName, System
from handover.cosim.system.time_series import HeldValue
from handover.scenarios.api.arguments import (
    InvalidInput,
    Seconds,
    errors_for_python,
    exact,
    exact_time,
    master_options,
    merged,
    of_type,
    positive_seconds,
    single_texts,
    unit_texts,
    whole_number,
)
from handover.scenarios.api.open_inputs import OpenSystem
from handover.scenarios.experiment.experiment import Evaluator, Experiment, Outcome
from handover.scenarios.experiment.parameters import text_of
from handover.scenarios.runs.execution.fmu_run import is_fmu
from handover.scenarios.runs.execution.request import RunRequest, check_subject
from handover.scenarios.runs.execution.ssp_run import is_ssp
from handover.scenarios.runs.results.tolerated_faults import GuardedEvaluator


@dataclass(frozen=True)
class SavedState:
    """The whole state of a session: units, master, evaluation, and what was set from outside.

    Attributes:
        checkpoint: states of units and master.
        evaluator: what the evaluation has seen.
        free: values of the free inputs, and of the outputs of the unit that is left out.
        asked: the time until which it was stepped, s.
        seen: the last time that the evaluation has seen, s; -inf before the first step.
        given: outputs of the unit that is left out which the evaluation sees.
        settings: of the session, as texts: the scenario's parameters, its units' FMUs and start values, its wiring.
    """

    checkpoint: Checkpoint
    evaluator: bytes
    free: Mapping[str, NDArray[Any]]
    asked: Fraction
    seen: float
    given: frozenset[str]
    settings: Mapping[str, str]


class Session:
    """A running system. `handover.open` makes it; use it as a context manager, or call `close` at the end.

    `s["unit.port"]` reads an output, an input or a parameter; `s["unit.port"] = value` sets an input that no output
    feeds, or a tunable parameter, in its own unit. What is set counts from the present communication point on, for the
    steps that begin there; units that sample at that instant have acted before.
    """

    def __init__(
        self, experiment: Experiment[Any], parameters: Any, system: System, options: MasterOptions,
        left_out: str | None = None, given: Sequence[str] = (),
    ) -> None:  # fmt: skip
        """Load and initialise a checked system; nothing is stepped yet.

        Of the unit that is left out, the evaluation sees the outputs that feed others or that the scenario needs, and
        those that are given or set, as it does of a unit that has no others.

        Raises:
            InvalidInput: see `OpenSystem`.
            CosimError: see `Master`.
        """
        self._open = OpenSystem(system, left_out)
        self.stop = float(experiment.stop_time(parameters))
        """When a run of the scenario ends at the latest, s."""
        self._evaluator: GuardedEvaluator[Evaluator] = GuardedEvaluator(experiment.bound_evaluator(parameters))
        self._evaluator.note_units(self._open.system.units)
        self._pushes = experiment.pushes(parameters)
        self._settings = _settings(experiment, parameters, self._open.system)
        self._asked, self._seen = self._open.system.start, -math.inf
        self._master = Master(self._open.system, options)
        self._master.__enter__()
        self._given = self._needed_outputs(experiment, left_out) | {*given}
        self._signals = self._all_signals()
        self._judged = self._judged_signals()

    @property
    def time(self) -> float:
        """Simulated time, s."""
        return self._master.time

    @property
    def over(self) -> bool:
        """Whether the scenario's task has ended, well or not, or a unit has ended the simulation."""
        return self._evaluator.over or self._master.ended is not None

    @property
    def outcome(self) -> Outcome:
        """The verdict on what has happened until now, with its reason and metrics."""
        evaluator = copy.deepcopy(self._evaluator)
        evaluator.finish(self._judged)
        return evaluator.outcome()

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs that can be set."""
        return tuple(self._open.free)

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of all outputs."""
        return tuple(f"{u.name}.{port}" for u in self._open.system.units.values() for port in u.description.outputs)

    def step(self, duration: Seconds) -> float:
        """Step on by a duration, s, to the first communication point at or after it; return the time reached.

        Durations add up exactly: ten steps of 0.1 s end at 1 s. It ends before where the task is over.

        Raises:
            InvalidInput: the duration is none.
            UnitFailure: a unit failed; the session can only be closed then.
            RuntimeError: a unit failed before, or has ended the simulation.
        """
        return self._run(self._asked + positive_seconds("duration", duration))

    def start(self) -> float:
        """Let units that sample at the start act, and the evaluation begin, as the first step would; return the time.

        Raises:
            UnitFailure: a unit failed.
        """
        return self._run(self._asked)

    def __getitem__(self, name: str) -> Any:
        """Return a copy of a signal's value: a number, an array, or a text; enumerations as numbers, see `text`.

        Raises:
            KeyError: there is no such port; the nearest names are given.
            UnitFailure: a unit does not give it.
        """
        unit, port = self._open.split(name)
        if self._open.place is not None and unit == self._open.place.unit.name:
            return _plain(self._signals[name])
        d = self._open.system.units[unit].description
        if port in d.outputs:
            return _plain(self._signals[name])
        if name in self._open.free:
            return _plain(np.array(self._open.free[name].entries).reshape(d.inputs[port].shape))
        instance = self._master.ensemble.instances[unit]
        if port in d.inputs and port in instance.u:
            return _plain(np.array(instance.u[port][0]).reshape(d.inputs[port].shape))
        if port in d.parameters:
            return _plain(self._parameter(unit, d.parameters[port]))
        raise KeyError(f"no port {name!r}; {nearest(port, [*d.outputs, *d.inputs, *d.parameters])}")

    def __setitem__(self, name: str, value: Any) -> None:
        """Set a free input, a tunable parameter, or an output of the unit that is left out.

        Raises:
            KeyError: there is no such port; the nearest names are given.
            InvalidInput: it cannot be set, or not to this value.
            UnitFailure: the unit does not take it.
        """
        unit, port = self._open.split(name)
        if self._open.place is not None and unit == self._open.place.unit.name:
            if port not in self._open.place.ports:
                raise KeyError(f"no output {name!r} that can be set; {nearest(port, self._open.place.ports)}")
            self._open.set_output(port, value)
            self._give({port})
        elif name in self._open.free:
            self._open.set(name, value)
        else:
            self._tune(unit, port, value)

    def text(self, name: str) -> str:
        """Return the name of an enumeration output's value, or the text of a string output.

        Raises:
            KeyError: there is no such output.
        """
        return self._signals.text(name)

    def save(self) -> SavedState:
        """Return the whole state, to which `restore` goes back, also in another session of the same system.

        Raises:
            InvalidInput: a unit cannot save its state.
            UnitFailure: one fails to do so.
        """
        with errors_for_python():
            check_states(self._open.system)
            evaluator = self._evaluator.packed()
        free: dict[str, NDArray[Any]] = {name: held.entries.copy() for name, held in self._open.free.items()}
        if (place := self._open.place) is not None:
            free |= {f"{place.unit.name}.{name}": views[0].copy() for name, views in place.outputs.items()}
        checkpoint = self._master.call_units(lambda: take_checkpoint(self._master, 0))
        return SavedState(checkpoint, evaluator, free, self._asked, self._seen, frozenset(self._given), self._settings)

    def restore(self, state: SavedState) -> None:
        """Go back to a state; the steps that follow are those that followed it, bit for bit.

        Raises:
            InvalidInput: it is the state of another system, or of one with other parameters, which are no part of the
                state. Of another seed it is taken, as the state has the random numbers', unless that sets parameters.
            UnitFailure: a unit does not take it.
            RuntimeError: a unit has ended the simulation.
        """
        if self._master.ended is not None:
            raise RuntimeError(f"{self._master.ended.summary}: open another session")
        of_type("state", state, SavedState, "what Session.save returned")
        self._check_settings(state)
        with errors_for_python():
            self._master.call_units(lambda: state.checkpoint.restore(self._master))
        self._evaluator = GuardedEvaluator(self._evaluator.evaluator)
        try:
            self._evaluator.evaluator.set_state(state.evaluator)
        except InvalidState as e:
            raise InvalidInput(f"the state is of another scenario: {e}") from e
        for name, held in self._open.free.items():
            held.set(state.free[name])
        if self._open.place is not None:
            for name, views in self._open.place.outputs.items():
                views[0][:] = state.free[f"{self._open.place.unit.name}.{name}"]
        self._given = set(state.given)
        self._judged = self._judged_signals()
        self._asked, self._seen = state.asked, state.seen

    def _check_settings(self, state: SavedState) -> None:
        """Reject the state of a session of units of the same names that is another system, or has other parameters."""
        if {*state.checkpoint.units} != {*self._open.system.units}:
            return  # which the checkpoint tells
        here, there, usual = self._settings, state.settings, "as usual"
        if other := [name for name in {**here, **there} if here.get(name) != there.get(name)]:
            values = [f"{n} was {there.get(n, usual):.40} and is {here.get(n, usual):.40}" for n in other]
            same = "open a session of the same system with the same parameters and seed"
            raise InvalidInput(
                f"the state is of a session with other settings: {', '.join(first_faults(values))}; {same}"
            )

    def close(self) -> None:
        """Terminate and free the units.

        Raises:
            UnitFailure: one did not end properly; all are freed.
        """
        self._master.__exit__(None, None, None)

    def __enter__(self) -> "Session":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._master.__exit__(kind, error, trace)

    def __repr__(self) -> str:
        """Return the time and the units."""
        return visible(f"<session at {self.time:g} s of {', '.join(self._open.system.units)}>")

    def _run(self, until: Fraction) -> float:
        was_over = self._evaluator.over
        self._master.run(until, [self._observe], until=lambda: self._evaluator.over and not was_over)
        if self._master.ended is not None:
            self._evaluator.note_end(self._master.ended.unit, self._master.ended.reached)
        self._asked = max(self._asked, Fraction(self.time)) if self._evaluator.over and not was_over else until
        return self.time

    def _observe(self, t: float, _signals: Signals) -> None:
        """Let the evaluation see a communication point once."""
        if t > self._seen:
            self._seen = t
            self._evaluator(t, self._judged)

    def _needed_outputs(self, experiment: Experiment[Any], left_out: str | None) -> set[str]:
        """Return the outputs of the unit that is left out which any unit in its place must have, or which are wired."""
        place = self._open.place
        if place is None or left_out is None:
            return set()
        if left_out not in experiment.places:  # a unit there must have all
            return {*place.ports}
        return {*place.targets, *experiment.places[left_out].required}

    def _give(self, outputs: Collection[str]) -> None:
        """Let the evaluation see outputs of the unit that is left out."""
        if not self._given.issuperset(outputs):
            self._given |= {*outputs}
            self._judged = self._judged_signals()

    def _judged_signals(self) -> Signals:
        """Return what the evaluation sees: outputs, and the inputs by which somebody may push bodies."""
        return self._all_signals(self._given, [end for push in self._pushes for end in push.inputs])

    def _all_signals(self, given: Collection[str] | None = None, inputs: Sequence[PortName] = ()) -> Signals:
        """Return the outputs of all units, those of the unit that is left out as they were set, or some of them.

        Besides, the free ones of some inputs.
        """
        ensemble, place = self._master.ensemble, self._open.place
        views = {name: {**i.y} for name, i in ensemble.instances.items()}
        ports = {name: {**u.description.outputs} for name, u in self._open.system.units.items()}
        for end in inputs:
            if str(end) in self._open.free:
                views[end.unit][end.port] = ensemble.instances[end.unit].u[end.port]
                ports[end.unit][end.port] = self._open.system.units[end.unit].description.inputs[end.port]
        if place is not None:
            shown = {name: port for name, port in place.ports.items() if given is None or name in given}
            views = {**views, place.unit.name: {name: place.outputs[name] for name in shown}}
            ports = {**ports, place.unit.name: shown}
        return Signals(views, ports, ensemble)

    def _parameter(self, unit: str, port: FmuPort) -> Any:
        instance = self._master.ensemble.instances[unit]
        buffers = self._master.call_units(lambda: instance.read([port]))
        if not buffers:
            raise KeyError(f"{unit}.{port.name} is a parameter that its unit does not give")
        return Signals({unit: buffers[0].views}, {unit: {port.name: port}}, buffers)[f"{unit}.{port.name}"]

    def _tune(self, unit: str, port: str, value: Any) -> None:
        placed, name = self._open.system.units[unit], f"{unit}.{port}"
        d = placed.description
        if port in d.inputs:
            source = self._open.system.sources_of(unit).get(port)
            raise InvalidInput(f"{name} is fed by {source}" if source else f"{name} cannot be set: see `inputs`")
        if port in d.outputs:
            raise InvalidInput(f"{name} is an output: inputs that nothing feeds and tunable parameters can be set")
        if port not in d.parameters:
            raise KeyError(f"no port {name!r}; {nearest(port, [*d.inputs, *d.parameters])}")
        if not d.parameters[port].tunable:
            raise InvalidInput(f"{name} is a fixed parameter: it is set before the start, by what builds the system")
        if placed.uses_events:
            raise InvalidInput(f"{name} can be changed in the event mode of its unit only, which steps do not enter")
        if fault := fault_of(d.parameters[port], value):
            raise InvalidInput(f"{name}: {fault}")
        self._master.call_units(lambda: self._master.ensemble.instances[unit].set_start({port: value}))


_OF_RUNS = {
    "stop": "a session has no stop time; step(seconds) goes as far as it is asked to",
    "inputs": 'a session has no table of inputs; s["unit.port"] = value sets them between steps',
    "out": "a session writes no folder; handover.run does",
}
"""Arguments of `handover.run` that `open` has not, and what is right instead."""


def open(  # noqa: A001 (handover.open is named like it)
    subject: str | Path | System | type[Experiment[Any]],
    /,
    *,
    seed: int = 0,
    place: str | None = None,
    units: Mapping[str, Path | str] | None = None,
    start: Seconds | None = None,
    step: Seconds | None = None,
    algorithm: str | Algorithm | None = None,
    isolate: str | Sequence[str] = (),
    options: MasterOptions | None = None,
    parameters: Mapping[str, Any] | None = None,
    **named: Any,
) -> Session:
    """Open a scenario, a system, an SSP or an FMU to be stepped: `with handover.open("flyer_impedance") as s:`.

    Args:
        subject: as of `handover.run`.
        seed: as of `handover.run`.
        place: a unit that is left out; its outputs are set instead, `s["unit.port"] = value`.
        units: what takes the place of a scenario's units, by their names: files of FMUs, or blocks as `my_arm:MyArm`.
        start: of a system, an SSP or an FMU: the time from which it is stepped, s, as of `handover.run`.
        step: of an SSP or FMU: the communication step of all units, s.
        algorithm: an `Algorithm`, or its value, such as `newton`.
        isolate: units in processes of their own: names, `foreign` or `all`.
        options: all options of the master; by default calls of units may take any time.
        parameters: parameters whose names are also those of options, or no names in Python.
        **named: the other parameters.

    Raises:
        InvalidInput: something of it cannot be run, with all faults and what would be right.
        UnitFailure: a unit failed as it was loaded or initialised.
    """
    with errors_for_python(named, open, _OF_RUNS), contextlib.ExitStack() as opened:
        name = str(subject) if isinstance(subject, Path) else subject
        check_subject(name)
        endless = isinstance(name, System) or (isinstance(name, str) and (is_ssp(name) or is_fmu(name)))
        request = RunRequest(
            subject=name,
            parameters=single_texts(name, merged(parameters, named)),
            seed=whole_number("seed", seed),
            units=unit_texts(units),
            start=exact_time("start", start),
            endless=endless,
            step=exact("step", step),
            options=master_options(MasterOptions() if options is None else options, algorithm, isolate),
        )
        request.check_options()
        asked = request.open(opened)
        system = request.system(asked, request.seed, request.fmus(asked.experiment))
        return Session(asked.experiment, asked.parameters, system, request.options, place)


def _settings(experiment: Experiment[Any], parameters: Any, system: System) -> dict[str, str]:
    """Return the parameters of a scenario, and of a system the FMUs, start values, and what feeds inputs, as texts.

    Seeds are left out: what is drawn is part of a unit's state.
    """
    given = ((f"{u.name}.{name}", value) for u in system.units.values() for name, value in u.start.items())
    starts = [(name, value) for name, value in given if not name.endswith(".seed")]
    of_units = {name: repr(value.tolist() if hasattr(value, "tolist") else value) for name, value in starts}
    fmus = {
        f"the FMU of {u.name}": f"{u.description.name} {u.description.token}, FMI {u.description.fmi}"
        for u in system.units.values()
    }
    wiring = {
        f"what feeds {c.target}": f"{c.source}{f' {t}' if (t := c.transformation) else ''}" for c in system.connections
    }
    given_over_time = [end for end, series in system.followed.items() if not isinstance(series, HeldValue)]
    wiring |= {f"what feeds {end}": "values over time" for end in (*given_over_time, *system.externals)}
    return {v.name: text_of(v, getattr(parameters, v.name)) for v in experiment.parameters()} | fmus | of_units | wiring


def _plain(value: Any) -> Any:
    """Return a number or a text for an array without dimensions."""
    return value.item() if hasattr(value, "shape") and not value.shape else value
