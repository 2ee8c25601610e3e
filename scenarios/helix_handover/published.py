"""What the thesis tells of a handover with given parameters. [Vervloet2025] table 1, sec. 5.2."""

from collections.abc import Sequence

import numpy as np

from handover.scenarios.experiment.paper import PublishedValue, paper_values
from handover.scenarios.helix_handover.parameters import Cover, Parameters, Tuning

_PAPER = "helix_handover"


def published_of(p: Parameters) -> Sequence[PublishedValue]:
    """Return the times and steps of table 1 for its step sizes, and for the least of them how far its model was off.

    Nothing for other step sizes, where the ball is elsewhere, or where a lens is covered.
    """
    told, given = paper_values(_PAPER, "experiment"), Parameters()
    fits = np.flatnonzero(np.isclose(told["alpha"], p.alpha))
    if not len(fits) or (p.radius, p.height) != (given.radius, given.height) or p.cover is not Cover.NONE:
        return ()
    k = int(fits[0])
    period = paper_values(_PAPER, "published")["timestep_mean"][k]
    apart = [] if np.isclose(p.control_period, period) else [f"its control period was {period:g} s"]
    apart += [] if p.tuning is Tuning.THESIS else ["its settings were those of tuning=thesis"]
    note = " and ".join(apart)
    span = ("arm_time_min", "arm_time_max")
    values = [
        PublishedValue(metric="arm_time", paper=_PAPER, name="arm_time_median", index=(k,), span=span, note=note),
        PublishedValue(metric="steps", paper=_PAPER, name="steps_median", index=(k,), note=" and ".join(apart[-1:])),
    ]
    if k == 0:
        values += [
            PublishedValue(metric=metric, paper=_PAPER, name=metric, note="of one run, whose place is not told")
            for metric in ("model_mismatch", "arm_travel", "model_travel")
        ]
    return values
