"""Sensors of the VSL arm: their noise, their resolution, and the accelerometers at the links' ends."""

import cmath
import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.plants.vsl.chain import Complexes, Pose
from handover.plants.vsl.parameters import Params

_MAX_LINKS = 3


def quantized(value: float, step: float) -> float:
    """Return the nearest whole multiple of a step, as a converter does; the value itself if the step is 0."""
    return step * round(value / step) if step else value


def _three(values: Sequence[float]) -> Floats:
    """Return three values, 0 in place of those that are missing."""
    return np.array((*values, 0.0, 0.0)[:3])


class Readings(NamedTuple):
    """What the computer and the tracker read: angles, rad, currents, A, pressures of three links, Pa, the tip, m."""

    q: Floats
    i: Floats
    p: Floats
    p_WG: Floats


class Sensors:
    """Adds white Gaussian noise, drawn once a step, to what is measured; then rounds it to what a sensor resolves.

    Of a joint or link that is not there 0 is read. A stepper motor at the base has no sensors: its counted steps are
    exact, and its driver tells no current.

    An accelerometer at a link's end feels f = a + g in the arm's plane, a its acceleration and g upwards, along the
    link and across it: its tilt = atan2(f_along, f_across) is the link's inclination where it is at rest.

    Args:
        params: of the arm.
        places: of the accelerometers: on which body of the chain, and where along it, from 0 to 1.
    """

    def __init__(self, params: Params, places: Sequence[tuple[int, float]]) -> None:
        self._params = params
        self._places = places
        self._sigma = np.repeat(
            [params.servo_noise, params.current_noise, params.tracker_noise, params.pressure_noise], [3, 3, 3, 2]
        )
        if params.links == 1:
            self._sigma[[2, 5, 10]] = 0.0
        if params.base_step:
            self._sigma[[0, 3]] = 0.0
        self._sigma_4 = params.pressure_noise if params.links == _MAX_LINKS else 0.0
        self._rng = np.random.default_rng(params.seed)
        # accelerometers and the third link have a stream of their own: what the others read does not depend on them
        self._rng_more = np.random.default_rng((params.seed, 1))
        self.draw()

    def draw(self) -> None:
        """Draw the noise of the next readings."""
        self._noise = self._rng.standard_normal(11)
        self._noise_more = self._rng_more.standard_normal(1 + 2 * _MAX_LINKS)

    def read(self, q: Sequence[float], i: Sequence[float], p: Sequence[float], p_WG: Floats) -> Readings:
        """Return what is read of angles, currents, pressures and the tip, of which all but the last may be fewer."""
        P = self._params
        noise = self._sigma * self._noise
        q_meas, p_meas = _three(q) + noise[:3], _three(p)
        p_meas[:2] += noise[9:]
        if self._sigma_4:
            p_meas[2] += self._sigma_4 * self._noise_more[0]
        if P.encoder_step:
            counted = 1 if P.base_step else 0
            q_meas[counted:] = [quantized(x, P.encoder_step) for x in q_meas[counted:].tolist()]
        if P.transducer_step:
            p_meas = np.array([quantized(x, P.transducer_step) for x in p_meas.tolist()])
        return Readings(q_meas, _three(i) + noise[3:6], p_meas, p_WG + noise[6:9])

    def tilts(self, pose: Pose, acceleration: Complexes | None) -> list[float]:
        """Return the inclinations of three links by their accelerometers, rad.

        Args:
            pose: of the chain.
            acceleration: of the ends of its bodies and of the shoulder, which comes first, (n + 1,), in m/s2; None: 0.
        """
        P = self._params
        angles = pose.angles.tolist()
        noise = (P.imu_noise * self._noise_more[1:]).tolist()
        tilts = [0.0] * _MAX_LINKS
        for link, (body, along) in enumerate(self._places):
            f = complex(0.0, P.gravity)
            if acceleration is not None:
                f += complex((1.0 - along) * acceleration[body] + along * acceleration[body + 1])
            f *= cmath.rect(1.0, -angles[body])
            tilts[link] = math.atan2(f.real + noise[2 * link], f.imag + noise[2 * link + 1])
        return tilts

    def get_state(self) -> tuple[Any, ...]:
        """Return the state, plain data."""
        return self._rng.bit_generator, self._noise, self._rng_more.bit_generator, self._noise_more

    def set_state(self, state: tuple[Any, ...]) -> None:
        """Restore a state of these sensors or of ones with equal parameters."""
        self._rng.bit_generator.state, self._noise, self._rng_more.bit_generator.state, self._noise_more = state
