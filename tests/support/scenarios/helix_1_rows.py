"""Tables of helix-1 with times that a test chooses."""

from collections.abc import Mapping, Sequence
from typing import Any

import pyarrow as pa

from handover.scenarios.runs.campaign.table import CampaignTable

PLACES = ("front", "front_left", "left", "back_left")
PERIODS = {0.1: 1.38, 0.2: 1.51, 0.4: 1.45}


def table_of(times: Mapping[float, Sequence[float | None]], tuning: str = "thesis", **same: Any) -> CampaignTable:
    """Return runs at the places in turn; None is a run in which the gripper never began to close."""
    rows = [
        {
            "run": f"{tuning}_{alpha}_{i}",
            "status": "done",
            "success": time is not None,
            "tuning": tuning,
            "alpha": alpha,
            "control_period": PERIODS[alpha],
            "place": PLACES[i // 2 % 4],
            "repetition": i % 2,
            "arm_time": time,
            "steps": None if time is None else round(time / PERIODS[alpha]) + 1,
            **same,
        }
        for alpha, row in times.items()
        for i, time in enumerate(row)
    ]
    return CampaignTable(pa.Table.from_pylist(rows))


def spread(mean: float, std: float, n: int = 8) -> list[float]:
    """Return n times, evenly spaced, with a mean and a sample standard deviation."""
    steps = [i - (n - 1) / 2 for i in range(n)]
    unit = (sum(s * s for s in steps) / (n - 1)) ** 0.5
    return [mean + std * s / unit for s in steps]
