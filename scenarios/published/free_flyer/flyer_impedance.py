"""The validation of the free-flyer's impedance control: [Fernandes2020] sec. 4.1.3, figs. 4.5 to 4.16."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import ClassVar

import numpy as np
from matplotlib.axes import Axes

from handover.cosim.blocks.ports import Floats
from handover.cosim.record.reader import Record
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.paper import paper_values
from handover.scenarios.experiment.plotting import COLOURS
from handover.scenarios.published.claims import Statement
from handover.scenarios.published.figures import SOFT, Drawable, Mark, Panel, drawn, level, records_of
from handover.scenarios.published.free_flyer.handovers import EXACT, Variation, factor_of, published, unfinished_note
from handover.scenarios.published.free_flyer.linear_model import PUSHES, Push, predicted_errors, predicted_greatest
from handover.scenarios.published.published_experiment import Claim, ComparisonTable, PublishedExperiment
from handover.scenarios.published.runs import Point, Row, Runs, is_done, is_known
from handover.scenarios.published.tables import table_of
from handover.scenarios.robots.free_flyer.parameters import Axis, Behaviour, ImpedanceParameters, Propulsion, Wrench
from handover.scenarios.robots.free_flyer.push.impedance import FlyerImpedance
from handover.scenarios.robots.free_flyer.push.impedance_evaluation import Errors, Motion, errors_of
from handover.scenarios.runs.campaign.plan import CampaignPlan
from handover.scenarios.runs.campaign.table import CampaignTable

DURATIONS = (0.1, 0.2, 0.5, 1.0, 2.0, 3.0, 5.0, 8.0, 12.0, 20.0)
"""How long forces last whose ratio of compliant to rigid errors is looked at, s."""
CHANGES = tuple(
    factor_of(what, name, factor)
    for what, name in (("mass", "mass_factor"), ("inertia", "inertia_factor"), ("arm's length", "arm_factor"))
    for factor in (0.7, 1.3)
)
"""Robots that are not what their controller assumes."""
_IDEAL, _LIMITED = ({"propulsion": p.item} for p in (Propulsion.IDEAL, Propulsion.LIMITED))
_USUAL = ImpedanceParameters().duration
_CASES = [*product(Behaviour, PUSHES)]
_WHERE = "sec. 4.1.3"
_AS_PUBLISHED = 0.05
"""Part of a published ratio by which ours may differ: the thesis prints it without digits after the point."""
_EXACT = (0.001, 0.002)
"""By how much the motion may differ from eq. (4.4) without noise, m and rad."""
_PREDICTED = 0.05
"""Part of a greatest error by which the linear model's may differ."""


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
        forces = [case for case in _CASES if case[1].kind is Wrench.FORCE]
        others = [{"duration": f"{d:g}"} for d in DURATIONS if d != _USUAL]
        tried = [(_CASES, _IDEAL), (_CASES, _LIMITED), (_CASES, {**_IDEAL, **EXACT})]
        tried += [(forces, {**_IDEAL, **duration}) for duration in others]
        tried += [(_CASES, {**_IDEAL, **change.parameters}) for change in CHANGES]
        points = [_point(*case, given) for cases, given in (tried[:1] if quick else tried) for case in cases]
        return self.campaign(points, seed=1)

    def claims(self, table: CampaignTable) -> Sequence[Claim]:
        """Judge the discussion of sec. 4.1.3, and beyond it the model, and the robot with its limits."""
        runs, bounds = PushRuns(table), paper_values("free_flyer", "published")["model_agreement"]
        within = f"within {1e3 * bounds[0]:.0f} mm and {np.degrees(bounds[1]):.1f}° ({bounds[1]:g} rad)"
        model = "he motion is the impedance model's"
        return [
            _ratio(runs),
            _yields_more(runs),
            _comes_back(runs),
            _agreement(Statement(f"T{model}", f"{_WHERE}, eq. (4.4)", within), runs.all_of(), bounds),
            _agreement(Statement(f"Without noise of the navigation t{model}"), runs.all_of(EXACT), _EXACT),
            _foreseen(runs),
            _bears_limits(runs),
            _tells_wrong_models(runs, bounds),
        ]

    def tables(self, table: CampaignTable) -> Sequence[ComparisonTable]:
        """Return greatest errors and agreement of every push, ratios by duration, and what a wrong model does."""
        runs = PushRuns(table)
        ratios = [row for d in DURATIONS if (row := _ratios(runs, d))]
        changes = [row for change, b in product(CHANGES, Behaviour) if (row := _changed(runs, change, b))]
        return [
            table_of(
                f"Pushes of {_USUAL:g} s",
                [_push(runs, *case) for case in _CASES],
                "Greatest errors of the gripper's position and orientation with ideal thrust, and the push's own one "
                "by the linear response of the controller's model. Off eq. (4.4): the largest difference along any "
                "axis (published: at most 7 mm and 1.1°). Then greatest errors with Astrobee's limits of thrust, and "
                "whether the robot comes back to rest within a minute.",
            ),
            *([table_of(
                "How much farther the compliant robot yields",
                ratios,
                "Compliant over rigid: greatest position errors under 5 N with ideal thrust. The thesis says 10, and "
                "not how long its pushes lasted. The stiffnesses differ by 10, which a push reaches that is long "
                "against the compliant robot's period; one that is short against both leaves the root of it.",
            )] if len(ratios) > 1 else []),
            *([table_of(
                "A robot that is not what its controller assumes",
                changes,
                "The largest difference to eq. (4.4) over the six pushes with ideal thrust, and after how many of them "
                "the robot came back to rest within a minute. By an arm of another length than it is taken for, the "
                "gripper comes to rest beside its place.",
            )] if changes else []),
        ]  # fmt: skip

    def draw(self, table: CampaignTable, runs: Path, folder: Path) -> Sequence[Figure]:
        """Draw figs. 4.5 to 4.16 with the linear model's prediction, and the ratio by duration."""
        found = PushRuns(table)
        errors = [f for b, kind in product(Behaviour, Wrench) for f in _draw_errors(found, runs, folder, b, kind)]
        return [*errors, *_draw_ratios(found, folder)]


