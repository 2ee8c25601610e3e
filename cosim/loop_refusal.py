"""Refuses circles of units that an algorithm cannot solve, before anything is loaded."""

from collections.abc import Sequence

from handover.cosim.algebraic_loop import AlgebraicLoop
from handover.cosim.blocks.variable import Kind
from handover.cosim.exceptions import ScheduleError
from handover.cosim.group import Group
from handover.cosim.system import System

_CURE = (
    "what would help: units that save their state (canGetAndSetFMUState) in their place, the algorithm jacobi, in "
    "which every connection acts a step later, or a unit in the loop whose output does not act at once"
)


def refuse_loops(system: System, loops: Sequence[AlgebraicLoop], goes_back: bool) -> None:
    """Check that algebraic loops can be solved: their signals are real, and units can go over a step again.

    Args:
        system: it has no faults of wiring.
        loops: its algebraic loops.
        goes_back: whether loops are solved at each step, and not at the start alone.

    Raises:
        ScheduleError: with all loops that cannot be solved, each spelled out, and what would help.
    """
    faults = [(loop, fault) for loop in loops if (fault := _fault(system, loop, goes_back))]
    if not faults:
        return
    told = "".join(f"\n  - {loop.told}: {fault}" for loop, fault in faults)
    n = f"{len(faults)} algebraic loop{'s' if len(faults) > 1 else ''}"
    raise ScheduleError(f"{n} cannot be solved (outputs depend on themselves at once):{told}")


def refuse_circles(system: System, groups: Sequence[Group]) -> None:
    """Check that all units which are connected in a circle can go over a step again.

    Raises:
        ScheduleError: with all that cannot.
    """
    circles = [group for group in groups if group.circle]
    faults = [(group, stateless) for group in circles if (stateless := _stateless(system, group.units))]
    if not faults:
        return
    told = "".join(f"\n  - {', '.join(names)} (connected in a circle: {_list(g.units)})" for g, names in faults)
    raise ScheduleError(
        "iterating goes over steps again, which takes units that save their state (canGetAndSetFMUState), but these "
        f"do not:{told}\n  gauss-seidel and jacobi do without"
    )


def _fault(system: System, loop: AlgebraicLoop, goes_back: bool) -> str | None:
    ends = [(c, system.units[c.source.unit].description.outputs[c.source.port].kind) for c in loop.connections]
    unreal = [f"{c.source} is {kind.value}" for c, kind in ends if kind is not Kind.REAL]
    if unreal:
        return (
            f"only real signals can be iterated, but {', '.join(unreal)}; a unit in between that delays one would help"
        )
    stateless = _stateless(system, loop.units) if goes_back else []
    if stateless:
        verb = "do not save their states" if len(stateless) > 1 else "does not save its state"
        return f"{', '.join(stateless)} {verb}, so a step cannot be gone over again; {_CURE}"
    return None


def _stateless(system: System, units: Sequence[str]) -> list[str]:
    return [name for name in units if not system.units[name].description.capabilities.saves_state]


def _list(units: Sequence[str]) -> str:
    return ", ".join(units[:12]) + (f" and {len(units) - 12} more" if len(units) > 12 else "")
