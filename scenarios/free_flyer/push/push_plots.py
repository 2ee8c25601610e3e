"""Curves over time of pushes on the free-flyer: errors, as in [Fernandes2020] figs. 4.5-4.16, the push, and thrust.

The commanded wrench is beside that of the thrusters (`plot_thrust`), of handovers, too.
"""

from collections.abc import Sequence

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.cosim.record.reader import Record
from handover.scenarios.experiment.paper import paper_values
from handover.scenarios.experiment.time_plot import Curve, Phase, Stroke, TimeFigure, TimePlot
from handover.scenarios.free_flyer.parameters import ImpedanceParameters, Wrench
from handover.scenarios.free_flyer.push.impedance_evaluation import MOTION_SIGNALS, Motion, errors_of

_BEYOND = 2.0
"""Range of the plots, over the thrusters' maximum output: a command may be twenty times as much."""
_ROOM = 1.1
"""Range of the plots over the largest value, where that is smaller."""
_QUANTITIES = (("f", "Force", "N"), ("tau", "Torque", "N·m"))

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
    motion = Motion(record.time, *(record[name] for name in MOTION_SIGNALS))
    p_WG_goal = np.array(paper_values("free_flyer", "push_place")["p_WG_goal"])
    errors = errors_of(motion, p_WG_goal, parameters.behaviour, parameters.model)
    turned, turned_model = (np.degrees(values) for values in errors.without_jumps)
    phases = phases_of_push(parameters, record)
    return [
        TimeFigure(
            name="errors",
            caption="Error of the gripper's pose, rest minus actual, in the whole run, and by [Fernandes2020] "
            f"eq. (4.4); {_push_in_words(parameters)}.",
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
            caption="The push on the gripper in W.",
            plots=[push_over_time(parameters, record, phases)],
        ),
    ]


def phases_of_push(p: ImpedanceParameters, record: Record) -> list[Phase]:
    """Return the time before, of and after the push; the push alone has a name, in plots and replay."""
    end = float(record.time[-1])
    begin, over = min(p.begin, end), min(p.end, end)
    return [
        Phase(begin=0.0, end=begin, name=""),
        Phase(begin=begin, end=over, name="push" if p.kind is Wrench.FORCE else "twist"),
        Phase(begin=over, end=end, name=""),
    ]


def _push_in_words(p: ImpedanceParameters) -> str:
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


def push_over_time(parameters: ImpedanceParameters, record: Record, phases: Sequence[Phase]) -> TimePlot:
    """Return the push, force or torque, on the gripper over time."""
    signal, quantity, unit = (
        ("push.f_G", "force", "N") if parameters.kind is Wrench.FORCE else ("push.tau_G", "torque", "N·m")
    )
    values = record[signal]
    curves = [
        Curve(label=axis, values=values[:, i], held=True, stroke=stroke)
        for i, (axis, stroke) in enumerate(_AXES.items())
    ]
    title = f"The push: {quantity} on the gripper in W"
    return TimePlot(title=title, quantity=f"push: {quantity}", unit=unit, curves=curves, phases=phases)
