"""A scenario as an environment of Gymnasium, in which an agent takes the place of one unit.

The unit is left out. Its outputs are the action and its inputs the observation, as its FMU declares them; all other
units run as ever. The scenario's evaluation decides when an episode is over, and how it went.
"""

from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from fractions import Fraction
from typing import Any, cast

import numpy as np

try:
    import gymnasium
    from gymnasium import spaces
except ImportError as e:
    raise ImportError("handover.environment needs gymnasium: python -m pip install 'handover-cosim[gym]'") from e

from handover.cosim.blocks.variable import Kind
from handover.cosim.exceptions import UnitFailure, nearest
from handover.cosim.fmu.file.description import FmuPort
from handover.cosim.system.system import System
from handover.scenarios.api.arguments import (
    InvalidInput,
    Seconds,
    errors_for_python,
    exact,
    of_type,
    positive_seconds,
    several_texts,
    whole_number,
)
from handover.scenarios.api.open_inputs import HELD_KINDS, OpenSystem
from handover.scenarios.api.session import Session
from handover.scenarios.runs.execution.request import RunRequest

Values = dict[str, Any]
"""Values by port's name, as the spaces have them."""

_SEEDS = 2**31
"""From how many a seed is drawn where an episode is given none."""


class ScenarioEnvironment(gymnasium.Env[Values, Values]):
    """A scenario without one of its units, whose place an agent takes; `environment` makes it.

    Spaces are dictionaries by port's name: reals and integers are boxes with the declared bounds, booleans and
    enumerations are discrete. An observation beyond what the input declares is given as the bound. `reset(seed=3)` is
    the scenario's seed 3; without a seed each episode draws one. An episode terminates as the task is over or as a unit
    fails, and is truncated at the scenario's stop time; `info` then has the verdict.
    """

    metadata: dict[str, Any] = {"render_modes": []}

    def __init__(
        self, request: RunRequest, place: str, actions: Sequence[str] | None, observations: Sequence[str] | None,
        reward: Callable[[Session], float] | None, period: Seconds | None,
    ) -> None:  # fmt: skip
        of_type("place", place, str, "the name of a unit")
        if reward is not None and not callable(reward):
            raise InvalidInput(f"reward = {reward!r:.60}: expected a function of the session")
        with errors_for_python(), ExitStack() as opened:
            request.check_options()
            self._request, self._asked = request, request.open(opened)
            self._fmus = request.fmus(self._asked.experiment)
            wired = OpenSystem(self._system(0), place).place
        assert wired is not None, "a unit is left out"
        self._unit, self._reward = place, reward
        self._period = exact("period", period) or wired.unit.period
        self._sources, inputs = wired.sources, wired.unit.description.inputs
        seen = [name for name in wired.sources if inputs[name].kind in HELD_KINDS]
        self._actions = _chosen("actions", actions, [*wired.targets], wired.ports)
        wired_inputs = {name: inputs[name] for name in seen}
        self._observations = _chosen("observations", observations, seen, wired_inputs)
        self.action_space = spaces.Dict({name: space_of(p) for name, p in self._actions.items()})
        self._seen_in = {name: space_of(p) for name, p in self._observations.items()}
        self.observation_space = spaces.Dict(self._seen_in)
        self.session: Session | None = None
        """The running episode, for looking at any signal; None before the first `reset`."""
        self._last: Values = {}
        self._left = Fraction(0)
        """Until the scenario's stop time, s; not above 0 for who steps on beyond it."""

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Values, Values]:
        """Begin an episode; return the observation at 0 s and information.

        Raises:
            InvalidInput: `options` has some; there are none.
            UnitFailure: a unit did not start.
        """
        if options:
            raise InvalidInput(
                f"options = {options!r:.60}: an episode has none; parameters are those of the environment"
            )
        super().reset(seed=seed, options=options)
        drawn = int(self.np_random.integers(_SEEDS)) if seed is None else whole_number("seed", seed)
        self.close()
        with errors_for_python():
            system = self._system(drawn)
            experiment, parameters = self._asked.experiment, self._asked.parameters
            self.session = Session(experiment, parameters, system, self._request.options, self._unit, [*self._actions])
        self._left = positive_seconds("stop", self.session.stop)
        self.session.start()
        self._last = self._observed(self.session)
        return self._last, {"time": self.session.time, "seed": drawn}

    def step(self, action: Values) -> tuple[Values, float, bool, bool, Values]:
        """Set the outputs of the place, step on by a period; return observation, reward, and whether it has ended.

        The last period is shorter where the scenario's stop time is within it.

        Raises:
            InvalidInput: the action is not one of the space.
            RuntimeError: there is no running episode.
        """
        session = self.session
        if session is None:
            raise RuntimeError("there is no episode: call reset first")
        if not isinstance(action, Mapping):  # type: ignore
            raise InvalidInput(f"action = {action!r}: expected a mapping, with {', '.join(self._actions)}")
        if missing := [name for name in self._actions if name not in action]:
            raise InvalidInput(f"the action has no {', '.join(missing)}")
        for name, port in self._actions.items():
            session[f"{self._unit}.{name}"] = bool(action[name]) if _is_flag(port) else action[name]
        try:
            duration = min(self._period, self._left) if self._left > 0 else self._period
            self._left -= duration
            session.step(duration)
        except UnitFailure as e:
            self.close()
            return self._last, 0.0, True, False, {"time": session.time, "success": False, "reason": str(e)}
        self._last = self._observed(session)
        terminated, truncated = session.over, not session.over and session.time >= session.stop
        info: Values = {"time": session.time}
        reward = 0.0 if self._reward is None else float(self._reward(session))
        if terminated or truncated:
            outcome = session.outcome
            metrics = {name: metric.value for name, metric in outcome.metrics.items()}
            info |= {"success": outcome.success, "reason": outcome.reason, "metrics": metrics}
            reward = float(outcome.success) if self._reward is None else reward
        return self._last, reward, terminated, truncated, info

    def close(self) -> None:
        """End the episode and free its units."""
        session, self.session = self.session, None
        if session is not None:
            session.close()

    def _system(self, seed: int) -> System:
        return self._request.system(self._asked, seed, self._fmus)

    def _observed(self, session: Session) -> Values:
        """Return what feeds the inputs of the place, in their units."""
        seen: Values = {}
        for name, port in self._observations.items():
            source, change = self._sources[name]
            value = np.asarray(session[str(source)])
            if change is not None:
                value = value * change.factor + change.offset
            seen[name] = _observation(port, value, self._seen_in[name])
        return seen