def _point(behaviour: Behaviour, push: Push, given: Point) -> Point:
    return {**push.parameters, "behaviour": behaviour.item, **given}


class PushRuns:
    """Runs of the campaign by what they are for."""

    def __init__(self, table: CampaignTable) -> None:
        self._runs = FlyerImpedanceTable().runs(table, is_known)

    def of(self, push: Push, behaviour: Behaviour, given: Point = _IDEAL) -> Row | None:
        """Return the run of a push that came to its end, None where there is none."""
        found = self._runs.of(_point(behaviour, push, {**_IDEAL, **given}))
        return next((row for row in found if is_done(row)), None)

    def done(self, behaviour: Behaviour, given: Point) -> list[Row]:
        """Return the runs of the six pushes that came to their end."""
        return [row for push in PUSHES if (row := self.of(push, behaviour, given)) is not None]

    def all_of(self, given: Point = _IDEAL) -> Runs:
        """Return all runs of the six pushes under both behaviours; those that did not end have no metrics."""
        return self._runs.of(*(_point(*case, {**_IDEAL, **given}) for case in _CASES))

    def ratio(self, axis: Axis, duration: float) -> float | None:
        """Return compliant over rigid greatest position error under a force along an axis; None without both runs."""
        push = Push(Wrench.FORCE, axis)
        rigid, compliant = (self.of(push, b, {"duration": f"{duration:g}"}) for b in Behaviour)
        return None if rigid is None or compliant is None else float(compliant[push.metric] / rigid[push.metric])


def _ratio(runs: PushRuns) -> Claim:
    theirs = published("compliant_over_rigid")
    where = f"{_WHERE}, discussion"
    says = Statement("A force takes the compliant robot ten times as far as the rigid one", where, f"{theirs:g}")
    found = {d: [r for axis in Axis if (r := runs.ratio(axis, d)) is not None] for d in DURATIONS}
    tried = {d: ratios for d, ratios in found.items() if len(ratios) == len(Axis)}
    if not tried:
        return says.unknown()
    fits = [d for d, ratios in tried.items() if all(abs(r / theirs - 1.0) <= _AS_PUBLISHED for r in ratios)]
    shown = [tried[d] + [d] for d in sorted({_USUAL, max(tried)} & set(tried))]
    return says.judged(
        " and ".join(f"{min(x, y, z):.1f} to {max(x, y, z):.1f} after {d:g} s" for x, y, z, d in shown),
        bool(fits),
        f"there is a duration among those tried, {min(DURATIONS):g} to {max(DURATIONS):g} s, at which the ratio is "
        f"within {100 * _AS_PUBLISHED:.0f} % of it along all three axes",
        "The thesis does not say how long its pushes lasted." + (f" It is so from {min(fits):g} s on." if fits else ""),
        enough=len(tried) == len(DURATIONS),
    )


