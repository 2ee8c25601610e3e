"""The correction on the move: center on the object while the hand goes ahead, and follow the object if it moves.

Where no finger sees an object at the pre-grasp pose, it is searched for across, row by row.
"""

import enum
import math
from typing import Any, Final

import numpy as np

from handover.controllers.ir_grasp.descent import cost, minimum_norm_step
from handover.controllers.ir_grasp.motion_filter import MotionFilter
from handover.controllers.ir_grasp.moves import X
from handover.controllers.ir_grasp.parameters import Params
from handover.controllers.ir_grasp.sensor_geometry import surface_points
from handover.controllers.ir_grasp.touch import Touch
from handover.cosim.blocks.ports import Floats

_ELLIPSE = 1.25  # half axis ahead of the searched ellipse, in `search_ahead` (assumed)


class Search:
    """A zig-zag about the pre-grasp pose: a step back, then rows across, each farther ahead, then a guess.

    The fingers look inwards: an object beside the hand is not seen, and an open hand that goes ahead pushes it. So the
    rows begin a step behind, where the fingers pass before what was moved to the side. Together they fill half an
    ellipse before the pre-grasp pose, of half axes `search_width` and 1.25 `search_ahead`, cut off at `search_ahead`.
    If nothing was seen, the hand goes where the object would be had it not been moved (`search_guess` ahead). It goes
    farther to the right: the two fingers on the left look farther ahead than the thumb, and see what the hand has
    passed.
    """

    def __init__(self, params: Params) -> None:
        self._params = p = params
        self._low = np.append(p.p_WH_pregrasp, p.yaw_pregrasp) - p.fast_reach
        self._high = np.append(p.p_WH_pregrasp, p.yaw_pregrasp) + p.fast_reach
        self._ends = [(-p.search_back, 0.0)]
        side, ahead = 1.0, -p.search_back
        while ahead <= p.search_ahead:
            share = math.sqrt(max(0.0, 1.0 - (max(ahead, 0.0) / (_ELLIPSE * p.search_ahead)) ** 2))
            left, right = float(p.search_width[0]), -float(p.search_width[1])
            ends = [(ahead, share * left), (ahead, share * right)]
            self._ends += ends if side > 0.0 else ends[::-1]
            side, ahead = -side, ahead + p.search_row
        self._ends.append((p.search_guess, 0.0))
        self._next = 0

    @property
    def over(self) -> bool:
        """Whether the last row has been searched."""
        return self._next == len(self._ends)

    def advance(self, command: X, dt: float) -> X:
        """Return the command after dt at the search's speed."""
        p = self._params
        c, s = math.cos(p.yaw_pregrasp), math.sin(p.yaw_pregrasp)
        x, y, way = command[0], command[1], p.search_speed * dt
        while way > 0.0 and not self.over:
            ahead, left = self._ends[self._next]
            corner_x = float(p.p_WH_pregrasp[0]) + c * ahead - s * left
            corner_y = float(p.p_WH_pregrasp[1]) + s * ahead + c * left
            goal_x, goal_y = np.clip([corner_x, corner_y], self._low[:2], self._high[:2]).tolist()
            away = math.hypot(goal_x - x, goal_y - y)
            if away <= way:
                x, y, way, self._next = goal_x, goal_y, way - away, self._next + 1
            else:
                x, y, way = x + way * (goal_x - x) / away, y + way * (goal_y - y) / away, 0.0
        return (*np.clip([x, y, command[2]], self._low, self._high).tolist(), command[3])

    def get_state(self) -> int:
        """Return which corner comes next."""
        return self._next

    def set_state(self, state: int) -> None:
        """Restore a state that `get_state` gave."""
        self._next = state


