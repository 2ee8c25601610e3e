"""What infrared fingers are worth on the Helix: with and without the reflex, with cameras that see and that do not."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.scenarios.campaign.plan import CampaignPlan
from handover.scenarios.campaign.statistics import LEVEL, paired_difference, paired_test
from handover.scenarios.campaign.table import CampaignTable
from handover.scenarios.experiment.display_unit import counted
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.plotting import COLOURS, figure
from handover.scenarios.helix.reflex_grasp_parameters import ReflexGraspParameters
from handover.scenarios.published.helix.helix_cases import reasons_of
from handover.scenarios.published.published_experiment import Claim, ComparisonTable, PublishedExperiment
from handover.scenarios.published.verdicts import (
    format_median,
    format_p_value,
    format_rate,
    format_share,
    no_worse_claim,
    nothing_measured,
    order_claim,
    verdict_of,
)

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
_USUAL = ReflexGraspParameters()
_OF_MODEL = tuple(dict.fromkeys(name for values in MISMATCHES.values() for name in values))
_MIN_PAIRS = next(n for n in range(1, 64) if 2.0 ** (1 - n) < LEVEL)
"""Pairs of which Wilcoxon's signed-rank test, two-sided, can reject."""

Row = Mapping[str, Any]
Rows = Sequence[Row]


