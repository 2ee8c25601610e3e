"""What the Helix tolerates: one disturbance at a time, at the same places and seeds, until the handover fails.

[Vervloet2025] has no such experiment; sec. 5.4 names camera places, filters and step rules as what could be changed.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import ClassVar

import numpy as np

from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.paper import paper_values
from handover.scenarios.experiment.plotting import COLOURS
from handover.scenarios.published.figures import Mark, strips
from handover.scenarios.published.helix.helix_cases import (
    OFFERED_AT,
    Case,
    ends_near,
    levels_of,
    median_and_most,
    reasons_of,
    runs_by_case,
)
from handover.scenarios.published.published_experiment import Claim, ComparisonTable, PublishedExperiment
from handover.scenarios.published.runs import Runs
from handover.scenarios.published.tables import number, of, table_of
from handover.scenarios.published.verdicts import every_claim
from handover.scenarios.runs.campaign.plan import CampaignPlan
from handover.scenarios.runs.campaign.table import CampaignTable

_QUICK_PLACES, _QUICK_CASES = 1, ("nothing", "light", "arm's stiffness")


def _same(*values: str) -> dict[str, str]:
    return {value: value for value in values}


_HELP_SPEED = str(paper_values("helix", "experiment")["help_speed"])
CASES = (
    Case("nothing", "", {}, mild=True),
    *levels_of("arm's stiffness", "times", "arm_stiffness", _same("0.5", "0.7", "1.4", "2"), ("0.7", "1.4")),
    *levels_of("gripper's mass", "times", "gripper_load", _same("1.5", "2.5"), ("1.5",)),
    *levels_of("hand's tremor", "mm", "tremor", {"3": "0.003", "10": "0.01"}, ("3",)),
    *levels_of("hand's drift", "mm", "drift", {"10": "0.01", "30": "0.03"}, ("10",)),
    *levels_of("ball moved on by", "°", "move_azimuth", {"29": "0.5", "86": "1.5"}, ("29",)),
    *levels_of("ball moved up by", "mm", "move_height", {"50": "0.05", "-50": "-0.05"}, ("50",)),
    *levels_of("clicks of the calibration off by", "px", "click_noise", _same("2", "5", "15"), ("2",)),
    *levels_of("ball's mass", "g", "ball_mass", {"40": "0.04", "80": "0.08"}, ("40",)),
    *levels_of("fingers' friction", "", "finger_friction", _same("0.4", "0.2", "0.05"), ("0.4",)),
    *levels_of("camera turned by", "°", "camera_turn", {"0.3": "0.005", "1.1": "0.02", "5.7": "0.1"}, ("0.3",)),
    *levels_of("light", "times", "light", _same("0.15", "0.4", "2", "4"), ("0.4", "2")),
    *levels_of("pictures' noise", "levels", "sensor_noise", _same("8", "25"), ("8",)),
    *levels_of("pictures lost", "%", "lost_pictures", {"30": "0.3", "80": "0.8", "95": "0.95"}, ("30",)),
    *levels_of("markers covered", "", "covered_markers", _same("1", "3", "5"), ("1",)),
    *levels_of("ball hidden for", "s", "hide_for", _same("2", "6", "60"), ("2",)),
    *levels_of("one camera covered for", "s", "cover_for", _same("5"), ("5",), cover="left"),
    Case("one camera lost for good", "", {"cover": "left", "cover_for": "600"}),
    *levels_of("jitter of the control period", "%", "jitter", {"30": "0.3", "80": "0.8"}, ("30",)),
    *levels_of("pictures a second", "", "decimation", {"30": "1", "2": "15"}, ("30",)),
    Case("step size grows with the error", "", {"step_rule": "by_error"}),
    Case("the thesis's filters", "", {"filters": "thesis"}),
    Case("all of the thesis's settings", "", {"tuning": "thesis"}),
    Case(
        "the thesis's settings, and a person who helps",
        "",
        {"tuning": "thesis", "help_speed": _HELP_SPEED},
    ),
)


class HelixDisturbances(PublishedExperiment):
    """Each disturbance at several sizes, at four places, all with the same seeds, with the fast arm.

    The quick plan is three of them at one place.
    """

    name: ClassVar[str] = "helix-disturbances"
    title: ClassVar[str] = "the Helix with one disturbance at a time, until it fails (beyond [Vervloet2025])"
    scenario: ClassVar[str] = "helix_handover"

    def plan(self, quick: bool) -> CampaignPlan:
        """Return every case at every place; if quick, a part of it."""
        cases = [c for c in CASES if c.what in _QUICK_CASES] if quick else CASES
        places = OFFERED_AT[:_QUICK_PLACES] if quick else OFFERED_AT
        return self.campaign(
            [{**place, **case.parameters} for case in cases for place in places],
            seed=16,
            paired=True,
            scenes=tuple(OFFERED_AT[0]),
            units={"arm": "TendonArmFast"},
        )

    def claims(self, table: CampaignTable) -> Sequence[Claim]:
        """Judge whether mild disturbances are tolerated, and how near the gripper ends."""
        nothing, *others = [runs for case, runs in runs_by_case(self, table, CASES).items() if case.mild]
        runs = nothing.together_with(*others)
        tolerated = every_claim("The Helix succeeds with each mild disturbance", "", (0, 0), runs.count)
        return [tolerated, ends_near("With a mild disturbance", runs)]

    def tables(self, table: CampaignTable) -> Sequence[ComparisonTable]:
        """Return success, distance and steps by case, and why handovers failed."""
        rows = [_row(case, runs) for case, runs in runs_by_case(self, table, CASES).items() if len(runs)]
        note = (
            "All at the same places, with the same seeds. Distances are between gripper and ball when the gripper "
            "begins to close and at the end, by ground truth. They are medians of the handovers that succeeded, with "
            "the largest in brackets. Steps are control steps until the gripper begins to close."
        )
        return [table_of("One disturbance at a time", rows, note)]

    def draw(self, table: CampaignTable, runs: Path, folder: Path) -> Sequence[Figure]:  # noqa: ARG002
        """Draw the final distances by case."""
        cases: dict[str, Sequence[Mark]] = {}
        for case, found in runs_by_case(self, table, CASES).items():
            if len(found):
                taken, missed = (1e3 * those.metric("final_distance") for those in (found.successful, found.failed))
                cases[case.label] = (
                    Mark(taken, np.zeros(len(taken)), "o", COLOURS[0], "the gripper has the ball"),
                    Mark(missed, np.zeros(len(missed)), "x", COLOURS[1], "it has not"),
                )
        caption = (
            "Distance of gripper and ball at the end, by ground truth, with one disturbance at a time: each point is a "
            "handover, all at the same places."
        )
        axes = {"xscale": "log", "xlabel": "gripper to ball at the end (mm)"}
        return strips(folder / "disturbances", caption, cases, axes)


def _row(case: Case, runs: Runs) -> dict[str, str]:
    taken = runs.successful
    return {
        "disturbance": case.what,
        "size": case.size,
        "success": of(runs.count),
        "closes at, mm": median_and_most(taken.metric("closing_distance")),
        "ends at, mm": median_and_most(taken.metric("final_distance")),
        "steps": number(taken.metric("steps"), ".0f"),
        "failed because": reasons_of(runs),
    }
