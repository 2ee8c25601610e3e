"""Curves over time of pushes on the free-flyer: errors, as in [Fernandes2020] figs. 4.5-4.16, the push, and thrust.

The commanded wrench is beside that of the thrusters (`plot_thrust`), of handovers, too.
"""

from collections.abc import Sequence

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.cosim.record.reader import Record
from handover.scenarios.experiment.paper import paper_values
from handover.scenarios.experiment.time_plot import Curve, Phase, Stroke, TimeFigure, TimePlot
from handover.scenarios.robots.free_flyer.parameters import ImpedanceParameters, Wrench
from handover.scenarios.robots.free_flyer.push.hand_push import HandPush
from handover.scenarios.robots.free_flyer.push.impedance_evaluation import Motion, errors_of

_BEYOND = 2.0
"""Range of the plots, over the thrusters' maximum output: a command may be twenty times as much."""
_ROOM = 1.1
"""Range of the plots over the largest value, where that is smaller."""
_QUANTITIES = (("f", "Force", "N"), ("tau", "Torque", "N·m"))

CAPTION_OF_PUSH = "The push on the gripper in W, and what somebody pushed the robot with by hand, if anybody did."
CAPTION = "Force and torque on the robot in B; dotted: as commanded, where the thrusters give less, cut off far beyond."


def plot_thrust(
    record: Record,
    controllers: Sequence[str],
    phases: Sequence[Phase],
    thrusters: str = "thrusters",
    whose: str = "the thrusters",
) -> list[TimePlot]:
    """Return force and torque on the robot along each axis of B; commands of several controllers are added.

    So do the thrusters. The axes of a quantity show one range, that of what the thrusters give; commands run out of it.
    """
    plots: list[TimePlot] = []
    for what, name, unit in _QUANTITIES:
        given = record[f"{thrusters}.{what}_B"]
        commanded = np.sum([record[f"{controller}.{what}_cmd"] for controller in controllers], axis=0)
        most, asked = (float(np.abs(x[np.isfinite(x)]).max(initial=0.0)) for x in (given, commanded))
        limit = min(_ROOM * max(most, asked), _BEYOND * most if most > 0.0 else np.inf)
        plots += [
            TimePlot(
                title=f"{name} of {whose} {'along' if what == 'f' else 'about'} {axis} of B",
                quantity=f"{name.lower()}, {axis}",
                unit=unit,
                curves=(
                    Curve(label="given", values=given[:, i]),
                    Curve(label="commanded", values=commanded[:, i], held=True, stroke="dotted"),
                ),
                phases=phases,
                limits=(-limit, limit) if limit > 0.0 else (None, None),
            )
            for i, axis in enumerate("xyz")
        ]
    return plots


_PUSH_PALETTE = ("actual", "calculated")
_AXES: dict[str, Stroke] = {"x": "solid", "y": "dashed", "z": "dotted"}
"""Strokes by axis: two of the three curves are zero and coincide."""


def figures_of_push(parameters: ImpedanceParameters, record: Record) -> list[TimeFigure]:
    """Return the figures of actual and calculated errors, and of the push with thrust; none of a single instant."""
    if len(record.time) < 2:
        return []
    motion = Motion.of(record, record.time)
    p_WG_goal = np.array(paper_values("free_flyer", "push_place")["p_WG_goal"])
    errors = errors_of(motion, p_WG_goal, parameters.behaviour, parameters.model)
    turned, turned_model = (np.degrees(values) for values in errors.without_jumps)
    phases = phases_of_push(parameters, record)
    return [
        TimeFigure(
            name="errors",
            caption="Error of the gripper's pose, rest minus actual, in the whole run, and by [Fernandes2020] "
            f"eq. (4.4); {_push_in_words(parameters, record)}.",
            plots=[
                *errors_over_time("position", "mm", 1000 * errors.p, 1000 * errors.p_model, phases),
                *errors_over_time("orientation", "°", turned, turned_model, phases),
            ],
            columns=2,
        ),
        TimeFigure(
            name="thrust",
            caption=CAPTION,
            plots=plot_thrust(record, ("impedance",), phases),
            columns=2,
        ),
        TimeFigure(
            name="push",
            caption=CAPTION_OF_PUSH,
            plots=pushes_over_time(parameters, record, phases),
        ),
    ]


