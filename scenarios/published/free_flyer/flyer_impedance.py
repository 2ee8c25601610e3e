"""The validation of the free-flyer's impedance control: [Fernandes2020] sec. 4.1.3, figs. 4.5 to 4.16."""

from collections.abc import Sequence
from pathlib import Path
from typing import ClassVar

import numpy as np

from handover.scenarios.campaign.plan import CampaignPlan
from handover.scenarios.campaign.table import CampaignTable
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.free_flyer.parameters import Axis, Behaviour, ImpedanceParameters, Propulsion, Wrench
from handover.scenarios.free_flyer.push.impedance import FlyerImpedance
from handover.scenarios.published.free_flyer.flyer_impedance_claims import claims_of_pushes
from handover.scenarios.published.free_flyer.flyer_impedance_figures import draw_errors, draw_ratios
from handover.scenarios.published.free_flyer.push_runs import (
    CHANGES,
    DURATIONS,
    PUSHES,
    Push,
    PushRuns,
    predicted_greatest,
)
from handover.scenarios.published.free_flyer.variations import EXACT, Row
from handover.scenarios.published.published_experiment import Claim, ComparisonTable, PublishedExperiment

_IDEAL, _LIMITED = ({"propulsion": p.item} for p in (Propulsion.IDEAL, Propulsion.LIMITED))


class FlyerImpedanceTable(PublishedExperiment):
    """Six pushes on the rigid and on the compliant robot, with ideal thrust and with Astrobee's limits.

    Besides: with a navigation without noise; with forces that last from 0.1 to 20 s; and on a robot whose mass, inertia
    or arm is not what its controller assumes. The thesis does not say how long its pushes lasted; here it is 0.5 s.
    Ideal thrust has neither limits nor lag, as its plots need. The quick plan is the twelve pushes with ideal thrust.
    """

    name: ClassVar[str] = "flyer-impedance"
    title: ClassVar[str] = "a free-flyer's gripper is pushed and twisted ([Fernandes2020] sec. 4.1.3)"
    scenario: ClassVar[str] = FlyerImpedance.name

    def plan(self, quick: bool) -> CampaignPlan:
        """Return pushes x behaviours x thrust, and what is beyond the thesis; if quick, with ideal thrust alone."""
        pushed = [{**push.parameters, "behaviour": b.item} for b in Behaviour for push in PUSHES]
        points = [{**point, **_IDEAL} for point in pushed]
        if not quick:
            forces = [point for point in pushed if point["kind"] == Wrench.FORCE.name.lower()]
            others = [d for d in DURATIONS if d != ImpedanceParameters().duration]
            points += [{**point, **_LIMITED} for point in pushed]
            points += [{**point, **_IDEAL, **EXACT} for point in pushed]
            points += [{**point, **_IDEAL, "duration": f"{d:g}"} for d in others for point in forces]
            points += [{**point, **_IDEAL, **change.parameters} for change in CHANGES for point in pushed]
        return CampaignPlan(scenario=self.scenario, points=points, seed=1, experiment=self.name)

    def claims(self, table: CampaignTable) -> Sequence[Claim]:
        """Judge the discussion of sec. 4.1.3, and beyond it the model, and the robot with its limits."""
        return claims_of_pushes(PushRuns(table))

    def tables(self, table: CampaignTable) -> Sequence[ComparisonTable]:
        """Return greatest errors and agreement of every push, ratios by duration, and what a wrong model does."""
        runs = PushRuns(table)
        return [_pushes(runs), *_ratios(runs), *_changes(runs)]

    def draw(self, table: CampaignTable, runs: Path, folder: Path) -> Sequence[Figure]:
        """Draw figs. 4.5 to 4.16 with the linear model's prediction, and the ratio by duration."""
        rows = PushRuns(table)
        return [*draw_errors(rows, runs, folder), *draw_ratios(rows, folder)]


