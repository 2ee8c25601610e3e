"""Runs a system of FMUs: checks it, loads it, and takes it from one communication point to the next."""

import array
from collections.abc import Callable, Sequence
from fractions import Fraction
from types import TracebackType

from cosim.coupling import Coupling
from cosim.ensemble import Ensemble
from cosim.exceptions import UnitFailure, UnitRefused
from cosim.extrapolation import Extrapolation
from cosim.gauss_seidel import GaussSeidel
from cosim.grid_stepper import GridStepper
from cosim.jacobi import Jacobi
from cosim.master_options import Algorithm, MasterOptions
from cosim.schedule import Schedule
from cosim.signals import Signals
from cosim.stepper import Stepper
from cosim.system import System

_PLAIN = MasterOptions()

Observer = Callable[[float, Signals], None]
"""Called at every communication point with the time and the signals that hold at that time."""


def never() -> bool:
    """Let a run go on to its stop time."""
    return False


class Master:
    """Co-simulates a system of FMUs, each unit at its own rate. Use as a context manager.

    Entering loads and initialises the units; `run` steps them; leaving terminates and frees them, whatever happened.

    Raises:
        WiringError: the system has faults. InvalidFmu: an FMU cannot be used. ScheduleError: see `Schedule`.
        UnitRefused: a unit did not accept its parameters or did not initialise.
    """

    def __init__(self, system: System, options: MasterOptions = _PLAIN) -> None:
        system.check()
        self.system = system
        self.options = options
        self.schedule = Schedule(system)
        self._ensemble: Ensemble | None = None
        self._stepper: Stepper | None = None

    def __enter__(self) -> "Master":
        ensemble = Ensemble(self.system)
        try:
            ensemble.initialize(self.schedule.slots)
            if self.options.extrapolation is Extrapolation.LINEAR:
                ensemble.extrapolate(self.schedule.tick)
            self._stepper = GridStepper(self.schedule, self._coupling(ensemble), ensemble.lines)
        except UnitFailure as e:
            ensemble.close()
            raise UnitRefused(e) from e
        except BaseException:
            ensemble.close()
            raise
        self._ensemble = ensemble
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.ensemble.close()

    @property
    def ensemble(self) -> Ensemble:
        """The loaded units; there are none before the master is entered."""
        if self._ensemble is None:
            raise RuntimeError("enter the master first: `with Master(system) as master:`")
        return self._ensemble

    @property
    def stepper(self) -> Stepper:
        """What moves the units through time; there is none before the master is entered."""
        if self._stepper is None:
            raise RuntimeError("enter the master first: `with Master(system) as master:`")
        return self._stepper

    @property
    def time(self) -> float:
        """Simulated time in seconds."""
        return 0.0 if self._stepper is None else self._stepper.time

    @property
    def cpu(self) -> "dict[str, array.array[float]]":
        """CPU seconds of every step, by unit; with Gauss-Seidel, setting inputs and getting outputs included."""
        return self.ensemble.cpu

    @property
    def signals(self) -> Signals:
        """The units' outputs as they are."""
        return self.ensemble.signals()

    def run(self, stop: Fraction, observers: Sequence[Observer] = (), until: Callable[[], bool] = never) -> None:
        """Step until `stop` seconds, or until `until()` says so after the observers have seen a communication point.

        Gauss-Seidel: at a communication point t, sampled units act on the values at t, then the observers see all
        signals at t, then the other units go on from t. Jacobi: a step's results count from the time where it ends, for
        sampled units too. A second call goes on where the first one ended.

        Raises:
            UnitFailure: a unit's call failed; what observers saw before stays.
        """
        signals = self.signals
        last = self.schedule.ticks(stop)
        while True:
            ended = self.stepper.arrive(last)
            for observe in observers:
                observe(self.stepper.time, signals)
            if ended or until():
                break
            self.stepper.depart()

    def _coupling(self, ensemble: Ensemble) -> Coupling:
        kinds = {Algorithm.JACOBI: Jacobi, Algorithm.GAUSS_SEIDEL: GaussSeidel}
        return kinds[self.options.algorithm](ensemble)
