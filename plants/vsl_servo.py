"""A geared motor that turns a joint at a limited speed, and the current that it takes."""

import pickle


class VslServo:
    """Goes to its command at constant speed; its current carries the torque and the friction of its gear.

    i = (tau + tau_f) / kt. Friction opposes the turn: from rest it grows with the angle turned, from -f to f over
    `sliding`, and stays at f or -f while the gear slides. At rest it stays what it was, so the current tells a torque
    only to within f / kt, and which way the joint came.

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
        """What the servo aims at on its way to the command, rad."""
        self._friction = 0.0
        self._shown = angle

    def turn(self, command: float, speed: float, dt: float) -> None:
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

    def get_state(self) -> bytes:
        """Return the complete state."""
        return pickle.dumps((self.angle, self._friction, self._shown))

    def set_state(self, state: bytes) -> None:
        """Go back to a state of this servo or of one with equal arguments."""
        self.angle, self._friction, self._shown = pickle.loads(state)