def _pushes(runs: PushRuns) -> ComparisonTable:
    duration = ImpedanceParameters().duration
    rows: list[list[str]] = []
    for behaviour in Behaviour:
        for push in PUSHES:
            limited = runs.of(push, behaviour, propulsion=Propulsion.LIMITED)
            predicted = predicted_greatest(push, behaviour, duration)
            rows.append(
                [
                    push.figure_number(behaviour),
                    push.label,
                    behaviour.item,
                    _errors(runs.of(push, behaviour)),
                    _length(predicted) if push.kind is Wrench.FORCE else _angle(predicted),
                    _agreement(runs.of(push, behaviour)),
                    _agreement(runs.of(push, behaviour, exact=True)),
                    _errors(limited),
                    "" if limited is None else ("yes" if _is_back(limited) else "no"),
                ]
            )
    return ComparisonTable(
        title=f"Pushes of {duration:g} s",
        header=[
            "like",
            "push",
            "behaviour",
            "greatest errors",
            "by python-control",
            "off eq. (4.4) by",
            "without noise",
            "errors with limits",
            "back with limits",
        ],
        rows=rows,
        note="Greatest errors of the gripper's position and orientation with ideal thrust; the push's own one by the "
        "linear response of the controller's model; the largest difference to eq. (4.4) along any axis, with and "
        "without the navigation's noise (published: at most 7 mm and 1.1°, its 0.02 rad); greatest errors with "
        "Astrobee's limits of thrust, and whether the robot then comes back to rest within a minute.",
    )


def _ratios(runs: PushRuns) -> list[ComparisonTable]:
    rows: list[list[str]] = []
    for duration in DURATIONS:
        ratios = [runs.ratio(axis, duration) for axis in Axis]
        if any(ratio is not None for ratio in ratios):
            predicted = [_predicted_ratio(axis, duration) for axis in Axis]
            cells = ["" if r is None else f"{r:.1f}" for r in ratios]
            rows.append([f"{duration:g}", *cells, ", ".join(f"{r:.1f}" for r in predicted)])
    if len(rows) < 2:
        return []
    return [
        ComparisonTable(
            title="How much farther the compliant robot yields",
            header=["duration, s", "along x", "along y", "along z", "by python-control, x, y, z"],
            rows=rows,
            note="Compliant over rigid: greatest position errors under 5 N with ideal thrust. The thesis says 10, and "
            "not how long its pushes lasted. The stiffnesses differ by 10, which a push reaches that is long against "
            "the compliant robot's period; one that is short against both leaves the root of it.",
        )
    ]


def _changes(runs: PushRuns) -> list[ComparisonTable]:
    rows: list[list[str]] = []
    for change in CHANGES:
        for behaviour in Behaviour:
            found = [row for push in PUSHES if (row := runs.of(push, behaviour, change=change)) is not None]
            if found:
                off = [max(float(row[f"disagreement_{what}"]) for row in found) for what in ("position", "orientation")]
                back = sum(_is_back(row) for row in found)
                rows.append([change.label, behaviour.item, _length(off[0]), _angle(off[1]), f"{back} of {len(found)}"])
    if not rows:
        return []
    return [
        ComparisonTable(
            title="A robot that is not what its controller assumes",
            header=["robot", "behaviour", "position off eq. (4.4)", "orientation off eq. (4.4)", "back at rest"],
            rows=rows,
            note="The largest difference to eq. (4.4), with the controller's values in it, over the six pushes with "
            "ideal thrust, and after how many of them the robot came back to rest within a minute. By an arm of "
            "another length than it is taken for, the gripper comes to rest beside its place.",
        )
    ]


def _predicted_ratio(axis: Axis, duration: float) -> float:
    push = Push(Wrench.FORCE, axis)
    rigid, compliant = (predicted_greatest(push, b, duration) for b in (Behaviour.RIGID, Behaviour.COMPLIANT))
    return compliant / rigid


def _is_back(row: Row) -> bool:
    return row.get("settling_time") is not None


def _errors(row: Row | None) -> str:
    if row is None:
        return ""
    return f"{_length(row['greatest_position_error'])}, {_angle(row['greatest_orientation_error'])}"


def _agreement(row: Row | None) -> str:
    if row is None:
        return ""
    return f"{1e3 * row['disagreement_position']:.2f} mm, {np.degrees(row['disagreement_orientation']):.2f}°"


def _length(metres: float) -> str:
    return f"{1e3 * metres:.0f} mm" if metres < 1.0 else f"{metres:.1f} m"


def _angle(radians: float) -> str:
    return f"{np.degrees(radians):.1f}°"
