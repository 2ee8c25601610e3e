"""Typed interface to Exudyn: a system of rigid bodies, elastic joints and tendons, advanced in steps."""

import contextlib
import importlib.util
import io
import os
import weakref
from collections.abc import Callable, Generator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.plants.helix.arm.empty_library import bound_at_first_call, can_be_empty, can_be_loaded, load_empty
from handover.plants.helix.arm.tendon_ports import SolverFailure

_NO_SETTINGS = "EXUDYN_NO_USER_SETTINGS"


def _load() -> tuple[Any, Any]:
    """Import Exudyn so that it prints nothing and takes no settings from the user's home."""
    kept = os.environ.get(_NO_SETTINGS)
    os.environ[_NO_SETTINGS] = "1"
    try:
        with contextlib.redirect_stdout(io.StringIO()), _drawing_nothing():
            import exudyn
            import exudyn.itemInterface as items
    finally:
        del os.environ[_NO_SETTINGS]
        if kept is not None:
            os.environ[_NO_SETTINGS] = kept
    module: Any = exudyn
    module.config.printToConsole = False
    return module, items


@contextlib.contextmanager
def _drawing_nothing() -> Generator[None]:
    """Let Exudyn be imported where OpenGL or X11 are missing, as on machines without a screen.

    Its wheel for Linux is linked to OpenGL and, by the GLFW that it brings, to X11. Only windows call them, which are
    never opened here. A library that is there is taken as it is: a host may draw with it.
    """
    wanted = {"libGL.so.1": ["libGL.so.1"], "libX11.so.6": _glfw()}
    empty = [name for library, names in wanted.items() if not can_be_loaded(library) for name in names]
    if not (empty and can_be_empty()):
        yield
        return
    for name in empty:
        load_empty(name)
    with bound_at_first_call():
        yield


def _glfw() -> list[str]:
    """Return the names of GLFW libraries in Exudyn's wheel; they are unlike from one version to the next.

    Where Exudyn is frozen with a unit, they lie beside its folder.
    """
    package = importlib.util.find_spec("exudyn")
    beside = Path(package.origin or "").parent.parent if package else Path()
    return sorted(file.name for folder in (beside / "exudyn.libs", beside) for file in folder.glob("libglfw*"))


_exu, _items = _load()

TangentTerm = Callable[[Floats, Floats, Floats, float, float], None]
"""Adds scale (dF/dq + rate dF/dq_t) of the tendons' forces to a matrix: called with matrix, q, q_t, scale, rate."""