_DISTANCE_NOISE: Final = 2e-4  # m; of a distance, besides that of the ticks
_LEAST_FEED: Final = 0.03  # m/s; at which the hand goes ahead when it is nearly there
_STUCK: Final = (0.02, 0.1)  # m/s, of the wanted way ahead; share of it that a hand at the end of its reach makes
_EARLY_CLOSING: Final = 0.01  # m; by how much the fingers may come nearer before the object is deep enough
_PREFERENCE: Final = np.array([0.1, 1.0, 0.2, 1.0])  # of moves ahead, left, in yaw and closing, to center
_ACROSS_SPEED: Final = 0.1  # m/s; at which the hand no longer goes ahead while it goes to a side
_ONE_SIDED_CLOSING: Final = 0.3  # 1/s; once the object is deep enough and one side sees it
_EFFECT: Final = (1e-3, 2e-3)  # m; change of the offset that is an effect, and offset that needs none
"""Assumed, as the parameters are: tuned on seeds below 1000."""


class Mode(enum.IntEnum):
    """What the hand does on the move."""

    SEARCH = 0
    ONE_SIDED = 1
    TRACK = 2


class Termination(enum.IntEnum):
    """What ends the correction."""

    NONE = 0
    REACHED = 1
    SETTLED = 2
    LOST = 3
    PUSHED = 4
    USED_UP = 5
    CENTRED = 6
    CONTACT = 7
    REACH = 8


