"""Actuators of the VSL arm: a link's pressure regulator with its valve, and a joint's geared servo with its current."""

import math
from typing import Any


class PressureLine:
    """Air in a link, fed through a valve that shuts the regulator off, after [Gandarias2020] sec. II.A.

    Valve open: p' = (p_cmd - p) / T. It closes when |p - p_cmd| comes to the tolerance, then p' = -p / T_leak, and it
    opens when |p - p_cmd| leaves the band. Events inside a step are located exactly, so the pressure over time does not
    depend on the steps.

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
        """Whether the valve is open."""

    def advance(self, dt: float, p_cmd: float) -> None:
        """Advance by dt with the command held, Pa."""
        while dt > 0.0:
            if self.open:
                dt = self._regulate(dt, p_cmd)
            elif abs(self.p - p_cmd) > self._band:
                self.open = True
            else:
                dt = self._leak(dt, p_cmd)

    def snapshot(self) -> tuple[Any, ...]:
        """Return the complete state, plain data."""
        return self.p, self.open

    def restore(self, snapshot: tuple[Any, ...]) -> None:
        """Restore a state of this line or of one with equal arguments."""
        self.p, self.open = snapshot

    def _regulate(self, dt: float, p_cmd: float) -> float:
        """Regulate until the tolerance is reached, at most for dt; return what is left of dt."""
        off = self.p - p_cmd
        until = self._T * math.log(max(abs(off) / self._tolerance, 1.0))
        if until > dt:
            self.p = p_cmd + off * math.exp(-dt / self._T)
            return 0.0
        self.open = False
        self.p = p_cmd + math.copysign(min(abs(off), self._tolerance), off)
        return dt - until

    def _leak(self, dt: float, p_cmd: float) -> float:
        """Leak with the valve closed until the pressure leaves the band, at most for dt; return what is left of dt."""
        lowest = p_cmd - self._band
        until = self._T_leak * math.log(max(self.p / lowest, 1.0)) if lowest > 0.0 else math.inf
        if until > dt:
            self.p *= math.exp(-dt / self._T_leak)
            return 0.0
        self.open = True
        self.p = lowest
        return dt - until


class VslServo:
    """Goes to its command at constant speed; its current carries the torque and the friction of its gear.

    i = (tau + tau_f) / kt. Friction opposes the turn: from rest it grows with the angle turned, from -f to f over
    `sliding`, and stays at f or -f while the gear slides. At rest it keeps its value, so the current gives a torque
    only to within f, depending on the direction from which the joint came.

    Args:
        angle: at which it starts, rad, with no friction.
        speed: fastest turn, rad/s.
        kt: torque by current, N m/A.
        friction: f, N m.
        sliding: turn from friction -f to f, rad.
    """

    def __init__(self, angle: float, speed: float, kt: float, friction: float, sliding: float) -> None:
        self._speed = speed
        self._kt = kt
        self._friction_max = friction
        self._rise = 2.0 * friction / sliding
        self.angle = angle
        """What the servo aims at as it moves to the command, rad."""
        self._friction = 0.0
        self._shown = angle

    def move(self, command: float, speed: float, dt: float) -> None:
        """Aim at the command, rad, nearing it at a speed, rad/s, for dt; 0 means the servo's own."""
        own = self._speed
        travel = dt * (min(abs(speed), own) if speed != 0.0 else own)
        self.angle += max(-travel, min(command - self.angle, travel))

    def rest(self, shown: float) -> None:
        """Take the gear to be at rest without friction where the encoder shows an angle, rad."""
        self._friction, self._shown = 0.0, shown

    def slide(self, shown: float) -> None:
        """Turn the gear to the angle that the encoder shows, rad."""
        f = self._friction_max
        self._friction = max(-f, min(self._friction + self._rise * (shown - self._shown), f))
        self._shown = shown

    def current(self, torque: float) -> float:
        """Return the current, A, for a torque on the joint, N m."""
        return (torque + self._friction) / self._kt

    def snapshot(self) -> tuple[Any, ...]:
        """Return the complete state, plain data."""
        return self.angle, self._friction, self._shown

    def restore(self, snapshot: tuple[Any, ...]) -> None:
        """Restore a state of this servo or of one with equal arguments."""
        self.angle, self._friction, self._shown = snapshot
