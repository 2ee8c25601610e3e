"""The validation of the free-flyer's handovers: [Fernandes2020] sec. 4.3, figs. 4.29 to 4.38."""

from collections.abc import Sequence
from pathlib import Path
from typing import ClassVar

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.scenarios.campaign.plan import CampaignPlan
from handover.scenarios.campaign.table import CampaignTable
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.paper import paper_values
from handover.scenarios.free_flyer.handover.handovers import HandoverOfTask
from handover.scenarios.free_flyer.parameters import Behaviour, Propulsion, Task
from handover.scenarios.published.free_flyer.flyer_handover_claims import claims_of_handovers
from handover.scenarios.published.free_flyer.flyer_handover_figures import (
    draw_handovers,
    draw_margins,
    draw_strengths,
    draw_yielding,
    figure_number,
)
from handover.scenarios.published.free_flyer.handover_runs import (
    ARMS,
    AT_PUBLISHED_RATE,
    EXCHANGES,
    GIVING,
    PLACES,
    RATES,
    RECEIVING,
    STRENGTHS,
    THRUSTS,
    UNGATED,
    USUAL_FORCE,
    Exchange,
    HandoverRuns,
    point_of,
)
from handover.scenarios.published.free_flyer.variations import (
    PATIENCE,
    TASKS,
    USUAL,
    Row,
    Variation,
    acted_alone,
    succeeded,
    values_of,
)
from handover.scenarios.published.published_experiment import Claim, ComparisonTable, PublishedExperiment

_REPETITIONS = 3


class FlyerHandoverTable(PublishedExperiment):
    """The four handovers by the rigid and by the compliant robot, with ideal thrust, Astrobee's limits and its nozzles.

    Besides, where the robot gives: persons who pull with other forces, arms of other lengths, other places; and where
    it gives or receives: the control rate that the thesis prints, and a robot that yields while it still moves, for
    the thesis names no condition of rest. The quick plan is one run of each of the first 24.
    """

    name: ClassVar[str] = "flyer-handover"
    title: ClassVar[str] = "a free-flyer and a person hand an object over ([Fernandes2020] secs. 4.1.2, 4.3)"
    scenario: ClassVar[str] = HandoverOfTask.name

    def plan(self, quick: bool) -> CampaignPlan:
        """Return tasks x behaviours x propulsion, and what is beyond the thesis; if quick, the first alone."""
        limited, gives, receives = Propulsion.LIMITED, GIVING.task, RECEIVING.task
        points = [point_of(t, b, p) for t in Task for b in Behaviour for p in THRUSTS]
        if not quick:
            points += [point_of(gives, b, p, v) for v in STRENGTHS for p in THRUSTS for b in Behaviour]
            points += [point_of(gives, b, limited, v) for v in (*ARMS, *PLACES) for b in Behaviour]
            others = (*UNGATED, *RATES)
            points += [point_of(t, b, limited, v) for t in (gives, receives) for v in others for b in Behaviour]
        return CampaignPlan(
            scenario=self.scenario,
            points=points,
            fixed={"patience": PATIENCE},
            repetitions=1 if quick else _REPETITIONS,
            seed=1,
            paired=True,
            varied_units=() if quick else tuple(AT_PUBLISHED_RATE),
            experiment=self.name,
        )

    def claims(self, table: CampaignTable) -> Sequence[Claim]:
        """Judge secs. 4.1.2 and 4.3, and beyond them what the gate is for."""
        return claims_of_handovers(HandoverRuns(table))

    def tables(self, table: CampaignTable) -> Sequence[ComparisonTable]:
        """Return transfers, margins of the thresholds, and what force, arm, place, gate and rate change."""
        runs = HandoverRuns(table)
        tables = [_transfers(runs), _margins(runs), _varied(runs), _ungated(runs), _rates(runs)]
        return [t for t in tables if t.rows]

    def draw(self, table: CampaignTable, runs: Path, folder: Path) -> Sequence[Figure]:
        """Draw figs. 4.29 to 4.38, the gripper beside python-control's, margins, and displacement by force."""
        rows = HandoverRuns(table)
        over_time = [*draw_handovers(rows, runs, folder), *draw_yielding(rows, runs, folder)]
        return [*over_time, *draw_margins(rows, folder), *draw_strengths(rows, folder)]


