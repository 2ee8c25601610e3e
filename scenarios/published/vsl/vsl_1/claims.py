"""Claims of [Gandarias2020] sec. V-C on experiment 1, judged in every cell of fig. 5 on the runs of `vsl-1`."""

from collections.abc import Sequence
from itertools import pairwise

from handover.controllers.vsl.paths import Path as TipPath
from handover.scenarios.published.published_experiment import Claim
from handover.scenarios.published.verdicts import without_verdict
from handover.scenarios.published.vsl.separation import Comparison, separation_claim
from handover.scenarios.published.vsl.vsl_1.runs import PATHS, RIGID, Cell, Links, Vsl1Runs, format_load

_WHERE = "sec. V-C, fig. 5"

_BY_SPRINGS = (
    "An arm of springs sags the more the more it carries, whatever its stiffness, and the stiffness was chosen for "
    "errors about as in fig. 5, so agreement proves nothing."
)
_BY_LEVER = (
    "Its own weight and its load bend an arm of springs the more the farther it reaches out, whatever its stiffness, "
    "so agreement proves nothing."
)
_BY_CHOICE = (
    "How much stiffer pressure makes a link was chosen so that errors fall with it about as in fig. 5, so agreement "
    "proves nothing."
)
_RIGID_BY_CHOICE = (
    "The stiffness of rigid links and of joints was chosen so that the rigid arm has errors of some millimetres, as in "
    "fig. 5, so agreement proves nothing."
)
_SERVO_BY_CHOICE = (
    "How far a servo yields under load was chosen so that the servo's path is near the desired one, as in fig. 5, so "
    "agreement proves nothing."
)


def claims_of(runs: Vsl1Runs) -> list[Claim]:
    """Return the claims, those beyond the paper last."""
    return [
        _load(runs, "On soft links the tip's error grows with the load", runs.soft),
        _load(runs, "On rigid links it does, too: the arm yields a little", (RIGID,)),
        _pressure(runs),
        _rigid(runs),
        _reach(runs, TipPath.SQUARE, "The farther the tip is from the base, the larger its error: on the square"),
        _servo(runs),
        _reach(runs, TipPath.CURVE, "The farther the tip is from the base, the larger its error: on the curve, too"),
    ]


def load_comparisons(runs: Vsl1Runs, kinds: Sequence[Links]) -> list[Comparison]:
    """Return those of each load with the next, on each path and arm."""
    return [
        _compared(runs, f"{path.name.lower()}, {links.label}, {format_load(a)} to {format_load(b)}", less, more)
        for path in PATHS
        for links in kinds
        for a, b in pairwise(runs.loads)
        for less, more in [(Cell(path, a, links), Cell(path, b, links))]
    ]


def pressure_comparisons(runs: Vsl1Runs) -> list[Comparison]:
    """Return those of each pressure with the next, on each path with each load."""
    return [
        _compared(runs, f"{path.name.lower()}, {format_load(load)}, {a.label} to {b.label}", less, more)
        for path in PATHS
        for load in runs.loads
        for a, b in pairwise(runs.soft)
        for less, more in [(Cell(path, load, b), Cell(path, load, a))]
    ]


def _compared(runs: Vsl1Runs, label: str, less: Cell, more: Cell) -> Comparison:
    return Comparison(label, runs.metric("mean_error", less), runs.metric("mean_error", more))


def _load(runs: Vsl1Runs, sentence: str, kinds: Sequence[Links]) -> Claim:
    claim = separation_claim(f"{sentence}.", _WHERE, "increases", load_comparisons(runs, kinds))
    return without_verdict(claim, _BY_SPRINGS)


def _pressure(runs: Vsl1Runs) -> Claim:
    claim = separation_claim(
        "The lower the pressure, the larger the tip's error.", _WHERE, "increases", pressure_comparisons(runs)
    )
    return without_verdict(claim, _BY_CHOICE)


def _rigid(runs: Vsl1Runs) -> Claim:
    comparisons = [
        _compared(runs, Cell(path, load, links).label, Cell(path, load, RIGID), Cell(path, load, links))
        for path in PATHS
        for load in runs.loads
        for links in runs.soft
    ]
    claim = separation_claim("The tip's error is larger on soft links than on rigid.", _WHERE, "larger", comparisons)
    return without_verdict(claim, _RIGID_BY_CHOICE)


def _reach(runs: Vsl1Runs, path: TipPath, sentence: str) -> Claim:
    """Judge the nearest third of a path's points against the farthest."""
    cells = [Cell(path, load, links) for load in runs.loads for links in runs.links]
    comparisons = [
        Comparison(cell.label, runs.metric("error_near", cell), runs.metric("error_far", cell), paired=True)
        for cell in cells
    ]
    beyond = path is not TipPath.SQUARE
    where, published = ("", "") if beyond else ("sec. V-C, fig. 5(c)", "higher")
    claim = separation_claim(f"{sentence}.", where, published, comparisons, beyond=beyond)
    return claim if beyond else without_verdict(claim, _BY_LEVER)


def _servo(runs: Vsl1Runs) -> Claim:
    """Judge that encoders and rigid kinematics put the tip nearer to the path than the rigid arm's tip is."""
    comparisons = [
        Comparison(cell.label, runs.metric("servo_error", cell), runs.metric("mean_error", rigid))
        for path in PATHS
        for load in runs.loads
        for links in runs.links
        for cell, rigid in [(Cell(path, load, links), Cell(path, load, RIGID))]
    ]
    claim = separation_claim(
        "The path by the servos' encoders is similar to the desired one: nearer than the rigid arm's tip.",
        _WHERE,
        "similar",
        comparisons,
    )
    return without_verdict(claim, _SERVO_BY_CHOICE)
