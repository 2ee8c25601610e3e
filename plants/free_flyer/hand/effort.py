"""The effort of a person's arm that pulls or pushes, and the speed that it gets to."""

from handover.plants.hand_motion import minimum_jerk

_LENGTHENING = 1.3
"""Greatest force of an arm that is drawn back against its effort, over its force at rest (assumed)."""


class Effort:
    """Motion of the hand along an axis by an arm of mass m that exerts a force F against a load f.

        m dv/dt = F - f,  F = F_a g(v / v_0),  g(x) = min(1 - x, 1.3),

    F_a the force at rest, v_0 the speed of a hand that nothing resists: a hand that comes free is no faster than v_0.
    A single muscle's curve sags below this line (Hill), but that of a whole arm, of many muscles and joints, is close
    to straight. The rule is linearly implicit, hence stable at any step. At `length` the person stops the hand; there
    the arm's spring holds.

    Args:
        mass: m, in kg.

    Attributes:
        speed: of the hand along the axis, m/s.
        travelled: way along the axis, m.
    """

    def __init__(self, mass: float) -> None:
        self._mass = mass
        self.speed, self.travelled = 0.0, 0.0

    def begin(self) -> None:
        """Start from rest."""
        self.speed, self.travelled = 0.0, 0.0

    def advance(self, dt: float, force: float, free_speed: float, length: float, load: float) -> None:
        """Move for dt by a force at rest F_a against a load, both in N along the axis."""
        share, slope = 1.0 - self.speed / free_speed, force / free_speed
        if share > _LENGTHENING:
            share, slope = _LENGTHENING, 0.0
        self.speed += dt * (force * share - load) / (self._mass + dt * slope)
        self.travelled += dt * self.speed
        if self.travelled >= length:
            self.speed, self.travelled = 0.0, length


def force_at_rest(effort: float, clock: float, rise: float, end: float, fall: float) -> float:
    """Return F_a, N: it rises to the effort in the time `rise`, and from `end` falls to nothing in the time `fall`."""
    return effort * minimum_jerk(clock / rise) * (1.0 - minimum_jerk((clock - end) / fall))
