"""One lamp, far away, and how it shades a matt surface."""

from dataclasses import dataclass

import numpy as np

from handover.cosim.blocks.ports import Floats


@dataclass(frozen=True)
class Light:
    """A lamp in the direction `towards`, shape (3,), of unit length; the room gives back the share `ambient`."""

    towards: Floats
    ambient: float

    def shade(self, normals: Floats) -> Floats:
        """Return brightness, 0 to 1, of surfaces with unit normals, shape (..., 3): Lambert's law over the ambient."""
        return self.ambient + (1.0 - self.ambient) * np.clip(normals @ self.towards, 0.0, None)

    def seen_from(self, R_WC: Floats) -> "Light":
        """Return the light in a camera's frame."""
        return Light(self.towards @ R_WC, self.ambient)
