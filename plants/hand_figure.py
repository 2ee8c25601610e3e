"""What a person's hand looks like that offers a ball on its fingers."""

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.plants.limb import Limb, rod

_SKIN = (138.0, 164.0, 212.0)
_SLEEVE = (112.0, 84.0, 62.0)
_ELBOW = np.array([0.46, 0.56, -1.32])  # p_WE, m: out of the picture; the person stands opposite, to the left

# In the hand's frame at H: along the fingers, across, out of the palm; m.
_FINGERS = {
    "index": [[0.028, -0.033, 0.000], [0.056, -0.038, 0.006], [0.076, -0.038, 0.018]],
    "middle": [[0.032, -0.011, 0.000], [0.063, -0.012, 0.006], [0.085, -0.012, 0.019]],
    "ring": [[0.030, 0.011, 0.000], [0.059, 0.013, 0.006], [0.080, 0.014, 0.018]],
    "little": [[0.024, 0.031, 0.000], [0.047, 0.037, 0.005], [0.062, 0.039, 0.014]],
    "thumb": [[-0.034, -0.036, 0.000], [-0.012, -0.060, 0.006], [0.014, -0.064, 0.016]],
}


def hand(p_WH: Floats) -> list[Limb]:
    """Return the limbs of a hand with the middle of its palm at H, palm up, and of its forearm."""
    reach = p_WH - _ELBOW
    level = np.array([reach[0], reach[1], 0.0])
    forwards = level / max(float(np.linalg.norm(level)), 1e-6)
    up = np.array([0.0, 0.0, 1.0])
    R_HW = np.array([forwards, np.cross(up, forwards), up])

    def world(points: list[list[float]]) -> Floats:
        return p_WH + np.array(points) @ R_HW

    wrist = world([[-0.072, 0.0, -0.010]])[0]
    cuff = wrist + 0.11 * (_ELBOW - wrist)
    forearm = np.array([_ELBOW, _ELBOW, wrist])  # its middle lies nearer to the elbow: it ends inside the sleeve
    limbs = [Limb(forearm, np.array([0.036, 0.036, 0.024]), _SKIN), rod(_ELBOW, cuff, (0.066, 0.038), _SLEEVE)]
    for across in (-0.031, -0.011, 0.010, 0.029):
        palm = world([[-0.066, 0.45 * across, -0.008], [-0.030, across, -0.002], [0.028, across, -0.001]])
        limbs.append(Limb(palm, np.array([0.016, 0.014, 0.011]), _SKIN))
    fingers = [Limb(world(finger), np.array([0.0105, 0.0092, 0.0078]), _SKIN) for finger in _FINGERS.values()]
    return limbs + fingers
