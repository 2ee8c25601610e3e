"""Public values of the free-flyer Astrobee, the robot of [Fernandes2020], and where its gripper is assumed to be."""

import numpy as np

MASS = 9.584
"""kg"""

INERTIA = np.diag([0.1534, 0.1427, 0.1623])
"""About the centre of mass, kg m2."""

ARM = np.array([-0.30, 0.0, 0.0])
"""Gripper seen from the centre of mass, m; assumed."""
