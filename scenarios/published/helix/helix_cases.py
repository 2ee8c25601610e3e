"""Handovers of the Helix that differ in one thing each, at the same places with the same seeds, and their runs."""

import enum
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.scenarios.campaign.plan import is_number
from handover.scenarios.campaign.table import CampaignTable
from handover.scenarios.experiment.paper import paper_values
from handover.scenarios.helix.helix_handover import HelixHandover
from handover.scenarios.published.claims import Statement
from handover.scenarios.published.published_experiment import Claim
from handover.scenarios.published.runs import values_of
from handover.scenarios.published.verdicts import MIN_FOR_EVERY

OFFERED_AT = [
    {"azimuth": azimuth, "radius": radius, "height": height}
    for azimuth, radius, height in (
        ("0", "0.16", "-0.6"),
        ("2.1", "0.16", "-0.56"),
        ("-2.1", "0.1", "-0.6"),
        ("-1", "0.12", "-0.64"),
    )
]
"""Where the ball is offered; at all of them an undisturbed handover is within the arm's reach."""


@dataclass(frozen=True, eq=False)
class Case:
    """Something that is wrong.

    Attributes:
        what: in words.
        size: of it, as text.
        parameters: that make it, as texts.
        mild: whether a working robot should bear it.
    """

    what: str
    size: str
    parameters: Mapping[str, str]
    mild: bool = False

    @property
    def label(self) -> str:
        """What and size."""
        return f"{self.what} {self.size}".strip()


def levels_of(
    what: str, unit: str, name: str, sizes: Mapping[str, str], mild: Sequence[str], **others: str
) -> list[Case]:
    """Return a case for each of a parameter's values, `sizes`, by what is shown for it, in another unit."""
    return [
        Case(what, f"{shown} {unit}".strip(), {name: value, **others}, shown in mild) for shown, value in sizes.items()
    ]


def thesis_settings(alpha: float) -> dict[str, str]:
    """Return the thesis's tuning at one of its step sizes, with the period that its loop took, and a person who helps.

    Raises:
        ValueError: the thesis has no such step size.
    """
    setup, published = paper_values("helix", "experiment"), paper_values("helix", "published")
    period = published["timestep_mean"][setup["alpha"].index(alpha)]
    helped = {"help_speed": str(setup["help_speed"])}
    return {"tuning": "thesis", "alpha": str(alpha), "control_period": str(period), **helped}


def rows_by_case(table: CampaignTable, cases: Sequence[Case]) -> dict[Case, list[Mapping[str, Any]]]:
    """Return the runs that came to their end, by what is different in them, in the order of the cases."""
    by_values = {frozenset((name, _plain(text)) for name, text in case.parameters.items()): case for case in cases}
    found: dict[Case, list[Mapping[str, Any]]] = {case: [] for case in cases}
    for row in table.rows:
        case = by_values.get(deviations_from_defaults(row, cases))
        if case is not None and row["status"] == "done":
            found[case].append(row)
    return found


def deviations_from_defaults(row: Mapping[str, Any], cases: Sequence[Case]) -> frozenset[tuple[str, float | str]]:
    """Return what a row has otherwise than the scenario's defaults, of all that the cases set.

    A unit's parameter has no default: any value of it counts. None and NaN are no values.
    """
    names = {name for case in cases for name in case.parameters}
    given = [(name, _plain(row[name])) for name in names if row.get(name) not in (None, "")]
    return frozenset((name, x) for name, x in given if x == x and x != _defaults().get(name))


@cache
def _defaults() -> Mapping[str, Any]:
    """Return the values of the scenario's parameters where none is set."""
    return {v.name: _plain(v.start) for v in HelixHandover.parameters() if not v.shape}


def _plain(value: Any) -> float | str:
    """Return a value as a number or a text: that of a table, of a text, or of an enumeration."""
    if isinstance(value, enum.IntEnum):
        return value.name.lower()
    return float(value) if is_number(str(value)) else str(value)


def distances(rows: Sequence[Mapping[str, Any]], success: bool, metric: str = "final_distance") -> Floats:
    """Return distances, m, of the runs that succeeded, or of those that did not."""
    values = [row.get(metric) for row in rows if row["success"] is success]
    return np.array([v for v in values if v is not None], dtype=np.float64)


def rate(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return how many of the runs succeeded, as text."""
    return f"{sum(bool(row['success']) for row in rows)} of {len(rows)}"


def median_and_most(values: Floats) -> str:
    """Return the median of distances, given in m, and the largest in brackets, in mm; nothing for none."""
    return f"{1e3 * np.median(values):.1f} ({1e3 * values.max():.1f})" if len(values) else ""


def median_steps(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return the median of the control steps of the runs that succeeded, as text."""
    steps = [row["steps"] for row in rows if row["success"] and row.get("steps") is not None]
    return f"{np.median(steps):.0f}" if steps else ""


def reasons_of(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return why runs failed, the frequent reasons first, with how often."""
    reasons = Counter(_reason(str(row["reason"])) for row in rows if not row["success"])
    return "; ".join(f"{reason} ({n})" if n > 1 else reason for reason, n in reasons.most_common())


def _reason(reason: str) -> str:
    """Return a run's reason without its figures and places."""
    for words, short in _SHORT.items():
        if words in reason:
            return short
    return reason.removeprefix("no handover: ").partition(":")[0]


_SHORT = {
    "the arm pressed on the hand": "pressed on the hand",
    "the hand kept the ball": "closed beside the ball",
    "did not keep it": "lost the ball again",
    "was pushed out of the hand": "pushed the ball out of the hand",
    "the cameras did not see": "ball or ring not seen",
}


NEAR = 0.005
"""How near to the ball the gripper is to end, m."""


def ends_near(when: str, taken: Sequence[Mapping[str, Any]]) -> Claim:
    """Judge how far the gripper is from the ball at the end of handovers that succeeded.

    Args:
        when: circumstances, in words, with which the claim begins.
        taken: rows of their runs.
    """
    says = Statement(f"{when} the gripper ends within {1e3 * NEAR:.0f} mm of the ball")
    d = values_of(taken, "final_distance")
    if not len(d):
        return says.unknown("Too few runs: no handover succeeded.")
    return says.judged(
        f"{1e3 * np.median(d):.1f} mm in the median, {1e3 * d.max():.1f} mm at most",
        bool(d.max() <= NEAR),
        f"each of the {len(d)} handovers that succeeded ends so near, by ground truth",
        runs=(len(d), MIN_FOR_EVERY),
    )
