"""Handovers of the Helix that differ in one thing each, at the same places with the same seeds, and their runs."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.scenarios.experiment.paper import paper_values
from handover.scenarios.published.claims import Statement
from handover.scenarios.published.published_experiment import Claim, PublishedExperiment
from handover.scenarios.published.runs import Runs
from handover.scenarios.published.verdicts import MIN_FOR_EVERY
from handover.scenarios.runs.campaign.table import CampaignTable

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


def runs_by_case(experiment: PublishedExperiment, table: CampaignTable, cases: Sequence[Case]) -> dict[Case, Runs]:
    """Return the runs that came to their end, wherever the ball was offered, by what is different in them."""
    runs = experiment.runs(table, free=tuple(OFFERED_AT[0]))
    return {case: runs.of(case.parameters) for case in cases}


def median_and_most(values: Floats) -> str:
    """Return the median of distances, given in m, and the largest in brackets, in mm; nothing for none."""
    return f"{1e3 * np.median(values):.1f} ({1e3 * values.max():.1f})" if len(values) else ""


def reasons_of(runs: Runs) -> str:
    """Return why runs failed, the frequent reasons first, with how often."""
    reasons = Counter(_reason(str(row["reason"])) for row in runs.failed)
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


def ends_near(when: str, runs: Runs) -> Claim:
    """Judge how far the gripper is from the ball at the end of handovers that succeeded.

    Args:
        when: circumstances, in words, with which the claim begins.
        runs: those that succeeded count.
    """
    says = Statement(f"{when} the gripper ends within {1e3 * NEAR:.0f} mm of the ball")
    d = runs.successful.metric("final_distance")
    if not len(d):
        return says.unknown("Too few runs: no handover succeeded.")
    return says.judged(
        f"{1e3 * np.median(d):.1f} mm in the median, {1e3 * d.max():.1f} mm at most",
        bool(d.max() <= NEAR),
        f"each of the {len(d)} handovers that succeeded ends so near, by ground truth",
        runs=(len(d), MIN_FOR_EVERY),
    )
