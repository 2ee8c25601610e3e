"""The chain of hinges against Exudyn's geometrically exact beam, at small and at large deflections."""

import importlib
import itertools
from dataclasses import replace
from typing import Any, cast

import pytest
from support.plants.beams import ONE_LINK, tip

L, EI, GA, MASS = 0.225, 0.55, 60.0, 0.14
EXTENSIBLE = 1e5
"""Stiffness of the beam along itself, N: the chain does not stretch."""


def exact_beam(load: float, elements: int = 32) -> complex:
    """Tip of a beam that is clamped level and bends and shears under its weight and a load, kg."""
    exudyn, items = (cast(Any, importlib.import_module(name)) for name in ("exudyn", "exudyn.itemInterface"))
    system, h = exudyn.SystemContainer().AddSystem(), L / elements
    nodes = [system.AddNode(items.NodeRigidBody2D(referenceCoordinates=[i * h, 0.0, 0.0])) for i in range(elements + 1)]
    stiffness = {"bendingStiffness": EI, "axialStiffness": EXTENSIBLE, "shearStiffness": GA}
    massless = {"massPerLength": 0.0, "crossSectionInertia": 0.0}
    for pair in itertools.pairwise(nodes):
        of_pair = {"nodeNumbers": list(pair), "length": h, **massless, **stiffness}
        system.AddObject(items.ObjectBeamGeometricallyExact2D(**of_pair))
    point = system.AddNode(items.NodePointGround())
    ground = system.AddMarker(items.MarkerNodeCoordinate(nodeNumber=point, coordinate=0))
    for coordinate in range(3):
        clamped = system.AddMarker(items.MarkerNodeCoordinate(nodeNumber=nodes[0], coordinate=coordinate))
        system.AddObject(items.CoordinateConstraint(markerNumbers=[ground, clamped]))
    for i, node in enumerate(nodes):
        mass = MASS / elements * (1.0 if 0 < i < elements else 0.5) + (load if i == elements else 0.0)
        at = system.AddMarker(items.MarkerNodePosition(nodeNumber=node))
        system.AddLoad(items.Force(markerNumber=at, loadVector=[0.0, -9.81 * mass, 0.0]))
    system.Assemble()
    settings: Any = exudyn.SimulationSettings()
    settings.staticSolver.numberOfLoadSteps, settings.staticSolver.verboseMode = 10, 0
    settings.staticSolver.newton.relativeTolerance = settings.staticSolver.newton.absoluteTolerance = 1e-7
    settings.solution.file.write = False
    system.SolveStatic(settings)
    x, y, _ = system.GetNodeOutput(nodes[-1], exudyn.OutputVariableType.Position)
    return complex(x, y)


@pytest.mark.parametrize(("load", "sags"), [(0.1, 0.016), (2.0, 0.155)])
def test_many_hinges_bend_like_an_exact_beam_and_six_almost(load: float, sags: float):
    params = replace(ONE_LINK, link_mass=MASS)
    exact = exact_beam(load)
    assert -exact.imag == pytest.approx(sags, rel=0.05)
    fine, six, three = (abs(tip(params, (0.0, 0.0), 0.0, load, n) - L - exact) for n in (100, 6, 3))
    assert fine < 2e-4 * sags
    assert six < 0.01 * sags
    assert 2.5 * six < three < 5.0 * six