def _transfers(runs: HandoverRuns) -> ComparisonTable:
    rows: list[list[str]] = []
    for exchange in EXCHANGES:
        for behaviour in Behaviour:
            for propulsion in THRUSTS:
                found = runs.of(exchange.task, behaviour, propulsion)
                if found:
                    like = figure_number(exchange, behaviour)
                    rows.append([like, exchange.label, behaviour.item, propulsion.item, *_facts(exchange, found)])
    return ComparisonTable(
        title="Transfers",
        header=[
            "like",
            "handover",
            "behaviour",
            "thrust",
            "received",
            "succeeded",
            "along x, mm",
            "along y, mm",
            "along z, mm",
            "in all, mm",
            "felt after, s",
            "taken after, s",
            "at the limits, %",
        ],
        rows=rows,
        note="Received: the receiver of this transfer got the object, whatever came of the rest. Medians of runs that "
        "succeeded, or in parentheses, where none did, of what they reached: how far the gripper went at most from its "
        "place along the axes of W from the signal for as long as the robot yielded, which is on after the object has "
        "left; the times from the last signal to release or closing, and from the first signal until the receiver had "
        "the object alone; and the share of the run for which more was commanded than the thrusters give. Published: "
        "40 mm (rigid) and 140 mm (compliant) along z where the robot gives, and twice as much of the compliant robot "
        "along x where it receives.",
    )


def _facts(exchange: Exchange, rows: Sequence[Row]) -> list[str]:
    done = _succeeded(rows)
    shown = done or rows
    away = [_mm(exchange.of(shown, f"displacement{axis}")) for axis in ("_x", "_y", "_z", "")]
    times = [_median(exchange.of(shown, what), "{:.1f}") for what in ("felt_after", "time")]
    share = _median(100.0 * values_of(shown, "saturated_share"), "{:.0f}")
    cells = [*away, *times, share]
    counts = [f"{n} of {len(rows)}" for n in (len(exchange.of(rows, "time")), len(done))]
    return [*counts, *(cells if done else [f"({cell})" if cell else "" for cell in cells])]


def _succeeded(rows: Sequence[Row]) -> list[Row]:
    return [row for row in rows if succeeded([row])]


def _margins(runs: HandoverRuns) -> ComparisonTable:
    rows: list[list[str]] = []
    for exchange in EXCHANGES:
        for behaviour in Behaviour:
            for propulsion in THRUSTS:
                found = runs.of(exchange.task, behaviour, propulsion)
                if not found:
                    continue
                threshold = exchange.threshold(behaviour)
                rest, felt = exchange.of(found, "rest_speed"), exchange.of(found, "speed")
                margin = f"{threshold / rest.max():.1f}" if len(rest) and rest.max() > 0.0 else ""
                rows.append(
                    [
                        exchange.label,
                        behaviour.item,
                        propulsion.item,
                        f"{threshold:.3f}",
                        f"{rest.max():.4f}" if len(rest) else "",
                        margin,
                        _range(felt, "{:.3f}"),
                        _range(np.degrees(values_of(found, "angle_full")), "{:.1f}"),
                        _range(np.degrees(values_of(found, "angle_empty")), "{:.1f}"),
                    ]
                )
    beta = float(paper_values("free_flyer", "published")["angle_threshold"])
    return ComparisonTable(
        title="Margins of the thresholds",
        header=[
            "handover",
            "behaviour",
            "thrust",
            "threshold, m/s",
            "at rest, m/s",
            "threshold over rest",
            "when felt, m/s",
            "angle if full, °",
            "angle if empty, °",
        ],
        rows=rows,
        note="Speeds of the gripper as the robot sees it: the greatest in any run while it waits and nobody touches "
        "it, and those at which it took its motion for a touch, from least to greatest. Angles of the closed gripper "
        f"with the object in it and without, which the robot separates at {np.degrees(beta):.1f}°; what they are is "
        "assumed here.",
    )


