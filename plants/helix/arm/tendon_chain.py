"""The tendon-driven arm as a chain of rigid discs in Exudyn, with the tangent of its tendons' forces.

`TendonTangent` gives Newton's method in Exudyn the exact tangent, which Exudyn itself would find by differences.
"""

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from handover.cosim.blocks.ports import Floats
from handover.plants.helix.arm.exudyn_edge import ExudynEdge
from handover.plants.helix.arm.tendon_design import TendonDesign

_I = np.eye(3)
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
        stiffness, times = self._design.section_stiffness, self._design.damping_times
        for e, l0 in enumerate(self._design.natural):
            self._edge.add_beam(markers[e : e + 2], float(l0), stiffness / l0, times * stiffness / l0)

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


class TendonTangent:
    """Derivative of tendon forces that pass through holes in discs, with respect to the discs' and motors' coordinates.

    A tendon of length L = sum |P_b+1 - P_b| through points P_b = p_b + R_b a pulls with T(f), where
    f = ((L - L0) EA + (L' - L0') DA) / L0, T = f for f > 0, else F tanh(f / F), and loads the coordinates q with
    T dL/dq. Its tangent has a part of rank one from T and a geometric part from d2L/dq2. It steers the iteration only:
    the forces themselves are Exudyn's, so an error here costs iterations, not accuracy.

    Args:
        design: the chain of discs.
    """

    def __init__(self, design: TendonDesign) -> None:
        self._design = design
        self._cross = np.swapaxes(np.cross(design.holes[:, None, :], _I), 1, 2)  # (3, 3, 3): a x, of each hole
        self._EA, self._DA = design.tendon_EA, design.tendon_DA
        self._reference = design.reference_length

    def add(self, matrix: Floats, q: Floats, q_t: Floats, scale: float, rate: float) -> None:
        """Add scale (dF/dq + rate dF/dq_t) to a matrix.

        Args:
            matrix: square, over six coordinates a disc (displacement in B, rotation in the disc), then nine motors.
            q: coordinates.
            q_t: their rates.
            scale: factor of the tangent.
            rate: derivative of the rates by the coordinates, in 1/s.
        """
        n = self._design.count
        p, rotations = self._design.poses(q)
        R = rotations.as_matrix()
        P = p[:, None, :] + self._design.holes @ np.swapaxes(R, 1, 2)
        spans = np.diff(P, axis=0)
        length = np.linalg.norm(spans, axis=2)
        u = spans / length[:, :, None]
        B = self._span_rates(R)
        dL = (u[:, :, None, :] @ B)[:, :, 0, :]  # (n, 3, 12): of a span, by the coordinates of its two nodes
        v = np.zeros((n + 1, 6))
        v[1:] = q_t[: 6 * n].reshape(n, 6)
        L_t = (dL @ np.hstack([v[:-1], v[1:]])[:, :, None])[:, :, 0]
        L0 = self._reference + q[6 * n :]
        f = ((self._sum(length) - L0) * self._EA + (self._sum(L_t) - q_t[6 * n :]) * self._DA) / L0
        limit = self._design.params.slack_force
        push = np.tanh(np.minimum(f, 0.0) / limit)
        T, slope = np.where(f > 0.0, f, limit * push), 1.0 - push**2

        G = self._gradient(dL)
        matrix += (np.transpose(G) * (scale * slope * (self._EA + rate * self._DA) / L0)) @ G
        pull = scale * T.reshape(3, 3)[self._design.segment]
        self._add_geometric(matrix, R, u, B, dL, pull, pull / length)

    def _span_rates(self, R: Floats) -> Floats:
        """Return the derivative of the spans by the coordinates of their two nodes, (n, 3 tendons, 3, 12)."""
        turning = -(R[:, None] @ self._cross)
        B = np.empty((self._design.count, 3, 3, 12))
        B[..., 0:3], B[..., 3:6] = -_I, -turning[:-1]
        B[..., 6:9], B[..., 9:12] = _I, turning[1:]
        return B

    def _sum(self, spans: Floats) -> Floats:
        """Sum over each tendon's spans: from (n, 3) to (9,)."""
        return np.add.reduceat(spans, self._design.ends[:-1], axis=0).reshape(9)

    def _gradient(self, dL: Floats) -> Floats:
        """Return the derivative of L - L0 by all coordinates, (9, 6 n + 9)."""
        n, ends = self._design.count, self._design.ends
        nodes = np.zeros((9, n + 1, 6))
        for i in range(3):
            a, b = ends[i], ends[i + 1]
            spans = np.swapaxes(dL[a:b], 0, 1)
            nodes[3 * i : 3 * i + 3, a:b] += spans[:, :, :6]
            nodes[3 * i : 3 * i + 3, a + 1 : b + 1] += spans[:, :, 6:]
        return np.hstack([nodes[:, 1:].reshape(9, 6 * n), -np.eye(9)])

    def _add_geometric(
        self, matrix: Floats, R: Floats, u: Floats, B: Floats, dL: Floats, pull: Floats, stiffness: Floats
    ) -> None:
        """Add T d2L/dq2: the spans turn (B^T (I - u u^T) B / |span|), and the holes turn with their discs."""
        n = self._design.count
        rows = B.reshape(n, 9, 12)
        blocks = (np.swapaxes(rows, 1, 2) * np.repeat(stiffness, 3, axis=1)[:, None, :]) @ rows
        blocks -= np.swapaxes(dL * stiffness[:, :, None], 1, 2) @ dL
        forces = pull[:, :, None] * u
        blocks[:, 3:6, 3:6] += self._arms(-(forces @ R[:-1]))
        blocks[:, 9:12, 9:12] += self._arms(forces @ R[1:])
        matrix[:6, :6] += blocks[0, 6:, 6:]
        for e in range(1, n):
            block = slice(6 * e - 6, 6 * e + 6)
            matrix[block, block] += blocks[e]

    def _arms(self, forces: Floats) -> Floats:
        """Return sum a x (w x .) = sum w a^T - (a . w) I over the tendons' forces w in the disc, (n, 3, 3)."""
        M = np.swapaxes(forces, 1, 2) @ self._design.holes
        return M - np.trace(M, axis1=1, axis2=2)[:, None, None] * _I
