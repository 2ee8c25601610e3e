"""A pressure regulator with a valve behind it, which closes when the pressure is reached."""

import math
import pickle


class PressureLine:
    """Air in a link, fed through a valve that shuts the regulator off, after [Gandarias2020] sec. II.A.

    Valve open: p' = (p_cmd - p) / T. It closes when |p - p_cmd| comes to the tolerance, then p' = -p / T_leak, and it
    opens when |p - p_cmd| leaves the band. Events inside a step are met where they happen, so the course of the
    pressure does not depend on the steps.

    Args:
        p: pressure at the start, Pa, with the valve closed.
        regulator_time: T, s.
        leak_time: T_leak, s.
        tolerance: deviation at which the valve closes, Pa.
        band: deviation at which it opens, Pa; more than the tolerance.
    """

    def __init__(self, p: float, regulator_time: float, leak_time: float, tolerance: float, band: float) -> None:
        self._T, self._T_leak = regulator_time, leak_time
        self._tolerance, self._band = tolerance, band
        self.p = p
        """Pressure, Pa."""
        self.open = False
        """Whether the valve is."""

    def advance(self, dt: float, p_cmd: float) -> None:
        """Advance by dt with the command held, Pa."""
        while dt > 0.0:
            if self.open:
                dt = self._regulate(dt, p_cmd)
            elif abs(self.p - p_cmd) > self._band:
                self.open = True
            else:
                dt = self._leak(dt, p_cmd)

    def get_state(self) -> bytes:
        """Return the complete state."""
        return pickle.dumps((self.p, self.open))

    def set_state(self, state: bytes) -> None:
        """Go back to a state of this line or of one with equal arguments."""
        self.p, self.open = pickle.loads(state)

    def _regulate(self, dt: float, p_cmd: float) -> float:
        """Let air through until the tolerance is reached, dt at most; return what is left of dt."""
        off = self.p - p_cmd
        until = self._T * math.log(max(abs(off) / self._tolerance, 1.0))
        if until > dt:
            self.p = p_cmd + off * math.exp(-dt / self._T)
            return 0.0
        self.open = False
        self.p = p_cmd + math.copysign(min(abs(off), self._tolerance), off)
        return dt - until

    def _leak(self, dt: float, p_cmd: float) -> float:
        """Hold the air until the pressure falls out of the band, dt at most; return what is left of dt."""
        lowest = p_cmd - self._band
        until = self._T_leak * math.log(self.p / lowest) if self.p > lowest > 0.0 else math.inf
        if until > dt:
            self.p *= math.exp(-dt / self._T_leak)
            return 0.0
        self.open = True
        self.p = lowest
        return dt - until