def phases_of_push(p: ImpedanceParameters, record: Record) -> list[Phase]:
    """Return the time before, of and after the push; the push alone has a name, in plots and replay."""
    begin, over = _span(p, record)
    return [
        Phase(begin=0.0, end=begin, name=""),
        Phase(begin=begin, end=over, name="push" if p.kind is Wrench.FORCE else "twist"),
        Phase(begin=over, end=float(record.time[-1]), name=""),
    ]


def _span(p: ImpedanceParameters, record: Record) -> tuple[float, float]:
    """Return when the push began and ended, s: as the parameters say, or where another one was given, as recorded."""
    end = float(record.time[-1])
    if _is_as_said(p, record):
        return min(p.begin, end), min(p.end, end)
    (acting,) = np.nonzero(_wrench(record).any(axis=1))
    return (float(record.time[max(0, acting[0] - 1)]), float(record.time[acting[-1]])) if len(acting) else (end, end)


def _wrench(record: Record) -> Floats:
    """Return force and torque on the gripper, means over the step before each row, shape (rows, 6)."""
    return np.hstack([record["push.f_G"], record["push.tau_G"]])


def _is_as_said(p: ImpedanceParameters, record: Record) -> bool:
    """Return whether the parameters' pulse acted: another unit, or values of the unit's own, may have given another."""
    dt, said = np.diff(record.time), np.zeros(6)
    said[p.axis + (0 if p.kind is Wrench.FORCE else 3)] = p.force if p.kind is Wrench.FORCE else p.torque
    lasted = np.diff(np.clip(record.time, p.begin, p.end))
    return np.allclose(_wrench(record)[1:] * dt[:, np.newaxis], np.outer(lasted, said), rtol=1e-6, atol=1e-9)


def _push_in_words(p: ImpedanceParameters, record: Record) -> str:
    if not _is_as_said(p, record):
        force, torque = (float(np.linalg.norm(part, axis=1).max()) for part in np.split(_wrench(record), 2, axis=1))
        begin, over = _span(p, record)
        return f"pushed with up to {force:.3g} N and {torque:.3g} N·m between {begin:.3g} s and {over:.3g} s"
    what = f"pushed with {p.force:g} N along" if p.kind is Wrench.FORCE else f"twisted with {p.torque:g} N·m about"
    return f"{what} {p.axis.name.lower()} for {p.duration:g} s"


def errors_over_time(
    what: str, unit: str, actual: Floats, calculated: Floats, phases: Sequence[Phase]
) -> list[TimePlot]:
    """Return the errors along or about x, y and z, whose axes show the same range."""
    limit = 1.1 * max(float(np.nanmax(np.abs(values), initial=1e-3)) for values in (actual, calculated))
    return [
        TimePlot(
            title=f"Error of the gripper's {what}, rest minus actual, {axis} of W",
            quantity=f"error, {axis}",
            unit=unit,
            curves=(
                Curve(label="actual", values=_to_the_end(actual[:, i])),
                Curve(label="calculated", values=_to_the_end(calculated[:, i]), stroke="dashed"),
            ),
            phases=phases,
            limits=(-limit, limit),
            palette=_PUSH_PALETTE,
        )
        for i, axis in enumerate("xyz")
    ]


def _to_the_end(values: Floats) -> Floats:
    """Return values of the beginnings of steps with one more, unknown, for the end of the last step."""
    return np.append(values, np.nan)


def pushes_over_time(parameters: ImpedanceParameters, record: Record, phases: Sequence[Phase]) -> list[TimePlot]:
    """Return the push, force or torque, on the gripper over time, and forces of pushes by hand."""
    signal, quantity, unit = (
        ("push.f_G", "force", "N") if parameters.kind is Wrench.FORCE else ("push.tau_G", "torque", "N·m")
    )
    title = f"The push: {quantity} on the gripper in W"
    by_hand = HandPush.of(record, len(record.time))
    return [
        _along_axes(title, f"push: {quantity}", unit, record[signal], phases),
        *(
            _along_axes(f"By hand: force on the {body} in W", "by hand: force", "N", force, phases)
            for body, force in (("robot", by_hand.f_P), ("gripper", by_hand.f_Q))
            if force.any()
        ),
    ]


def _along_axes(title: str, quantity: str, unit: str, values: Floats, phases: Sequence[Phase]) -> TimePlot:
    curves = [
        Curve(label=axis, values=values[:, i], held=True, stroke=stroke)
        for i, (axis, stroke) in enumerate(_AXES.items())
    ]
    return TimePlot(title=title, quantity=quantity, unit=unit, curves=curves, phases=phases)