def _yields_more(runs: PushRuns) -> Claim:
    says = Statement("Under every push the compliant robot yields more", f"{_WHERE}, discussion", "in all directions")
    pairs = [(push, runs.of(push, Behaviour.RIGID), runs.of(push, Behaviour.COMPLIANT)) for push in PUSHES]
    ratios = [float(c[push.metric]) / float(r[push.metric]) for push, r, c in pairs if r is not None and c is not None]
    if not ratios:
        return says.unknown()
    return says.judged(
        f"{min(ratios):.1f} to {max(ratios):.1f} times as much",
        min(ratios) > 1.0,
        "each of the six pushes moves the compliant robot's gripper farther, or turns it more, than the rigid one's",
        enough=len(ratios) == len(PUSHES),
    )


def _comes_back(runs: PushRuns) -> Claim:
    says = Statement("The robot comes back to rest after a push", f"{_WHERE}, discussion", "for both behaviours")
    tried = runs.all_of()
    if not len(tried):
        return says.unknown()
    times = tried.metric("settling_time")
    within = f", within {times.max():.0f} s of the push's end" if len(times) else ""
    return says.judged(
        f"{len(times)} of {len(tried)}{within}",
        len(times) == len(tried),
        "the gripper is back at rest within a minute in all twelve, with ideal thrust",
        unfinished_note(tried),
        enough=len(tried) == len(_CASES),
    )


def _agreement(says: Statement, runs: Runs, bounds: Sequence[float]) -> Claim:
    if not len(runs):
        return says.unknown()
    off = [runs.metric(f"disagreement_{what}").max(initial=0.0) for what in ("position", "orientation")]
    return says.judged(
        f"{1e3 * off[0]:.2f} mm and {np.degrees(off[1]):.3f}° at most, of {len(runs)}",
        all(map(is_done, runs)) and bool(off[0] <= bounds[0] and off[1] <= bounds[1]),
        f"no actual error differs from eq. (4.4)'s by more than {1e3 * bounds[0]:g} mm along an axis or "
        f"{np.degrees(bounds[1]):.2g}° in any of the twelve, with ideal thrust",
        unfinished_note(runs),
        enough=len(runs) == len(_CASES),
    )


def _foreseen(runs: PushRuns) -> Claim:
    says = Statement("The linear response of the controller's model predicts the greatest errors")
    off: dict[str, float] = {}
    for b, push in _CASES:
        if (row := runs.of(push, b, EXACT)) is not None:
            off[f"{push.label}, {b.item}"] = abs(float(row[push.metric]) / predicted_greatest(push, b, _USUAL) - 1.0)
    if not off:
        return says.unknown()
    most = max(off, key=lambda name: off[name])
    return says.judged(
        f"{100 * off[most]:.1f} % off at most ({most})",
        off[most] <= _PREDICTED,
        f"it is within {100 * _PREDICTED:.0f} % of what ideal thrust and exact navigation give, under each push",
        "It is the response near rest: a robot that turns by a radian is beyond that.",
        enough=len(off) == len(_CASES),
    )


def _bears_limits(runs: PushRuns) -> Claim:
    says = Statement("With Astrobee's limits of thrust the robot comes back from the same pushes")
    tried = runs.all_of(_LIMITED)
    if not len(tried):
        return says.unknown()
    back = [row for row in tried if row.get("settling_time") is not None]
    return says.judged(
        f"{len(back)} of {len(tried)}, {sum(row['kind'] == 'torque' for row in back)} of them twists",
        len(back) == len(tried),
        "all twelve end at rest within a minute",
        f"What is published needs thrust without limits: 3 N·m is forty times what Astrobee has. "
        f"{unfinished_note(tried)}",
        enough=len(tried) == len(_CASES),
    )