class HelixReflex(PublishedExperiment):
    """Forty places with a seed each, each with and without the reflex and with cameras free and covered, fast arm.

    With cameras covered, besides, where something is not as the reflex expects it: it has the simulator's form of
    fingers and beams, and off its defaults only that each sensor's gain, range and direction are a little off.

    Nobody has published such a grasp: all claims are this project's own. The quick plan is two of the places.
    """

    name: ClassVar[str] = "helix-reflex"
    title: ClassVar[str] = "the Helix with infrared fingers, after [Luberto], in the last 50 mm (own)"
    scenario: ClassVar[str] = "helix_reflex_grasp"

    def plan(self, quick: bool) -> CampaignPlan:
        """Return every case with every seed; if quick, with two of them."""
        return CampaignPlan(
            scenario=self.scenario,
            points=[
                *({"cameras": c, "reflex": r} for c in CAMERAS for r in ("true", "false")),
                *({"cameras": "covered", "reflex": "true", **values} for values in MISMATCHES.values()),
            ],
            repetitions=_QUICK_COUNT if quick else _COUNT,
            seed=_SEED,
            paired=True,
            units={"arm": "TendonArmFast"},
            experiment=self.name,
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
        header = [
            *("cameras", "reflex", "success", "closed", "beside the axis, mm", "along it, mm", "belief's error, mm"),
            *("as the ball left the hand, mm", "failed because"),
        ]
        cells = [
            [CAMERAS[c], "with" if r else "without", *_figures_of(of_case(table, c, r))]
            for c in CAMERAS
            for r in (True, False)
        ]
        tests = " ".join(_tests(CAMERAS[c], pairs(table, c)) for c in CAMERAS)
        note = (
            "Medians, with intervals by bootstrap, of the runs in which the gripper closed. They are the ball's offset "
            "beside and along the gripper's axis as it began to close, by ground truth, and the controller's error of "
            f"that; then the offset beside the axis as the ball left the hand. {tests}"
        )
        return [
            ComparisonTable(title="With and without the reflex", header=header, rows=cells, note=note),
            _table_of_mismatches(table),
        ]

    def draw(self, table: CampaignTable, runs: Path, folder: Path) -> Sequence[Figure]:  # noqa: ARG002
        """Draw the offset of each pair."""
        with figure(folder / "reflex", 1, len(CAMERAS), size=(9.0, 3.6)) as axes:
            for axis, (c, label) in zip(axes, CAMERAS.items(), strict=True):
                both = 1e3 * offsets(pairs(table, c))
                for without, by_reflex in both:
                    axis.plot([0, 1], [without, by_reflex], "-", lw=0.7, color="0.7", zorder=1)
                for k, colour in enumerate(COLOURS[:2]):
                    axis.plot(np.full(len(both), k), both[:, k], "o", ms=4, color=colour)
                axis.set_xticks([0, 1], ["without", "by reflex"])
                axis.set(title=f"cameras {label}", xlim=(-0.4, 1.4))
            top = max(axis.get_ylim()[1] for axis in axes)
            for axis in axes:
                axis.set_ylim(0.0, top)
            axes[0].set(ylabel="ball beside the gripper's axis (mm)")
        caption = (
            "Where the ball was beside the gripper's axis when the gripper began to close, by ground truth; lines join "
            "runs of one seed in which it did both times."
        )
        return [Figure("reflex", caption)]


def of_case(table: CampaignTable, cameras: str, reflex: bool, mismatch: str | None = None) -> Rows:
    """Return the runs of a case that came to their end, by what the reflex does not expect; None: nothing."""
    expected: Mapping[str, str] = {} if mismatch is None else MISMATCHES[mismatch]
    model = [float(expected[name] if name in expected else getattr(_USUAL, name)) for name in _OF_MODEL]
    rows = [row for row in table.rows if row["status"] == "done"]
    rows = [row for row in rows if [_setting(row, name) for name in _OF_MODEL] == model]
    return [row for row in rows if row["cameras"] == cameras and str(row["reflex"]).lower() == str(reflex).lower()]


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


def _setting(row: Row, name: str) -> float:
    """Return a parameter's value; a table of points that do not set it lacks its column."""
    value = row.get(name)
    return float(getattr(_USUAL, name) if value is None else value)


def _centres(claim: str, of_pairs: Sequence[tuple[Row, Row]]) -> Claim:
    d = offsets(of_pairs)
    test = paired_difference(d[:, 0], d[:, 1])
    if test is None:
        return nothing_measured(claim, beyond=True, reason="In no pair of runs did the gripper close both times.")
    medians = 1e3 * np.median(d, axis=0)
    return Claim(
        claim=claim,
        published="",
        measured=f"{medians[0]:.1f} mm without, {medians[1]:.1f} mm with it, in the median",
        interval=None if test.interval is None else (test.interval.low, test.interval.high),
        unit="m",
        verdict=verdict_of(test.p < LEVEL and test.difference < 0.0, could_be_either=len(d) >= _MIN_PAIRS),
        reason=f"Holds if Wilcoxon's signed-rank test, two-sided, of {counted(len(d), 'pair')} in which the "
        f"gripper closed both times rejects that nothing changes (p = {format_p_value(test.p)}) and the median "
        f"of the differences is below 0. The interval is that median's. Of {counted(len(of_pairs), 'pair')} the "
        "others say nothing here.",
        beyond=True,
    )


def _in_spite_of_mismatches(of_pairs: Mapping[str, Sequence[tuple[Row, Row]]]) -> Claim:
    claim = "With covered cameras the ball is nearer to the axis by the reflex, too, with each mismatch of its model"
    both_closed = {title: offsets(both) for title, both in of_pairs.items()}
    tests = {title: paired_difference(d[:, 0], d[:, 1]) for title, d in both_closed.items()}
    found = {title: test for title, test in tests.items() if test is not None}
    if len(found) < len(of_pairs):
        return nothing_measured(claim, beyond=True, reason="Not with each was there a pair that closed both times.")
    worst = max(found, key=lambda title: (found[title].difference >= 0.0, found[title].p))
    before, after = 1e3 * np.median(both_closed[worst], axis=0)
    return Claim(
        claim=claim,
        published="",
        measured=f"{worst}: {after:.1f} mm ({before:.1f} without)",
        verdict=verdict_of(
            all(test.p < LEVEL and test.difference < 0.0 for test in found.values()),
            could_be_either=min(map(len, both_closed.values())) >= _MIN_PAIRS,
        ),
        reason="Medians of the least clear; the table has all. Holds if for each of them Wilcoxon's signed-rank test, "
        f"two-sided, rejects at {format_share(LEVEL)}, and the median of the differences is below 0; as all must, no "
        f"correction is needed. Of the least clear there are {counted(len(both_closed[worst]), 'pair')}, p = "
        f"{format_p_value(found[worst].p)}.",
        beyond=True,
    )


def _table_of_mismatches(table: CampaignTable) -> ComparisonTable:
    cases: Mapping[str, str | None] = {"all as expected, but for tolerances": None, **{m: m for m in MISMATCHES}}
    header = ["what the reflex does not expect", "success", "closed", "beside the axis, mm", "along it, mm"]
    header += ["belief's error, mm", "as the ball left the hand, mm", "failed because"]
    cells = [[label, *_figures_of(of_case(table, "covered", True, m))] for label, m in cases.items()]
    note = (
        "Cameras covered within 50 mm, with the reflex; figures as above. Of its sensors the reflex knows the design: "
        "gain and range of each are 5 % off, directions 0.03 rad (1.7°) in each of two (one standard deviation)."
    )
    return ComparisonTable(title="A model that is wrong", header=header, rows=cells, note=note)


def _figures_of(rows: Rows) -> list[str]:
    """Return success, how many closed, medians of the offsets in mm, and reasons of failure; empty without runs."""
    if not rows:
        return [""] * 7
    closed = [row for row in rows if np.isfinite(_value(row, OFFSET))]
    medians = [
        format_median(1e3 * x[np.isfinite(x)], 1)
        for x in (
            np.array([_value(row, name) for row in closed])
            for name in (OFFSET, "closing_offset_axial", "felt_error", "grasp_offset_lateral")
        )
    ]
    taken = format_rate(sum(bool(row["success"]) for row in rows), len(rows))
    return [taken, f"{len(closed)}", *medians, reasons_of(rows)]


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
