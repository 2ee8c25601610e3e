"""An SSP as an experiment: it runs until its stop time, and its outputs are drawn."""

import contextlib
from collections.abc import Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any, ClassVar

from handover.cosim.exceptions import InvalidSsp
from handover.cosim.fmu.file.default_experiment import NoStep
from handover.cosim.record.reader import Record
from handover.cosim.ssp.ssp_file import SspFile
from handover.cosim.system.signals import Signals
from handover.cosim.system.system import System
from handover.scenarios.execution import supervisor
from handover.scenarios.execution.errors import UsageError
from handover.scenarios.experiment.experiment import Evaluator, Experiment, FmuOf, Outcome
from handover.scenarios.experiment.time_plot import TimeFigure
from handover.scenarios.results.run_folder import sha256_of

ENDLESS = Fraction(10**6)
"""The stop time of what has no end of its own, s: a program steps it as far as it likes."""


class UntilStop(Evaluator):
    """Lets a run continue to its stop time; it succeeds if it reaches that, or a unit ends the simulation before."""

    def __init__(self, stop: Fraction) -> None:
        self._stop, self._t, self._ended = float(stop), 0.0, False

    def __call__(self, t: float, signals: Signals) -> None:  # noqa: ARG002
        """Note the time."""
        self._t = t

    @property
    def over(self) -> bool:
        """False: a run does not end before its stop time."""
        return False

    def note_end(self, unit: str, t: float) -> None:  # noqa: ARG002
        """Note that the run has ended as it should."""
        self._ended = True

    def outcome(self) -> Outcome:
        """Return whether the stop time was reached or a unit ended the simulation."""
        reached = self._t >= self._stop
        return Outcome(
            success=reached or self._ended,
            reason=f"ran to {self._t:g} s" + ("" if reached else f" of {self._stop:g} s"),
        )


def is_ssp(name: str) -> bool:
    """Return whether a name is an SSP's file and not a scenario."""
    return Path(name).suffix.lower() == ".ssp"


def system_experiment(
    file_name: str, heading: str, system: System, stop: Fraction, step: Fraction | None = None
) -> Experiment[UntilStop]:
    """Return a system from a file as an experiment that ends at a time, s; `step` is its `parallel_step`, s."""

    class SystemExperiment(Experiment[UntilStop]):
        """Runs the system as it is."""

        name: ClassVar[str] = file_name
        title: ClassVar[str] = heading
        units: ClassVar[Mapping[str, str]] = {}
        is_seeded: ClassVar[bool] = False
        parallel_step: ClassVar[Fraction | None] = step

        def build(self, parameters: Any, seed: int, fmu: FmuOf) -> System:  # noqa: ARG002
            return system

        def stop_time(self, parameters: Any) -> Fraction:  # noqa: ARG002
            return stop

        def evaluator(self, parameters: Any) -> UntilStop:  # noqa: ARG002
            return UntilStop(stop)

        def time_figures(self, parameters: Any, record: Record) -> list[TimeFigure]:  # noqa: ARG002
            from handover.scenarios.reporting.run_figures import figures_of_outputs  # what draws takes long to load

            return figures_of_outputs(system.units, record)

    return SystemExperiment()


def open_experiment(
    path: Path,
    stop: Fraction | None,
    step: Fraction | None,
    opened: contextlib.ExitStack,
    parameters: Sequence[str] = (),
) -> Experiment[UntilStop]:
    """Open an SSP as an experiment; `opened` closes it.

    `parameters` are texts `NAME=VALUE`, see `SspFile`.

    Raises:
        InvalidSsp: see `SspFile`; where a unit has no step, it names `--step`.
        UsageError: neither the file nor the command gives a stop time, or a text is of another form.
    """
    texts = _texts_by_name(path, parameters)
    try:
        ssp = opened.enter_context(SspFile(path, step, texts, None if stop == ENDLESS else stop))
    except InvalidSsp as e:
        raise InvalidSsp(e.path, naming_step(e.faults)) from e
    supervisor.heartbeat.record_scratch_folder(str(ssp.folder))
    until = stop or ssp.stop
    if until is None:
        raise UsageError(f"{path}: its description has no stop time; --stop 10 lets it run for 10 s")
    heading = f"{ssp.name}, a system from {path.name}"
    return system_experiment(path.name, heading, ssp.system, until, None if step else ssp.parallel_step)


def _texts_by_name(path: Path, given: Sequence[str]) -> dict[str, str]:
    pairs = [tuple(part.strip() for part in text.split("=", 1)) for text in given]
    names = [pair[0] for pair in pairs]
    faults = [f"{t!r} is not of the form NAME=VALUE" for t, p in zip(given, pairs, strict=True) if len(p) < 2]
    faults += [f"{name} is given twice" for name in dict.fromkeys(names) if names.count(name) > 1]
    if faults:
        raise UsageError(f"{path}: {'; '.join(faults)}")
    return {pair[0]: pair[1] for pair in pairs}


def naming_step(faults: Sequence[str]) -> list[str]:
    """Return faults of a system, with the option that gives units a step where one has none."""
    return [f"{f}, such as by --step 0.01" if isinstance(f, NoStep) else f for f in faults]


def source_of(path: Path, stop: Fraction, step: Fraction | None, parameters: Sequence[str]) -> dict[str, Any]:
    """Return what a run's folder keeps of an SSP so that the run can be resumed: the file, times and given values."""
    times = {"stop": str(stop), "step": None if step is None else str(step)}
    given = {"parameters": list(parameters)} if parameters else {}
    return {"ssp": str(path.absolute()), "sha256": sha256_of(path), **times, **given}