def _tells_wrong_models(runs: PushRuns, bounds: Sequence[float]) -> Claim:
    says = Statement("A mass or an inertia that is 30 % off shows in how far the motion departs from the model")
    planned = [*product((c for c in CHANGES if "arm_factor" not in c.parameters), Behaviour)]
    cases = [rows for change, b in planned if (rows := runs.done(b, change.parameters))]
    if not cases:
        return says.unknown()
    names = ("disagreement_position", "disagreement_orientation")
    shown = sum(any(row[n] > x for row in rows for n, x in zip(names, bounds, strict=True)) for rows in cases)
    return says.judged(
        f"in {shown} of {len(cases)} cases",
        shown == len(cases),
        "under one of the six pushes at least the motion is farther from eq. (4.4) than the thesis's bound, for each "
        "of mass and inertia, up and down, and both behaviours",
        enough=len(cases) == len(planned),
    )


def _push(runs: PushRuns, behaviour: Behaviour, push: Push) -> dict[str, str]:
    usual, exact, limited = (runs.of(push, behaviour, given) for given in (_IDEAL, EXACT, _LIMITED))
    predicted = predicted_greatest(push, behaviour, _USUAL)
    return {
        "like": push.figure_number(behaviour),
        "push": push.label,
        "behaviour": behaviour.item,
        "greatest errors": _errors(usual),
        "by python-control": _length(predicted) if push.kind is Wrench.FORCE else _angle(predicted),
        "off eq. (4.4) by": _off(usual),
        "without noise": _off(exact),
        "errors with limits": _errors(limited),
        "back with limits": "" if limited is None else ("yes" if _is_back(limited) else "no"),
    }


def _ratios(runs: PushRuns, duration: float) -> dict[str, str]:
    """Return a row; {} without a ratio."""
    found = {axis: runs.ratio(axis, duration) for axis in Axis}
    if all(ratio is None for ratio in found.values()):
        return {}
    return {
        "duration, s": f"{duration:g}",
        **{f"along {a.name.lower()}": "" if r is None else f"{r:.1f}" for a, r in found.items()},
        "by python-control, x, y, z": ", ".join(f"{_predicted_ratio(axis, duration):.1f}" for axis in Axis),
    }


def _changed(runs: PushRuns, change: Variation, behaviour: Behaviour) -> dict[str, str]:
    """Return a row; {} without runs."""
    found = runs.done(behaviour, change.parameters)
    if not found:
        return {}
    off = [max(float(row[f"disagreement_{what}"]) for row in found) for what in ("position", "orientation")]
    return {
        "robot": change.label,
        "behaviour": behaviour.item,
        "position off eq. (4.4)": _length(off[0]),
        "orientation off eq. (4.4)": _angle(off[1]),
        "back at rest": f"{sum(map(_is_back, found))} of {len(found)}",
    }


def _predicted_ratio(axis: Axis, duration: float) -> float:
    rigid, compliant = (predicted_greatest(Push(Wrench.FORCE, axis), b, duration) for b in Behaviour)
    return compliant / rigid


def _is_back(row: Row) -> bool:
    return row.get("settling_time") is not None


def _errors(row: Row | None) -> str:
    if row is None:
        return ""
    return f"{_length(row['greatest_position_error'])}, {_angle(row['greatest_orientation_error'])}"


def _off(row: Row | None) -> str:
    if row is None:
        return ""
    return f"{1e3 * row['disagreement_position']:.2f} mm, {np.degrees(row['disagreement_orientation']):.2f}°"


def _length(metres: float) -> str:
    return f"{1e3 * metres:.0f} mm" if metres < 1.0 else f"{metres:.1f} m"


def _angle(radians: float) -> str:
    return f"{np.degrees(radians):.1f}°"


_SHOWN = {Behaviour.RIGID: 8.0, Behaviour.COMPLIANT: 20.0}
"""Time that is drawn, s: until the gripper is nearly at rest."""
_UNITS = (("position", "mm", 1e3, 20.0), ("orientation", "°", float(np.degrees(1.0)), 2.0))
"""What is drawn, its unit, how many of it a metre or a radian is, and what an axis shows at least, up and down."""
_STROKES = {"actual": "-", "calculated by eq. (4.4)": "--", "by python-control": ":"}