def space_of(port: FmuPort) -> "spaces.Space[Any]":
    """Return the space of a port's values, by its declared kind, shape and bounds."""
    if port.kind is Kind.BOOLEAN:
        return spaces.MultiBinary(port.shape) if port.shape else spaces.Discrete(2)
    values = sorted(value for _, value in port.items)
    if values and not port.shape and values == list(range(values[0], values[-1] + 1)):
        return spaces.Discrete(len(values), start=values[0])
    kind: Any = np.float64 if port.kind is Kind.REAL else np.int64
    limits = (-np.inf, np.inf) if port.kind is Kind.REAL else (np.iinfo(kind).min, np.iinfo(kind).max)
    low = limits[0] if port.minimum is None else port.minimum
    high = limits[1] if port.maximum is None else port.maximum
    return spaces.Box(np.full(port.shape, low, kind), np.full(port.shape, high, kind), port.shape, kind)


def _observation(port: FmuPort, value: Any, space: Any) -> Any:
    if isinstance(space, spaces.Discrete):
        return np.int64(value)
    if isinstance(space, spaces.Box):
        box = cast(Any, space)
        return np.array(np.clip(value, box.low, box.high), dtype=box.dtype)
    return value.astype(np.int8).reshape(port.shape)


def _is_flag(port: FmuPort) -> bool:
    return port.kind is Kind.BOOLEAN and not port.shape


def _chosen(
    what: str, names: Sequence[str] | None, default: Sequence[str], ports: Mapping[str, FmuPort]
) -> dict[str, FmuPort]:
    """Return the ports that an agent sets or sees.

    Raises:
        InvalidInput: there are none, or some are unknown.
    """
    chosen = default if names is None else several_texts(what, names)
    if unknown := [name for name in chosen if name not in ports]:
        raise InvalidInput(f"{what}: {'; '.join(f'{n!r}, {nearest(n, ports)}' for n in unknown)}")
    if not chosen:
        raise InvalidInput(f"{what}: there are none" + (f"; {nearest('', ports)}" if ports else ""))
    return {name: ports[name] for name in chosen}
