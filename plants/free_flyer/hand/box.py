"""A box about the origin of its own frame: how far points and lines are from it, and which way is out."""

import math
from dataclasses import dataclass

from handover.cosim.blocks.plain_rotation import Vector, add_scaled, divide, lerp, norm, subtract
from handover.plants.free_flyer.hand.hand_kinematics import Segment

_SEARCHES = 20
"""How often the range in which a line's point nearest to a box lies is cut to two thirds: to 3e-4 of its length."""
_AT_END, _CLEARLY = 1e-4, 1e-12
"""Part of a line at its end, less than that search's last cut, and metres beyond rounding by which it is nearer."""


@dataclass(frozen=True)
class Box:
    """A box about the origin of its own frame; `half` are half its sides, m."""

    half: Vector

    def distance(self, p: Vector) -> float:
        """Return the signed distance of a point from the surface, below 0 inside, m; a convex function of p."""
        (x, y, z), (a, b, c) = p, self.half
        x, y, z = abs(x) - a, abs(y) - b, abs(z) - c
        if x <= 0.0 and y <= 0.0 and z <= 0.0:
            return max(x, y, z)
        x, y, z = x if x > 0.0 else 0.0, y if y > 0.0 else 0.0, z if z > 0.0 else 0.0
        return math.sqrt(x * x + y * y + z * z)

    def least_room(self, bone: Segment) -> float:
        """Return a distance than which no point of a line is nearer to the box, m; it changes by 1 a metre at most.

        It is that of the line's bounding box.
        """
        (a_x, a_y, a_z), (b_x, b_y, b_z) = bone
        x = 0.0 if a_x * b_x <= 0.0 else min(abs(a_x), abs(b_x))
        y = 0.0 if a_y * b_y <= 0.0 else min(abs(a_y), abs(b_y))
        z = 0.0 if a_z * b_z <= 0.0 else min(abs(a_z), abs(b_z))
        return self.distance((x, y, z))

    def normal(self, p: Vector) -> Vector:
        """Return the outward normal at the surface's point that is nearest to p."""
        room = subtract((abs(p[0]), abs(p[1]), abs(p[2])), self.half)
        out = [max(x, 0.0) for x in room]
        if not any(out):
            out[room.index(max(room))] = 1.0
        n = (math.copysign(out[0], p[0]), math.copysign(out[1], p[1]), math.copysign(out[2], p[2]))
        return divide(n, norm(n))

    def nearest(self, bone: Segment) -> tuple[float, Vector]:
        """Return distance and place of the point of a line that is nearest to the box, or deepest in it.

        The distance is convex along the line, so a ternary search finds it; of a line along a face, its middle. Where
        it already falls towards an end, that end is the nearest, as the search would find.
        """
        a, b = bone
        d = subtract(b, a)
        at_a, at_b = self.distance(a), self.distance(b)
        if self.distance(add_scaled(b, -_AT_END, d)) > at_b + _CLEARLY:
            return at_b, b
        if self.distance(add_scaled(a, _AT_END, d)) > at_a + _CLEARLY:
            return at_a, a
        p = lerp(a, b, self._deepest_share(a, d))
        return min(((self.distance(p), p), (at_a, a), (at_b, b)), key=lambda end: end[0])

    def _deepest_share(self, p: Vector, d: Vector) -> float:
        """Return the share s from 0 to 1 at which p + s d is nearest to the box, by a ternary search.

        An axis along which all of the line is farther inside than the box is deep along the others decides nothing.
        """
        (p_x, p_y, p_z), (d_x, d_y, d_z), (a, b, c) = p, d, self.half
        if max(abs(p_y), abs(p_y + d_y)) + _CLEARLY < b - max(a, c):
            return _deepest_share_of_two(p_x, d_x, a, p_z, d_z, c)
        low, high, root = 0.0, 1.0, math.sqrt
        for _ in range(_SEARCHES):
            third = (high - low) / 3.0
            s, t = low + third, high - third
            x, y, z = abs(p_x + s * d_x) - a, abs(p_y + s * d_y) - b, abs(p_z + s * d_z) - c
            if x <= 0.0 and y <= 0.0 and z <= 0.0:
                left = max(x, y, z)
            else:
                x, y, z = x if x > 0.0 else 0.0, y if y > 0.0 else 0.0, z if z > 0.0 else 0.0
                left = root(x * x + y * y + z * z)
            x, y, z = abs(p_x + t * d_x) - a, abs(p_y + t * d_y) - b, abs(p_z + t * d_z) - c
            if x <= 0.0 and y <= 0.0 and z <= 0.0:
                right = max(x, y, z)
            else:
                x, y, z = x if x > 0.0 else 0.0, y if y > 0.0 else 0.0, z if z > 0.0 else 0.0
                right = root(x * x + y * y + z * z)
            if left <= right:
                high = t
            if right <= left:
                low = s
        return 0.5 * (low + high)


def _deepest_share_of_two(p: float, d_p: float, a: float, q: float, d_q: float, b: float) -> float:
    """Return the same by two axes, of half sides a and b.

    The distance is written out here and above, for it is asked forty times: calls of it take twice as long.
    """
    low, high, root = 0.0, 1.0, math.sqrt
    for _ in range(_SEARCHES):
        third = (high - low) / 3.0
        s, t = low + third, high - third
        x, y = abs(p + s * d_p) - a, abs(q + s * d_q) - b
        left = (x if x > y else y) if x <= 0.0 or y <= 0.0 else root(x * x + y * y)
        x, y = abs(p + t * d_p) - a, abs(q + t * d_q) - b
        right = (x if x > y else y) if x <= 0.0 or y <= 0.0 else root(x * x + y * y)
        if left <= right:
            high = t
        if right <= left:
            low = s
    return 0.5 * (low + high)
