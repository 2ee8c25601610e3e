"""The inputs that lead back in a cycle of units, as one vector, and when its numbers of unlike size have converged."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from handover.cosim.blocks.ports import Floats, Width
from handover.cosim.blocks.variable import Kind
from handover.cosim.stepping.ensemble import Ensemble
from handover.cosim.system.system import Connection


class Magnitudes:
    """Measures differences of signals against how large each signal is.

    A signal's magnitude is the largest value that it has had in a solution, but at least its floor: its nominal value,
    or a small number, so that a signal that rests at zero converges. Differences divided by magnitudes have no unit and
    can be compared.

    Args:
        tolerance: the largest difference, relative to a signal's magnitude, at which it counts as converged.
        floors: smallest magnitude of each signal, in its unit.
        perturbations: by which part of its magnitude each signal is perturbed for differences.
    """

    def __init__(self, tolerance: float, floors: Floats, perturbations: Floats) -> None:
        self.tolerance = tolerance
        self._largest = np.array(floors)
        self._perturbations = perturbations

    def of(self, x: Floats) -> Floats:
        """Return the magnitudes of signals that have the values x."""
        return np.maximum(self._largest, np.abs(x))

    def perturbations(self, x: Floats) -> Floats:
        """Return by how much to perturb each signal from x for forward differences."""
        return self._perturbations * self.of(x)

    def moving(self, x: Floats, residual: Floats) -> NDArray[np.bool_]:
        """Return which signals have not converged; NaN has not."""
        return ~(np.abs(residual) <= self.tolerance * self.of(x))

    def length(self, x: Floats, residual: Floats) -> float:
        """Return the norm of a difference relative to the magnitudes of signals that have the values x."""
        return float(np.linalg.norm(self.shares(x, residual)))

    def shares(self, x: Floats, residual: Floats) -> Floats:
        """Return differences relative to the magnitudes of signals that have the values x."""
        shares: Floats = np.abs(residual) / self.of(x)
        return np.nan_to_num(shares, nan=np.inf)

    def learn(self, x: Floats) -> None:
        """Raise the magnitudes to those of a solution."""
        self._largest = self.of(x)

    def get_state(self) -> list[float]:
        """Return the magnitudes, for `set_state`."""
        return self._largest.tolist()

    def set_state(self, state: list[float]) -> None:
        """Restore the magnitudes that `get_state` returned."""
        self._largest = np.array(state)


_SMALL = 1e-3
"""Smallest magnitude of a signal that has no nominal value."""
_PERTURBATION = {Width.FLOAT64: 1e-6, Width.FLOAT32: 1e-3}
"""Relative perturbations: large against rounding, small against the range in which g is linear."""


class Interface:
    """Reads and writes the real inputs of some connections in the units' buffers; other kinds are left out.

    Attributes:
        names: of each number, `source -> unit.port[index]`.
    """

    def __init__(self, ensemble: Ensemble, connections: Sequence[Connection]) -> None:
        self._ensemble = ensemble
        self.names: list[str] = []
        self._places: dict[str, list[tuple[str, slice, Floats]]] = {}
        self._floors: list[float] = []
        self._perturbations: list[float] = []
        for c in connections:
            if ensemble.system.units[c.target.unit].description.inputs[c.target.port].kind is Kind.REAL:
                self._add(c)

    def __len__(self) -> int:
        return len(self.names)

    def read(self, t: float) -> Floats:
        """Return what the inputs' sources give."""
        x = np.zeros(len(self.names))
        for unit, places in self._places.items():
            self._ensemble.gather(unit, t)
            for _, place, view in places:
                x[place] = view
        return x

    def write(self, unit: str, x: Floats) -> None:
        """Put the numbers into a unit's buffers in place of what was gathered there."""
        for _, place, view in self._places.get(unit, ()):
            view[:] = x[place]

    def parts(self, unit: str, x: Floats) -> dict[str, Floats]:
        """Return, by port, the numbers that belong to a unit's inputs."""
        return {port: x[place] for port, place, _ in self._places.get(unit, ())}

    def magnitudes(self, tolerance: float) -> Magnitudes:
        """Return the magnitudes of the numbers, before any values are known."""
        return Magnitudes(tolerance, np.array(self._floors), np.array(self._perturbations))

    def _add(self, c: Connection) -> None:
        port = self._ensemble.system.units[c.target.unit].description.inputs[c.target.port]
        n = len(self.names)
        view = self._ensemble.instances[c.target.unit].u[c.target.port][0]
        self._places.setdefault(c.target.unit, []).append((c.target.port, slice(n, n + port.size), view))
        numbered = [f"[{i}]" for i in range(1, port.size + 1)] if port.shape else [""]
        self.names += [f"{c.source} -> {c.target}{index}" for index in numbered]
        self._floors += [abs(port.nominal) if port.nominal else _SMALL] * port.size
        self._perturbations += [_PERTURBATION[port.width or Width.FLOAT64]] * port.size
