"""How the arm's wrist follows its command."""

import math


def follow(
    error: tuple[float, float], velocity: tuple[float, float], speed: float, acceleration: float, lag: float, dt: float
) -> tuple[float, float]:
    """Return the velocity for the coming dt of a point that is to go by `error`, in m and m/s, or rad and rad/s.

    It heads for its goal with the speed min(v_max, e / lag, sqrt(a e)), e what is left to go: from full speed it brakes
    with a / 2, then with at most a, and settles exponentially. The velocity changes by at most a dt.
    """
    left = math.hypot(*error)
    wanted = min(speed, left / lag, math.sqrt(acceleration * left)) / left if left > 0.0 else 0.0
    d_x, d_y = wanted * error[0] - velocity[0], wanted * error[1] - velocity[1]
    change = math.hypot(d_x, d_y)
    share = 1.0 if change <= acceleration * dt else acceleration * dt / change
    return velocity[0] + share * d_x, velocity[1] + share * d_y
