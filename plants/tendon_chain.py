"""The arm as a chain of rigid discs in Exudyn."""

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from handover.cosim.blocks.ports import Floats
from handover.plants.exudyn_edge import ExudynEdge
from handover.plants.tendon_design import TendonDesign
from handover.plants.tendon_tangent import TendonTangent

_DOWN = np.array([0.0, 0.0, 1.0])


class TendonChain:
    """Discs joined by constant-strain beam elements and pulled by nine tendons, in the base frame B (z down).

    It starts at rest, hanging straight.

    Args:
        design: the chain.
    """

    def __init__(self, design: TendonDesign) -> None:
        self._design = design
        self._edge = ExudynEdge(design.params.internal_step)
        bodies = [self._edge.ground] + [self._add_disc(b) for b in range(1, design.count + 1)]
        self._force = self._edge.add_force(self._edge.add_marker(bodies[-1], design.params.d_gripper * _DOWN))
        self._add_beams([self._edge.add_marker(body, 0.0 * _DOWN) for body in bodies])
        self._motors, motors = self._edge.add_motors(
            design.rest_motor, design.motor_mass, design.params.motor_frequency
        )
        self._add_tendons(bodies, motors)
        self._edge.assemble(TendonTangent(design).add)

    @property
    def edge(self) -> ExudynEdge:
        """The system in Exudyn."""
        return self._edge

    def poses(self) -> tuple[Floats, Rotation]:
        """Return the n + 1 nodes' positions, (n + 1, 3), and rotations in B; the first is the mount."""
        return self._design.poses(self._edge.coordinates[0])

    def pull(self, dl_t: Floats, f_G: Floats) -> None:
        """Command tendon length changes, (9,), in m, and set the force on the gripper in B, (3,), in N."""
        self._edge.set_motor_force(self._motors, self._design.motor_stiffness * dl_t)
        self._edge.set_force(self._force, f_G)

    def _add_disc(self, b: int) -> Any:
        design = self._design
        across, along = design.transverse_inertia[b], design.axial_inertia[b]
        return self._edge.add_body(
            design.rest_z[b] * _DOWN,
            float(design.mass[b]),
            np.array([across, across, along]),
            design.centre[b] * _DOWN,
            design.params.gravity * _DOWN,
        )

    def _add_beams(self, markers: list[Any]) -> None:
        p = self._design.params
        GA, GJ = p.shear_ratio * p.EA, p.twist_ratio * p.EI
        stiffness = np.array([GA, GA, p.EA, p.EI, p.EI, GJ])
        damped = np.array(
            [0.0, 0.0, 1.0, 1.0, 1.0, 1.0]
        )  # translational damping across would also damp turning as a whole
        for e, l0 in enumerate(self._design.natural):
            self._edge.add_beam(markers[e : e + 2], float(l0), stiffness / l0, p.damping * damped * stiffness / l0)

    def _add_tendons(self, bodies: list[Any], motors: list[Any]) -> None:
        design = self._design
        for i in range(3):
            for k in range(3):
                tendon = 3 * i + k
                self._edge.add_tendon(
                    [
                        self._edge.add_marker(body, design.holes[k])
                        for body in bodies[design.ends[i] : design.ends[i + 1] + 1]
                    ],
                    motors[tendon],
                    float(design.reference_length[tendon]),
                    float(design.tendon_EA[tendon]),
                    float(design.tendon_DA[tendon]),
                    design.params.slack_force,
                )