class Following:
    """u = v + u_ahead - S J_z^T (J_z J_z^T + lambda^2)^-1 (rate r + J u_ahead): eq. (9) as a rate, with feedforward.

    The residuals r = d - target of the fingers in the cost go to 0 with a rate, whatever the hand does besides: it goes
    ahead by u_ahead until the nearest point of the object that was seen, moved on with the object's velocity v, is no
    farther ahead than `depth`. J and v are estimated (`MotionFilter`).

    A finger of the cost that sees alone is kept at the distance `one_sided`, which moves the hand to its side if the
    object is near it (fig. 9). If it stays as far off while the hand goes ahead, a fingertip pushes it along: the hand
    goes back and around it. So it does where the joints feel that a fingertip meets something (`Touch`); what presses
    a finger outwards near its root is between the fingers, and the hand closes. An object that is lost is awaited
    where it was seen, then searched.

    What all sensors read in the first rounds, when the hand is far from the object, is taken for ambient light.

    Attributes:
        mode: of the last round.
        rounds: control periods with both fingers of the cost in sight.
    """

    def __init__(self, params: Params, period: float) -> None:
        self._params, self._dt = params, period
        self._calibration = params.calibration
        self._filter = MotionFilter(params, period)
        self._search = Search(params)
        self._touch = Touch(params, period)
        self._in_cost = [i for i in range(3) if params.weight[i] > 0.0]
        self._weight = params.weight[self._in_cost]
        pregrasp = np.array([*params.p_WH_pregrasp, params.yaw_pregrasp])
        self._low, self._high = pregrasp - params.fast_reach, pregrasp + params.fast_reach
        self.mode: Mode = Mode.SEARCH
        self.rounds = 0
        self._front: X = ()  # nearest point that was seen, in W
        self._off, self._beside = math.inf, 0.0
        self._before: Mode = Mode.SEARCH
        self._settled, self._lost, self._pushed, self._path = 0.0, 0.0, 0.0, 0.0
        self._saw = [False] * 3
        self._first: list[X] = []
        self._ambient = 0.0
        self._along, self._then = 0.0, math.nan  # way ahead since the distance of the side that sees was another
        self._around: list[tuple[float, float]] = []  # corners of a way around what went along, in W
        self._rounded = 0
        self._searches_ahead = False  # whether the last corner is one that sight or touch may cut short
        self._touching, self._touched = False, 0
        self._ticks_seen, self._ticks_lost = (self._calibration.ticks(y) for y in (params.epsilon, params.distance_max))

    @property
    def velocity(self) -> Floats:
        """Estimated velocity of the object, (2,) in W, in m/s."""
        return self._filter.velocity if self._front else np.zeros(2)

    @property
    def jacobian_offset(self) -> Floats:
        """Estimated d(distance)/d[ahead, left, yaw, sigma], (3, 4), less that of the hand's design."""
        return self._filter.jacobian_offset

    def without_ambient(self, ticks: X) -> X:
        """Return readings less the ambient light's."""
        return tuple(max(0.0, v - self._ambient) for v in ticks) if self._ambient else ticks

    def look(self, x: X, ticks: X) -> bool:
        """Take a round's readings; return whether any finger sees the object."""
        p = self._params
        if len(self._first) < p.ambient_rounds:
            self._first.append(ticks)
            ambient = float(np.min(np.mean(self._first, axis=0)))
            self._ambient = ambient if ambient >= p.ambient_least else 0.0
        ticks = self.without_ambient(ticks)
        distances = [self._calibration.distance(v) for v in ticks]
        # a finger that sees goes on seeing down to fewer ticks: noise at the edge of sight is no news
        self._saw = [
            v >= (self._ticks_lost if saw else self._ticks_seen) for v, saw in zip(ticks, self._saw, strict=True)
        ]
        noise = [p.tick_noise * -self._calibration.slope(v) + _DISTANCE_NOISE for v in ticks]
        self._filter.advance(x, distances, self._saw, noise)
        self._remember(x, np.array(distances))
        return any(self._saw)

    def feel(self, x: X, q: Floats, tension: float) -> bool:
        """Take the joints' encoders and the tendon's tension; return whether a finger touches something."""
        self._touch.advance(x, q, tension)
        self._touching = self._touch.touches
        return self._touching

    def _remember(self, x: X, distances: Floats) -> None:
        """Keep the seen point that is least far ahead, and let it move on with the object."""
        c, s = math.cos(x[2]), math.sin(x[2])
        if self._front:
            v = self._filter.velocity
            self._front = (self._front[0] + self._dt * float(v[0]), self._front[1] + self._dt * float(v[1]))
        points = surface_points(x[3], distances)
        for i in range(3):
            if self._saw[i] and (not self._front or points[i, 0] < self.ahead(x)):
                q = points[i]
                self._front = (x[0] + c * float(q[0]) - s * float(q[1]), x[1] + s * float(q[0]) + c * float(q[1]))

    def ahead(self, x: X) -> float:
        """Return how far ahead of the wrist the nearest point is, in m."""
        return math.cos(x[2]) * (self._front[0] - x[0]) + math.sin(x[2]) * (self._front[1] - x[1])

    def advance(self, x: X, command: X) -> tuple[X, Termination]:
        """Return the command of the coming period, and whether the correction ends here."""
        p = self._params
        if self._searches_ahead and len(self._around) == 1 and (self._touching or any(self._saw)):
            self._around = []
        if self._around:
            return self._go_around(command), Termination.NONE
        if self._touching:
            if self._is_gripped(x):
                return command, Termination.CONTACT
            if self._meets():
                self._begin_around_touched(x)
                return self._go_around(x), Termination.NONE
        if not any(self._saw) and (not self._front or self._lost > p.lost_time):
            self.mode = Mode.SEARCH
            goal = self._search.advance(command, self._dt)
            return goal, Termination.LOST if self._search.over else Termination.NONE
        left = self.ahead(x) - p.depth
        deep = left <= 0.0
        self._lost = 0.0 if any(self._saw) else self._lost + self._dt
        feed = 0.0 if deep else min(p.feed, p.rate * left + _LEAST_FEED)
        both = self._sees_both
        self.mode = Mode.TRACK if both else Mode.ONE_SIDED
        self.rounds += both
        if not both and not deep and self._goes_along(x):
            self._begin_around(x)
            return self._go_around(command), Termination.NONE
        u = self._centering(feed, deep) if both else self._one_sided(feed, deep)
        over = float(np.max(np.abs(u) / p.speed_limit))
        u = u / over if over > 1.0 else u
        top = max(p.sigma_limit if deep else p.sigma_before, command[3])
        sigma = min(max(command[3] + self._dt * float(u[3]), 0.0), top)
        v, c, s = self.velocity, math.cos(x[2]), math.sin(x[2])
        rates = np.array([c * u[0] - s * u[1] + v[0], s * u[0] + c * u[1] + v[1], u[2]])
        goal = np.clip(np.array(command[:3]) + self._dt * rates, self._low, self._high)
        made = c * (goal[0] - command[0]) + s * (goal[1] - command[1])
        stuck = float(u[0]) > _STUCK[0] and made < _STUCK[1] * self._dt * float(u[0])
        return (*goal.tolist(), sigma), self._termination(u, left, stuck)

    @property
    def _sees_both(self) -> bool:
        return all(self._saw[i] for i in self._in_cost)

    def _goes_along(self, x: X) -> bool:
        """Whether the hand goes ahead and what one side alone sees stays as far off: a fingertip pushes it.

        Pushed along its length a finger does not bend, so the tendon does not show it.
        """
        p, d = self._params, self._filter.distances
        seen = float(np.nanmin(np.where(self._saw, d, math.nan))) if any(self._saw) else math.nan
        position = math.cos(p.yaw_pregrasp) * x[0] + math.sin(p.yaw_pregrasp) * x[1]
        if not abs(seen - self._then) < p.along_change:
            self._along, self._then = position, seen
        return self._rounded < p.along_most and position - self._along > p.along_limit

    def _begin_around(self, x: X) -> None:
        """Plan the way back, then across to the side that sees it."""
        p, (c, s) = self._params, (math.cos(x[2]), math.sin(x[2]))
        side = -p.along_across if self._saw[0] else p.along_across
        back = (x[0] - c * p.along_back, x[1] - s * p.along_back)
        corners = np.clip([back, (back[0] - s * side, back[1] + c * side)], self._low[:2], self._high[:2])
        self._around = [(float(a), float(b)) for a, b in corners]
        self._rounded += 1
        self._searches_ahead = False
        self._front, self._then = (), math.nan

    def _is_gripped(self, x: X) -> bool:
        """Whether the object presses a finger outwards: near its root, or, if deep enough, seen from both sides."""
        p, place = self._params, self._touch.place
        if not (self._front and any(self._saw) and place.outwards):
            return False
        left = self.ahead(x) - p.depth
        return left < 0.0 if place.distal and self._sees_both else not place.distal and left < p.push_depth

    def _meets(self) -> bool:
        """Whether a finger meets the object with its tip or its outer side, and may still go around it."""
        place = self._touch.place
        inside = place.outwards and not place.distal
        return not (inside or self._sees_both) and self._touched < self._params.touch_most

    def _begin_around_touched(self, x: X) -> None:
        """Plan the way back, then across to the side of the finger that met it, then ahead again.

        Each time it goes back farther: what is met once more on that way is beside the finger, not before its tip.
        """
        p, (c, s) = self._params, (math.cos(x[2]), math.sin(x[2]))
        self._touched += 1
        way, side = self._touched * p.touch_back, p.touch_across if self._touch.place.finger else -p.touch_across
        corners = [(-way, 0.0), (-way, side), (way, side)]
        W = [(x[0] + c * ahead - s * left, x[1] + s * ahead + c * left) for ahead, left in corners]
        self._around = [(float(a), float(b)) for a, b in np.clip(W, self._low[:2], self._high[:2])]
        self._searches_ahead = True
        self._front, self._then = (), math.nan
        self._touch.forget()

    def _go_around(self, command: X) -> X:
        """Return the command of the coming period on that way."""
        goal, way = self._around[0], self._params.search_speed * self._dt
        away = math.dist(goal, command[:2])
        self.mode = Mode.ONE_SIDED
        if away <= way:
            self._around.pop(0)
            return (*goal, *command[2:])
        return (
            command[0] + way * (goal[0] - command[0]) / away,
            command[1] + way * (goal[1] - command[1]) / away,
            *command[2:],
        )

    def _centering(self, feed: float, deep: bool) -> Floats:
        """Return rates of [ahead, left, yaw, sigma] that bring both fingers of the cost to one distance.

        It is the target once the object is deep enough; before, nearly their mean, if that is more: fingers that close
        earlier meet the object with their tips.
        """
        p, d = self._params, self._filter.distances[self._in_cost]
        target = p.target if deep else max(p.target, float(np.mean(d)) - _EARLY_CLOSING)
        r = self._weight * (d - target)
        ahead = np.array([feed * max(0.0, 1.0 - abs(self.offset) / p.one_sided[0]), 0.0, 0.0, 0.0])
        rows = self._filter.jacobian[self._in_cost] * self._weight[:, None]
        return ahead + minimum_norm_step(rows, p.rate * r + rows @ ahead, p.scale * _PREFERENCE, p.damping)

    def _one_sided(self, feed: float, deep: bool) -> Floats:
        """Return rates that bring the hand to the side of the finger that sees the object near it (fig. 9).

        Across by `rate` times the distance that is left to `one_sided`, and the slower ahead the faster it is.
        """
        p, d = self._params, self._filter.distances
        near = p.one_sided - np.nan_to_num(d, nan=1.0)
        to_fingers, to_thumb = max(0.0, float(near[1]), float(near[2])), max(0.0, float(near[0]))
        self._beside = max(to_fingers, to_thumb)
        across = p.rate * (to_fingers - to_thumb)
        ahead = feed * max(0.0, 1.0 - abs(across) / _ACROSS_SPEED)
        return np.array([ahead, across, 0.0, _ONE_SIDED_CLOSING if deep and any(self._saw) else 0.0])

    @property
    def offset(self) -> float:
        """Half the difference of thumb's and ring's distance, in m; NaN unless both see."""
        d = self._filter.distances
        return 0.5 * float(d[0] - d[2])

    def _termination(self, u: Floats, left: float, stuck: bool) -> Termination:
        p = self._params
        self._path += self._dt * max(0.0, float(u[0]))
        if self._is_without_effect(u, left):
            return Termination.PUSHED if self._touching or not self._touch.measured else Termination.SETTLED
        if self._path > p.path_limit:
            return Termination.USED_UP
        if left > 0.0:
            return Termination.REACH if stuck else Termination.NONE
        d = self._filter.distances[self._in_cost]
        if cost(self._weight * (d - p.target)) <= p.threshold:
            return Termination.REACHED
        if abs(self.offset) <= p.balance:
            return Termination.CENTRED
        if self._lost >= p.lost_deep:
            return Termination.LOST
        self._settled += self._dt
        if self._settled < p.settling:
            return Termination.NONE
        return Termination.SETTLED if any(self._saw) else Termination.LOST

    def _is_without_effect(self, u: Floats, left: float) -> bool:
        """Whether ways across no longer change what is seen: the object goes along, or the estimate is at its end."""
        p = self._params
        off = abs(self.offset) if self.mode is Mode.TRACK else self._beside
        if left > p.push_depth or off < self._off - _EFFECT[0] or off < _EFFECT[1] or self.mode is not self._before:
            self._pushed, self._off, self._before = 0.0, off, self.mode
        else:
            self._pushed += self._dt * abs(float(u[1]))
        return self._pushed > p.push_limit

    def get_state(self) -> tuple[object, ...]:
        """Return estimates, search, what was seen, and counters."""
        modes = (int(self.mode), int(self._before), self.rounds)
        saw = (self._saw, self._front, self._beside, list(self._first), self._ambient)
        around = (self._along, self._then, list(self._around), self._rounded, self._searches_ahead)
        touch = (self._touch.get_state(), self._touched)
        counters = (self._off, self._settled, self._lost, self._pushed, self._path)
        return self._filter.get_state(), self._search.get_state(), modes, saw, counters, around, touch

    def set_state(self, state: tuple[Any, ...]) -> None:
        """Restore a state that `get_state` gave."""
        estimates, searched, (mode, before, self.rounds), saw, counters, around, (touch, self._touched) = state
        self._touch.set_state(touch)
        self._filter.set_state(estimates)
        self._search.set_state(searched)
        self.mode, self._before = Mode(mode), Mode(before)
        seen, self._front, self._beside, first, self._ambient = saw
        self._saw, self._first = list(seen), list(first)
        self._along, self._then, corners, self._rounded, self._searches_ahead = around
        self._around = list(corners)
        self._off, self._settled, self._lost, self._pushed, self._path = counters
