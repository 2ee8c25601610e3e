"""Estimate of the wrench on a free-flyer from its own commands and its estimated motion, without a force sensor.

Everything here is linear in thrust, momentum and wrench, and takes them as arrays of shape (6,), force before torque,
or (6, n), columns side by side: so a controller's analysis of its stability uses the same lines as its control.
"""

import math
from collections.abc import Sequence

from handover.controllers.free_flyer.sampled_loop import split_delay
from handover.cosim.blocks.ports import Floats


class ThrustModel:
    """What a propulsion with an expected delay and lag does with the commands given to it: lag y' = u(t - delay) - y.

    Args:
        lag: time constant, s; 0 if thrust follows its command without delay.
        delay: time from a command to its arrival, s.
        period: for which a command holds, s.
    """

    def __init__(self, lag: float, delay: float, period: float) -> None:
        self._lag, self._period = lag, period
        self._whole, self._part = split_delay(delay, period)
        self.remembered = self._whole + (1 if self._part > 0.0 else 0)
        """How many commands before the current one still count."""

    def over_period(self, thrust: Floats, commands: Sequence[Floats]) -> tuple[Floats, Floats]:
        """Return the thrust at the end of a period and its mean over it.

        Args:
            thrust: at its beginning.
            commands: the one given at its beginning, and the `remembered` ones before, newest first.
        """
        arriving = [(commands[self._whole], self._period - self._part)]
        if self._part > 0.0:
            arriving.insert(0, (commands[self._whole + 1], self._part))
        total = 0.0 * thrust
        for command, time in arriving:
            decay = math.exp(-time / self._lag) if self._lag > 0.0 else 0.0
            total = total + time * command + self._lag * (1.0 - decay) * (thrust - command)
            thrust = command + decay * (thrust - command)
        return thrust, total / self._period


class WrenchObserver:
    """Momentum observer: its estimate follows the wrench that thrust does not explain, as a low-pass of first order.

    With h the momentum, y the mean thrust over a period T and g = 1 - exp(-rate T), both in W and about the centre of
    mass, w[n] = w[n-1] + g ((h[n] - h[n-1]) / T - y[n-1] - w[n-1]): the error to a constant wrench decays as
    exp(-rate t). The memory q[n] = w[n] - g h[n] / T is what is known of w[n] before h[n] is measured.

    White noise of the momentum, of deviation s, reaches the estimate with about g s / T. Thrust that a model of the
    propulsion does not tell, as by limits that are not known, counts as a wrench from outside.

    Args:
        rate: of convergence, 1/s.
        period: time between two measurements, s.
    """

    def __init__(self, rate: float, period: float) -> None:
        self._gain, self._period = -math.expm1(-rate * period), period

    def begun(self, momentum: Floats) -> Floats:
        """Return the memory with which the estimate is zero at a momentum."""
        return -self._gain / self._period * momentum

    def estimate(self, memory: Floats, momentum: Floats) -> Floats:
        """Return the external wrench, N and N m, about the centre of mass."""
        return memory + self._gain / self._period * momentum

    def following(self, memory: Floats, momentum: Floats, thrust: Floats) -> Floats:
        """Return the next sample's memory, from this one's and the mean thrust until then."""
        w = self.estimate(memory, momentum)
        return self.begun(momentum) + w - self._gain * (w + thrust)
