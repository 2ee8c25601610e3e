"""What infrared fingers are worth on the Helix: with and without the reflex, with cameras that see and that do not."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import ClassVar

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.cosim.exceptions import counted
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.plotting import COLOURS
from handover.scenarios.published.claims import Statement
from handover.scenarios.published.figures import Mark, Panel, drawn
from handover.scenarios.published.helix.helix_cases import reasons_of
from handover.scenarios.published.published_experiment import Claim, ComparisonTable, PublishedExperiment
from handover.scenarios.published.runs import Point, Row, Runs
from handover.scenarios.published.tables import table_of
from handover.scenarios.published.verdicts import (
    format_median,
    format_p_value,
    format_rate,
    format_share,
    no_worse_claim,
    order_claim,
)
from handover.scenarios.runs.campaign.plan import CampaignPlan
from handover.scenarios.runs.campaign.statistics import LEVEL, paired_difference, paired_test
from handover.scenarios.runs.campaign.table import CampaignTable

_COUNT, _QUICK_COUNT = 40, 2
_SEED = 1904
"""Draws places, hands, noise and gains; nothing was tuned on them."""
CAMERAS = {"covered": "covered within 50 mm", "free": "free"}
"""What the cameras see of the last stretch, by the parameter's value."""
OFFSET = "closing_offset_lateral"
MISMATCHES: Mapping[str, Mapping[str, str]] = {
    "a ball of 20 mm radius expected": {"expected_radius": "0.02"},
    "a ball of 30 mm radius expected": {"expected_radius": "0.03"},
    "ball returns a third of the light": {"reflectivity": "0.33"},
    "palm returns twice the light": {"palm_reflectivity": "1.2"},
    "sensors three times as far off": {
        "sensor_tolerance": "0.15",
        "range_tolerance": "0.15",
        "mounting_tolerance": "0.09",
    },
}
"""What the reflex does not expect, one thing at a time; its ball has 25 mm, its palm 0.6 of the reference's light."""
_MIN_PAIRS = next(n for n in range(1, 64) if 2.0 ** (1 - n) < LEVEL)
"""Pairs of which Wilcoxon's signed-rank test, two-sided, can reject."""