def _varied(runs: HandoverRuns) -> ComparisonTable:
    rows: list[list[str]] = []
    usual = Variation(f"as usual, {USUAL_FORCE}")
    for variation in (usual, *STRENGTHS, *ARMS, *PLACES):
        for propulsion in THRUSTS:
            found = [runs.of(GIVING.task, b, propulsion, variation) for b in Behaviour]
            if not all(found):
                continue
            done = [_succeeded(rows_of) for rows_of in found]
            away = [GIVING.of(rows_of, "displacement_z") for rows_of in done]
            ratio = f"{np.median(away[1]) / np.median(away[0]):.1f}" if all(len(x) for x in away) else ""
            felt = [f"{len(GIVING.of(rows_of, 'speed'))} of {len(rows_of)}" for rows_of in found]
            whole = [f"{len(rows_of)} of {len(all_of)}" for rows_of, all_of in zip(done, found, strict=True)]
            shares = [_median(100.0 * values_of(rows_of, "saturated_share"), "{:.0f}") for rows_of in found]
            cells = [*felt, *whole, *map(_mm, away), ratio, " and ".join(shares)]
            rows.append([variation.label, propulsion.item, *cells])
    shown = rows if any(row[0] != usual.label for row in rows) else []
    return ComparisonTable(
        title="Where the behaviours differ, as the robot gives",
        header=[
            "case",
            "thrust",
            "rigid felt it",
            "compliant felt it",
            "rigid succeeded",
            "compliant succeeded",
            "rigid along z, mm",
            "compliant along z, mm",
            "compliant over rigid",
            "at the limits, %",
        ],
        rows=shown,
        note="How often the robot took a motion for the pull of a person who pulls with at most that force, how often "
        "the handover succeeded, and, of those that did, medians of how far the gripper went along z: what an unfelt "
        "pull does is in the figure by force. Published: 40 and 140 mm, 3.5 times as far. Arms are those of the robot "
        "and of its controllers' model. Shares of the run at the limits of thrust: rigid and compliant.",
    )


def _ungated(runs: HandoverRuns) -> ComparisonTable:
    rows: list[list[str]] = []
    for exchange in (GIVING, RECEIVING):
        for behaviour in Behaviour:
            cells: list[str] = []
            for variation in (USUAL, *UNGATED):
                found = runs.of(exchange.task, behaviour, Propulsion.LIMITED, variation)
                alone = acted_alone(found)
                cells.append(f"{alone} of {len(found)}" if found else "")
            if cells[-1]:
                rows.append([exchange.label, behaviour.item, *cells])
    return ComparisonTable(
        title="Without a gate to the impedance control",
        header=["handover", "behaviour", "at rest", *(v.label for v in UNGATED)],
        rows=rows,
        note="How many robots let go, or closed, with nobody at the gripper: those that yield and signal only once "
        "they are at rest in their place, and those that do so as soon as they are so near it, still moving. "
        "Astrobee's software takes 10 to 20 cm for having arrived; the thesis names no condition.",
    )


def _rates(runs: HandoverRuns) -> ComparisonTable:
    rows: list[list[str]] = []
    for exchange in (GIVING, RECEIVING):
        for behaviour in Behaviour:
            found = [runs.of(exchange.task, behaviour, Propulsion.LIMITED, v)[:1] for v in RATES]
            away = [exchange.of(one, "displacement") for one in found]
            if all(len(x) for x in away):
                times = [_median(exchange.of(one, "felt_after"), "{:.3f}") for one in found]
                difference = f"{1e3 * (away[1][0] - away[0][0]):+.2f}"
                rows.append([exchange.label, behaviour.item, *(f"{1e3 * x[0]:.2f}" for x in away), difference, *times])
    return ComparisonTable(
        title="Control at the rate that the thesis prints",
        header=[
            "handover",
            "behaviour",
            "at 62.5 Hz, mm",
            "at 67.5 Hz, mm",
            "difference, mm",
            "felt at 62.5 Hz after, s",
            "felt at 67.5 Hz after, s",
        ],
        rows=rows,
        note="How far the gripper went from its place at most, with Astrobee's limits, in a run in which nothing is "
        "random: neither noise, tremor nor errors of sight and timing, and always the same reaction and effort. What "
        f"differs is the rate of decision and controllers alone. {TASKS[Task.ROBOT_TO_HUMAN].capitalize()} the gripper "
        "goes on until it has opened, so a release that comes a sample later adds what it moves in that time.",
    )


def _mm(metres: Floats) -> str:
    return _median(1e3 * metres, "{:.0f}")


def _median(values: Floats, form: str) -> str:
    return form.format(float(np.median(values))) if len(values) else ""


def _range(values: Floats, form: str) -> str:
    if not len(values):
        return ""
    low, high = (form.format(float(x)) for x in (values.min(), values.max()))
    return low if low == high else f"{low} to {high}"