@dataclass(frozen=True)
class _Shade:
    """The time of the push, and what an axis shows at least."""

    least: float

    def draw(self, axes: Axes) -> None:
        p = ImpedanceParameters()
        axes.axvspan(p.begin, p.end, color="#eef2f7", lw=0)
        axes.plot([p.begin] * 2, [-self.least, self.least], alpha=0.0)


def _draw_errors(runs: PushRuns, folders: Path, folder: Path, behaviour: Behaviour, kind: Wrench) -> list[Figure]:
    panels: list[Panel] = []
    numbers: list[str] = []
    for push in (Push(kind, axis) for axis in Axis):
        row = runs.of(push, behaviour)
        for record in records_of([] if row is None else [row["run"]], folders):
            panels += _panels(push, behaviour, _errors_of(record, behaviour))
            numbers.append(push.figure_number(behaviour).removeprefix("fig. "))
    shown = "figs." if len(numbers) > 1 else "fig."
    caption = (
        f"Errors of the gripper's pose in W, rest minus actual, of the {behaviour.item} robot with ideal thrust, like "
        f"{shown} {' to '.join(numbers[:: max(1, len(numbers) - 1)])}: actual, calculated by eq. (4.4) (dashed), and "
        "the linear response by python-control (dotted). Shaded: the push."
    )
    size = (9.0, 0.9 + 2.1 * len(numbers))
    return drawn(folder / f"errors_{behaviour.item}_{kind.name.lower()}", caption, panels, 2, size=size)


def _errors_of(record: Record, behaviour: Behaviour) -> Errors:
    p_WG_goal = np.array(paper_values("free_flyer", "push_place")["p_WG_goal"])
    return errors_of(Motion.of(record, record.time), p_WG_goal, behaviour, ImpedanceParameters().model)


def _panels(push: Push, behaviour: Behaviour, errors: Errors) -> list[Panel]:
    shown = errors.t <= _SHOWN[behaviour]
    t = errors.t[shown]
    predicted = predicted_errors(push, behaviour, _USUAL, t)
    turned, turned_model = errors.without_jumps
    panels: list[Panel] = []
    for (what, unit, scale, least), actual, model, linear in zip(
        _UNITS, (errors.p, turned), (errors.p_model, turned_model), predicted, strict=True
    ):
        curves: tuple[Floats, ...] = (actual[shown], model[shown], linear)
        marks: list[Drawable] = [_Shade(least)]
        for values, form in zip(curves, _STROKES.values(), strict=True):
            marks += [Mark(t, scale * values[:, k], form, COLOURS[k]) for k in range(3)]
        marks += [Mark(form="-", colour=COLOURS[k], label="xyz"[k]) for k in range(3)]
        marks += [Mark(form=form, label=name) for name, form in _STROKES.items()]
        axes = {"title": push.label, "xlabel": "time (s)", "ylabel": f"{what} error ({unit})"}
        panels.append(Panel(marks, {**axes, "xlim": (0.0, _SHOWN[behaviour])}))
    return panels


def _draw_ratios(runs: PushRuns, folder: Path) -> list[Figure]:
    """Draw compliant over rigid greatest errors by the force's duration, and the linear model's."""
    found = {axis: [(d, r) for d in DURATIONS if (r := runs.ratio(axis, d)) is not None] for axis in Axis}
    if any(len(points) < 2 for points in found.values()):
        return []
    durations: list[float] = np.geomspace(min(DURATIONS), max(DURATIONS), 24).tolist()
    marks: list[Drawable] = [level(published("compliant_over_rigid"), SOFT, "published")]
    for axis, points in found.items():
        marks.append(Mark(durations, [_predicted_ratio(axis, d) for d in durations], ":", COLOURS[axis]))
        marks.append(Mark.through(points, "o", COLOURS[axis], f"along {axis.name.lower()}"))
    marks.append(Mark(form=":", label="python-control"))
    axes = {"xscale": "log", "xlabel": "duration of the push (s)", "ylabel": "compliant over rigid (1)"}
    caption = (
        "Greatest position error of the compliant robot over that of the rigid one under 5 N with ideal thrust, by how "
        "long the force lasts, which the thesis does not say."
    )
    return drawn(folder / "ratio", caption, [Panel(marks, {**axes, "ylim": (0.0, None)})], size=(8.0, 3.4))