class HelixReflex(PublishedExperiment):
    """Forty places with a seed each, each with and without the reflex and with cameras free and covered, fast arm.

    With cameras covered, there are runs besides where something is not as the reflex expects it. The reflex has the
    simulator's form of fingers and beams; by default only each sensor's gain, range and direction are a little off.

    Nobody has published such a grasp: all claims are this project's own. The quick plan is two of the places.
    """

    name: ClassVar[str] = "helix-reflex"
    title: ClassVar[str] = "the Helix with infrared fingers, after [Luberto], in the last 50 mm (own)"
    scenario: ClassVar[str] = "helix_reflex_grasp"

    def plan(self, quick: bool) -> CampaignPlan:
        """Return every case with every seed; if quick, with two of them."""
        return self.campaign(
            [
                *({"cameras": c, "reflex": r} for c in CAMERAS for r in ("true", "false")),
                *({"cameras": "covered", "reflex": "true", **values} for values in MISMATCHES.values()),
            ],
            repetitions=_QUICK_COUNT if quick else _COUNT,
            seed=_SEED,
            paired=True,
            units={"arm": "TendonArmFast"},
        )

    def claims(self, table: CampaignTable) -> Sequence[Claim]:
        """Judge success and offset with cameras that are covered, and that the reflex does no harm to free ones."""
        covered, free = (pairs(table, c) for c in ("covered", "free"))
        return [
            order_claim(
                "With cameras covered for the last 50 mm, the reflex takes more balls",
                "",
                "",
                *successes(covered),
                beyond=True,
            ),
            _centres(
                "With cameras covered, the gripper begins to close with the ball nearer to its axis by the reflex",
                covered,
            ),
            no_worse_claim("With cameras that see all, the reflex takes no fewer balls", *successes(free)),
            _centres("With cameras that see all, the ball is nearer to the axis by the reflex, too", free),
            _in_spite_of_mismatches({title: pairs(table, "covered", title) for title in MISMATCHES}),
        ]

    def tables(self, table: CampaignTable) -> Sequence[ComparisonTable]:
        """Return success, offsets and tests by what the cameras see."""
        tests = " ".join(_tests(CAMERAS[c], pairs(table, c)) for c in CAMERAS)
        cases: Mapping[str, str | None] = {"all as expected, but for tolerances": None, **{m: m for m in MISMATCHES}}
        return [
            table_of(
                "With and without the reflex",
                [
                    {"cameras": CAMERAS[c], "reflex": "with" if r else "without", **_cells(of_case(table, c, r))}
                    for c in CAMERAS
                    for r in (True, False)
                ],
                "Medians, with intervals by bootstrap, of the runs in which the gripper closed. First comes the "
                "ball's offset beside and along the gripper's axis as it began to close, by ground truth, and the "
                f"controller's error of it. Then comes the offset beside the axis as the ball left the hand. {tests}",
            ),
            table_of(
                "A model that is wrong",
                [
                    {"what the reflex does not expect": label, **_cells(of_case(table, "covered", True, m))}
                    for label, m in cases.items()
                ],
                "Cameras covered within 50 mm, with the reflex; figures as above. Of its sensors the reflex knows the "
                "design: gain and range of each are 5 % off, directions 0.03 rad (1.7°) in each of two (one standard "
                "deviation).",
            ),
        ]

    def draw(self, table: CampaignTable, runs: Path, folder: Path) -> Sequence[Figure]:  # noqa: ARG002
        """Draw the offset of each pair."""
        panels: list[Panel] = []
        for c, label in CAMERAS.items():
            both = 1e3 * offsets(pairs(table, c))
            marks = [Mark([0, 1], pair, "-", "0.7", style={"lw": 0.7, "zorder": 1}) for pair in both]
            marks += [Mark(np.full(len(both), k), both[:, k], "o", COLOURS[k]) for k in (0, 1)]
            axes = {"title": f"cameras {label}", "ylabel": "ball beside the gripper's axis (mm)", "ylim": (0.0, None)}
            panels.append(Panel(marks, {**axes, "xlim": (-0.4, 1.4)}, {0: "without", 1: "by reflex"}))
        caption = (
            "Where the ball was beside the gripper's axis when the gripper began to close, by ground truth; lines join "
            "runs of one seed in which it did both times."
        )
        return drawn(folder / "reflex", caption, panels, 2, size=(9.0, 3.6), same_height=True)


def of_case(table: CampaignTable, cameras: str, reflex: bool, mismatch: str | None = None) -> Runs:
    """Return the runs of a case that came to their end, by what the reflex does not expect; None: nothing."""
    expected: Point = {} if mismatch is None else MISMATCHES[mismatch]
    return HelixReflex().runs(table).of({"cameras": cameras, "reflex": str(reflex).lower(), **expected})


def pairs(table: CampaignTable, cameras: str, mismatch: str | None = None) -> Sequence[tuple[Row, Row]]:
    """Return runs of one seed without and with the reflex, of seeds of which both came to their end."""
    with_it = {row["seed"]: row for row in of_case(table, cameras, True, mismatch)}
    return [(row, with_it[row["seed"]]) for row in of_case(table, cameras, False) if row["seed"] in with_it]


def successes(of_pairs: Sequence[tuple[Row, Row]]) -> tuple[list[bool], list[bool]]:
    """Return which runs succeeded, with the reflex and without it."""
    return [bool(b["success"]) for _, b in of_pairs], [bool(a["success"]) for a, _ in of_pairs]


def offsets(of_pairs: Sequence[tuple[Row, Row]]) -> Floats:
    """Return the offsets beside the axis, shape (n, 2), m, without and with, of pairs in which both closed."""
    both = [(_value(a, OFFSET), _value(b, OFFSET)) for a, b in of_pairs]
    d = np.array(both, dtype=np.float64).reshape(-1, 2)
    return d[np.isfinite(d).all(axis=1)]