class ExudynEdge:
    """A multibody system in Exudyn, integrated by the generalized-alpha method (spectral radius 0.9).

    Items are added, then `assemble` is called once, then `advance` and the state may be used. Markers, bodies and so on
    are Exudyn's item numbers. Exudyn differentiates a tendon's forces numerically by every coordinate that it touches,
    which would take most of the time of a step, so `assemble` takes a function that knows their tangent.
    """

    def __init__(self, internal_step: float) -> None:
        self._container = _exu.SystemContainer()  # owns the system
        self._mbs = self._container.AddSystem()
        self._ground = self._mbs.AddObject(_items.ObjectGround())
        origin = self._mbs.AddNode(_items.NodePointGround())
        self._fixed = self._mbs.AddMarker(_items.MarkerNodeCoordinate(nodeNumber=origin, coordinate=0))
        self._tendons: list[Any] = []
        self._solver = _exu.MainSolverImplicitSecondOrder()
        self._settings = _settings(internal_step)
        self._internal_step = internal_step

    @property
    def ground(self) -> Any:
        """The fixed body, at the origin."""
        return self._ground

    def add_body(self, position: Floats, mass: float, inertia: Floats, centre: Floats, gravity: Floats) -> Any:
        """Add a rigid body and return it.

        Args:
            position: of the body's origin at the start, unrotated.
            mass: in kg.
            inertia: principal moments about the body's origin, (3,), in kg m2.
            centre: centre of mass, in the body.
            gravity: acceleration, (3,), in m/s2.
        """
        start = [*position, 0.0, 0.0, 0.0]
        node = self._mbs.AddNode(_items.NodeRigidBodyRotVecLG(referenceCoordinates=start, initialVelocities=[0.0] * 6))
        moments = [*inertia, 0.0, 0.0, 0.0]
        body = self._mbs.AddObject(
            _items.ObjectRigidBody(mass=mass, inertia=moments, centerOfMass=centre, nodeNumber=node)
        )
        marker = self._mbs.AddMarker(_items.MarkerBodyMass(bodyNumber=body))
        self._mbs.AddLoad(_items.LoadMassProportional(markerNumber=marker, loadVector=gravity))
        return body

    def add_marker(self, body: Any, position: Floats) -> Any:
        """Add a marker at a position in a body and return it."""
        return self._mbs.AddMarker(_items.MarkerBodyRigid(bodyNumber=body, localPosition=position))

    def add_force(self, marker: Any) -> Any:
        """Add a force at a marker, 0 so far, and return it."""
        return self._mbs.AddLoad(_items.LoadForceVector(markerNumber=marker, loadVector=[0.0, 0.0, 0.0]))

    def add_beam(self, markers: Sequence[Any], length: float, stiffness: Floats, damping: Floats) -> None:
        """Join two markers by a beam element of constant strain, straight along z.

        Args:
            markers: of the ends.
            length: natural length, in m.
            stiffness: diagonal, three of translation (N/m), three of rotation (N m), (6,).
            damping: likewise, (6,).
        """
        self._mbs.AddObject(
            _items.ObjectConnectorRigidBodySpringDamper(
                markerNumbers=list(markers),
                stiffness=np.diag(stiffness),
                damping=np.diag(damping),
                offset=[0.0, 0.0, length, 0.0, 0.0, 0.0],
                useIntrinsicFormulation=True,
            )
        )

    def add_motors(self, start: Floats, mass: float, frequency: float) -> tuple[Any, list[Any]]:
        """Add critically damped motors, each with one coordinate, and return the group and the coordinates' markers."""
        n, omega = len(start), 2.0 * np.pi * frequency
        node = self._mbs.AddNode(
            _items.NodeGenericODE2(
                referenceCoordinates=[0.0] * n,
                initialCoordinates=start,
                initialCoordinates_t=[0.0] * n,
                numberOfODE2Coordinates=n,
            )
        )
        motors = self._mbs.AddObject(
            _items.ObjectGenericODE2(
                nodeNumbers=[node],
                massMatrix=mass * np.eye(n),
                stiffnessMatrix=mass * omega**2 * np.eye(n),
                dampingMatrix=2.0 * mass * omega * np.eye(n),
                forceVector=np.zeros(n),
            )
        )
        markers = [self._mbs.AddMarker(_items.MarkerNodeCoordinate(nodeNumber=node, coordinate=i)) for i in range(n)]
        return motors, markers

    def add_tendon(
        self, markers: Sequence[Any], motor: Any, length: float, EA: float, DA: float, slack_force: float
    ) -> None:
        """Lead a tendon through markers; its natural length is `length` plus the motor's coordinate."""
        axes = _exu.Vector3DList()  # of sheaves, which have no radius here
        for _ in markers:
            axes.Append([1.0, 0.0, 0.0])
        tendon = self._mbs.AddObject(
            _items.ObjectConnectorReevingSystemSprings(
                markerNumbers=[*markers, motor, self._fixed],
                hasCoordinateMarkers=True,
                coordinateFactors=[1.0, 0.0],
                stiffnessPerLength=EA,
                dampingPerLength=DA,
                regularizationForce=slack_force,
                referenceLength=length,
                sheavesAxes=axes,
                sheavesRadii=[0.0] * len(markers),
            )
        )
        self._tendons.append(tendon)

    def assemble(self, add_tangent: TangentTerm) -> None:
        """Finish the system; `add_tangent` gives the tangent of all tendons."""
        method = weakref.WeakMethod(self._compute_jacobian)  # Exudyn keeps the function, which must not keep Exudyn's

        def compute_jacobian(solver: Any, mbs: Any, settings: Any) -> bool:  # noqa: ARG001
            compute = method()
            if compute is not None:
                compute(add_tangent)
            return compute is not None

        self._mbs.Assemble()
        self._solver.InitializeSolver(self._mbs, self._settings)
        self._solver.SetUserFunctionComputeNewtonJacobian(self._mbs, compute_jacobian)

    def set_force(self, force: Any, value: Floats) -> None:
        """Set a force, (3,), in N."""
        self._mbs.SetLoadParameter(force, "loadVector", value)

    def set_motor_force(self, motors: Any, value: Floats) -> None:
        """Set the forces on a group of motors, in N."""
        self._mbs.SetObjectParameter(motors, "forceVector", value)

    @property
    def coordinates(self) -> tuple[Floats, Floats]:
        """Coordinates of bodies and motors in the order in which they were added, and their rates."""
        data = self._mbs.systemData
        return data.GetODE2Coordinates(), data.GetODE2Coordinates_t()

    @property
    def tensions(self) -> Floats:
        """Forces in the tendons, in N."""
        kind = _exu.OutputVariableType.ForceLocal
        return np.array([self._mbs.GetObjectOutput(tendon, kind) for tendon in self._tendons], dtype=np.float64)

    def get_state(self) -> list[Floats]:
        """Return the complete state; accelerations follow from it."""
        return [np.array(part) for part in self._mbs.systemData.GetSystemState()]

    def set_state(self, state: Sequence[Floats]) -> None:
        """Restore a state of this or an equal system."""
        data = self._mbs.systemData
        data.SetSystemState(list(state), configuration=_exu.ConfigurationType.Initial)
        data.SetSystemState(list(state), configuration=_exu.ConfigurationType.Current)

    def advance(self, t: float, steps: int) -> None:
        """Advance by internal steps; only the report of a failure uses the start t, in s.

        Raises:
            SolverFailure: there is no solution; the state is as before.
        """
        before = self.get_state()
        timing = self._settings.timeIntegration
        timing.startTime, timing.endTime, timing.numberOfSteps = 0.0, steps * self._internal_step, steps
        reason = "Newton's method does not converge"
        try:
            self._solver.InitializeSolverInitialConditions(self._mbs, self._settings)
            solved = self._solver.SolveSteps(self._mbs, self._settings)
        except (RuntimeError, ValueError) as error:
            solved, reason = False, str(error).strip()
        after = self.get_state()
        if not solved or not all(np.all(np.isfinite(part)) for part in after):
            self.set_state(before)
            raise SolverFailure("TendonArm", t + self._solver.it.currentTime, f"Exudyn: {reason}")
        self.set_state(after)

    def _compute_jacobian(self, add_tangent: TangentTerm) -> None:
        """Set Newton's matrix, beta h^2 (beta' M + K + gamma' D): Exudyn's own but for the tendons' tangent."""
        solver, h = self._solver, self._solver.it.currentStepSize
        scale = solver.newmarkBeta * h**2
        rate = solver.newmarkGamma / (solver.newmarkBeta * h)
        self._activate_tendons(False)
        try:
            solver.ComputeJacobianODE2RHS(self._mbs, -scale, -rate * scale, -scale)
        finally:
            self._activate_tendons(True)
        matrix = np.array(solver.GetSystemJacobian(), dtype=np.float64)
        matrix += (1.0 - solver.alphaM) / (1.0 - solver.alphaF) * solver.GetSystemMassMatrix()
        add_tangent(matrix, *self.coordinates, scale, rate)
        solver.SetSystemJacobian(matrix)

    def _activate_tendons(self, active: bool) -> None:
        for tendon in self._tendons:
            self._mbs.SetObjectParameter(tendon, "activeConnector", active)


def _settings(internal_step: float) -> Any:
    """Return the solver's settings: no files, no console, one thread, Newton's matrix kept while it contracts."""
    settings = _exu.SimulationSettings()
    settings.solution.file.write = False
    settings.solution.sensors.active = False
    settings.show.computationTime = False
    settings.show.statistics = False
    settings.parallel.numberOfThreads = 1
    settings.linearSolver.solverType = _exu.LinearSolverType.EigenSparse
    timing = settings.timeIntegration
    timing.verboseMode = 0
    timing.minimumStepSize = internal_step / 64.0
    timing.newton.useModifiedNewton = True
    timing.newton.absoluteTolerance = 1e-6  # N; a resting arm's residual does not fall much below
    timing.generalizedAlpha.spectralRadius = 0.9
    timing.generalizedAlpha.computeInitialAccelerations = True  # without it, first order
    timing.generalizedAlpha.lieGroupAddTangentOperator = False  # rotations within a step are small
    return settings
