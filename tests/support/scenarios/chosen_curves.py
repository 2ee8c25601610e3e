"""Curves of runs of helix-1 that a test chooses."""

from dataclasses import fields

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.scenarios.published.helix.helix_1_curves import RunCurves

PERIOD = 1.45


def curves_as(
    error: Floats, descent: int | None = None, rise: float = np.nan, period: float = PERIOD, **chosen: Floats
) -> RunCurves:
    """Return a run's curves; those that are not chosen are zeros, as long as the error's."""
    names = [f.name for f in fields(RunCurves) if f.name not in ("period", "error", "descent", "rise")]
    rest = {name: chosen.get(name, np.zeros(len(error))) for name in names}
    return RunCurves(period=period, error=error, descent=descent, rise=rise, **rest)