def _value(row: Row, name: str) -> float:
    value = row.get(name)
    return np.nan if value is None else float(value)


def _centres(claim: str, of_pairs: Sequence[tuple[Row, Row]]) -> Claim:
    says, d = Statement(claim), offsets(of_pairs)
    test = paired_difference(d[:, 0], d[:, 1])
    if test is None:
        return says.unknown("In no pair of runs did the gripper close both times.")
    medians = 1e3 * np.median(d, axis=0)
    return says.judged(
        f"{medians[0]:.1f} mm without, {medians[1]:.1f} mm with it, in the median",
        test.p < LEVEL and test.difference < 0.0,
        "the median of the differences is below 0 and Wilcoxon's signed-rank test, two-sided, rejects that nothing "
        f"changes: p = {format_p_value(test.p)} of {counted(len(d), 'pair')} in which the gripper closed both times",
        "The interval is that median's. In "
        f"{len(of_pairs) - len(d)} of {counted(len(of_pairs), 'pair')} it did not close both times.",
        enough=len(d) >= _MIN_PAIRS,
        interval=test.interval,
        unit="m",
    )


def _in_spite_of_mismatches(of_pairs: Mapping[str, Sequence[tuple[Row, Row]]]) -> Claim:
    claim = "With covered cameras the ball is nearer to the axis by the reflex, too, with each mismatch of its model"
    says, closed = Statement(claim), {title: offsets(both) for title, both in of_pairs.items()}
    tests = {title: paired_difference(d[:, 0], d[:, 1]) for title, d in closed.items()}
    found = {title: test for title, test in tests.items() if test is not None}
    if len(found) < len(of_pairs):
        return says.unknown("Not with each was there a pair that closed both times.")
    worst = max(found, key=lambda title: (found[title].difference >= 0.0, found[title].p))
    without, by = 1e3 * np.median(closed[worst], axis=0)
    return says.judged(
        f"{worst}: {by:.1f} mm ({without:.1f} without)",
        all(test.p < LEVEL and test.difference < 0.0 for test in found.values()),
        f"for each of them Wilcoxon's signed-rank test, two-sided, rejects at {format_share(LEVEL)}, and the median of "
        "the differences is below 0; as all must, no correction is needed",
        f"Medians of the least clear, of {counted(len(closed[worst]), 'pair')} (p = "
        f"{format_p_value(found[worst].p)}); the table has all.",
        enough=min(map(len, closed.values())) >= _MIN_PAIRS,
    )


def _cells(runs: Runs) -> dict[str, str]:
    """Return success, how many closed, medians of the offsets in mm, and reasons of failure; empty without runs."""
    offs = {
        "beside the axis, mm": OFFSET,
        "along it, mm": "closing_offset_axial",
        "belief's error, mm": "felt_error",
        "as the ball left the hand, mm": "grasp_offset_lateral",
    }
    closed = runs.where(lambda row: bool(np.isfinite(_value(row, OFFSET))))
    medians = {head: 1e3 * closed.metric(name) for head, name in offs.items()}
    return {
        "success": format_rate(*runs.count) if len(runs) else "",
        "closed": f"{len(closed)}" if len(runs) else "",
        **{head: format_median(x[np.isfinite(x)], 1) for head, x in medians.items()},
        "failed because": reasons_of(runs),
    }


def _tests(label: str, of_pairs: Sequence[tuple[Row, Row]]) -> str:
    if not of_pairs:
        return ""
    d, test = offsets(of_pairs), paired_test(*successes(of_pairs))
    difference = paired_difference(d[:, 0], d[:, 1])
    p = "" if difference is None else f"; Wilcoxon's p of the offsets = {format_p_value(difference.p)}"
    return (
        f"Cameras {label}: only with the reflex {test.only_first} of {len(of_pairs)} were taken, only without it "
        f"{test.only_second}, McNemar's exact p = {format_p_value(test.p)}{p}."
    )
