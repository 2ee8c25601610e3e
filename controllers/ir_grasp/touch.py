"""What touches the fingers, by their joint encoders: the torque that neither tendon nor spring nor inertia explains.

A finger that pushes an object with its tip hardly bends, so no threshold on its deflection shows it. But between
contacts a joint's torques balance, c q' + K q - r T + b a = 0, to within a fraction of what an object on a table
resists with. A finger that pushes exactly along its length, without any lever, stays unnoticed.
"""

import math
from typing import Final, NamedTuple

import numpy as np

from handover.controllers.ir_grasp.moves import X
from handover.controllers.ir_grasp.parameters import Params
from handover.cosim.blocks.ports import Floats

_COUNTS: Final = (2, 3, 3)  # phalanges of thumb, index, ring
_FINGER: Final = np.repeat(np.arange(3), _COUNTS)
_FLEXION: Final = np.array([1.0, -1.0, -1.0])[_FINGER]
_SPREAD: Final = np.array([-0.50, 0.60, 0.45])[_FINGER]
_LENGTHS: Final = np.array([0.048, 0.036, 0.044, 0.028, 0.024, 0.042, 0.027, 0.023])  # m
_PULLEYS: Final = np.array([0.010, 0.007, 0.010, 0.008, 0.006, 0.010, 0.008, 0.006])  # m
_STIFFNESS: Final = np.array([0.040, 0.040, 0.064, 0.064, 0.060, 0.040, 0.040, 0.038])  # N m/rad
_DAMPING: Final = 0.006  # N m s/rad
_MASS: Final = 0.020  # of a phalanx, kg
"""The hand's design (assumed, as the plant's), in the order of its joints: thumb 2, index 3, ring 3."""

_ALIKE: Final = _FINGER[:, None] == _FINGER
_HEADING: Final = np.tril(_ALIKE) * _FLEXION  # orientation of a phalanx, by the joints before it
_BEYOND: Final = np.array([n - 1 - k for n in _COUNTS for k in range(n)])
_LEVERS: Final = np.triu(_ALIKE) * (0.5 + _BEYOND)  # of all phalanges beyond a joint, by the links that lead to them

_START: Final = 6  # rounds in which the wrist sets off, faster than the encoders' rounds resolve (assumed)
_TIP: Final = (
    0.12  # share of the largest torque that the distal joint has at least where the distal phalanx is touched (assumed)
)


def inertia_levers(q: Floats) -> Floats:
    """Return b, (8, 2) in H, in kg m: mass times lever of what each joint carries; b a is its torque of inertia.

    Args:
        q: joint angles, (8,), in rad.
    """
    heading = _SPREAD + _HEADING @ q
    x, y = _LEVERS @ (_LENGTHS * np.cos(heading)), _LEVERS @ (_LENGTHS * np.sin(heading))
    return np.column_stack([-_MASS * _FLEXION * y, _MASS * _FLEXION * x])


class TouchedPlace(NamedTuple):
    """Which finger is touched most (0 thumb, 1 index, 2 ring), whether outwards, and whether at its last phalanx."""

    finger: int
    outwards: bool
    distal: bool


class Touch:
    """Estimates the torque of contacts on the joints, tau = c q' + K q - r T + b a, as a mean over `touch_time`.

    The terms I q'' of the phalanges and of the hand's yaw acceleration are left out.

    Positive ones bend inwards. It counts as a contact if it exceeds `touch_torque` by the share `touch_inertia` of the
    mean torque of inertia, which the wrist's encoders give less exactly. Joint angles that are all exactly 0 are taken
    for missing encoders: then nothing is felt.

    Args:
        params: of the reflex.
        period: of the encoders' readings, in s.
    """

    def __init__(self, params: Params, period: float) -> None:
        self._params, self._dt = params, period
        self._rounds = max(1, round(params.touch_time / period))
        self._age = 0
        self._last: list[tuple[X, Floats, float]] = []
        self._torques: list[tuple[Floats, Floats]] = []  # of contact, and the size of that of inertia

    @property
    def measured(self) -> bool:
        """Whether joint angles were ever read."""
        return any(np.any(q) for _, q, _ in self._last)

    @property
    def torque(self) -> Floats:
        """Mean torque of contacts, (8,), in N m; 0 until readings fill `touch_time`."""
        return self._mean(0)

    @property
    def touches(self) -> bool:
        """Whether the torque of any joint is that of a contact."""
        limit = self._params.touch_torque + self._params.touch_inertia * self._mean(1)
        return bool(np.any(np.abs(self.torque) > limit))

    @property
    def presses_outwards(self) -> bool:
        """Whether something presses a finger outwards near its root: it is between the fingers."""
        return self.touches and self.place.outwards and not self.place.distal

    @property
    def place(self) -> TouchedPlace:
        """Where the largest torque comes from."""
        torque = self.torque
        joint = int(np.argmax(np.abs(torque)))
        finger = int(_FINGER[joint])
        most, last = float(torque[joint]), float(torque[finger == _FINGER][-1])
        return TouchedPlace(finger, most < 0.0, abs(last) > _TIP * abs(most))

    def advance(self, x: X, q: Floats, tension: float) -> None:
        """Take the encoders of the wrist and the joints, (8,) in rad, and the tendon's tension in N."""
        self._last = [*self._last[-2:], (x, np.array(q), tension)]
        self._age += 1
        if self._age > _START and np.any(q):
            self._torques = [*self._torques, self._balance()][-self._rounds :]

    def forget(self) -> None:
        """Begin anew, as on a way back from what was touched."""
        self._torques = []

    def _mean(self, which: int) -> Floats:
        if len(self._torques) < self._rounds:
            return np.zeros(8)
        return np.mean([torques[which] for torques in self._torques], axis=0)

    def _balance(self) -> tuple[Floats, Floats]:
        """Return the torque that is left over, and the size of that of inertia.

        The fingers' rates lag behind the wrist's acceleration by half a round, as their own inertia and dampers make
        them.
        """
        (before, _, _), (x, q_before, T_before), (after, q_after, T_after) = self._last
        a = [(after[i] - 2.0 * x[i] + before[i]) / self._dt**2 for i in (0, 1)]
        c, s = math.cos(x[2]), math.sin(x[2])
        q, rate, T = 0.5 * (q_before + q_after), (q_after - q_before) / self._dt, 0.5 * (T_before + T_after)
        inertia = inertia_levers(q) @ np.array([c * a[0] + s * a[1], c * a[1] - s * a[0]])
        return _DAMPING * rate + _STIFFNESS * q - _PULLEYS * T + inertia, np.abs(inertia)

    def get_state(self) -> tuple[int, list[tuple[X, Floats, float]], list[tuple[Floats, Floats]]]:
        """Return its age in rounds, the last encoders, and torques."""
        return self._age, list(self._last), list(self._torques)

    def set_state(self, state: tuple[int, list[tuple[X, Floats, float]], list[tuple[Floats, Floats]]]) -> None:
        """Restore a state that `get_state` gave."""
        self._age, last, torques = state
        self._last, self._torques = list(last), list(torques)
