"""The inputs that lead back in a circle of units, as one vector of numbers."""

from collections.abc import Sequence

import numpy as np

from handover.cosim.blocks.ports import Floats, Width
from handover.cosim.blocks.variable import Kind
from handover.cosim.ensemble import Ensemble
from handover.cosim.iterating.magnitudes import Magnitudes
from handover.cosim.system.system import Connection

_SMALL = 1e-3
"""The least magnitude of a signal of which neither its nominal one nor any other value is known."""
_PERTURBATION = {Width.FLOAT64: 1e-6, Width.FLOAT32: 1e-3}
"""Parts of a signal's magnitude that lie between its curvature and its rounding."""


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
        """Return what measures the numbers, before any values are known."""
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
