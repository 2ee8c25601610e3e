"""Figures of `helix-1`: the gripper by command and by estimate beside the measured one.

[Vervloet2025] shows them in figs. 9, 10 and 18 to 21. Its curves are known by what sec. 5.2 says of their ends, which
stand in the panel of the step size 0.1.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

from matplotlib.axes import Axes

from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.plotting import COLOURS, figure
from handover.scenarios.helix.parameters import settings_of
from handover.scenarios.published.helix.helix_1_curves import RunCurves, mean_curve
from handover.scenarios.published.helix.helix_1_figures import draw_mean
from handover.scenarios.published.helix.helix_1_runs import Helix1Runs, published

_MODEL, _MEASURED, _APART = COLOURS[0], COLOURS[1], COLOURS[2]
_FIGURES_OF_MODEL = ("fig. 9", "fig. 18", "fig. 20")
_FIGURES_OF_ESTIMATE = ("fig. 10", "fig. 19", "fig. 21")
_WAY = "distance (mm)"


def draw_model(arm: Helix1Runs, curves: Mapping[float, Sequence[RunCurves]], folder: Path) -> list[Figure]:
    """Draw how far the gripper is from its start by the commanded state and as measured, and how far these are apart.

    Args:
        arm: the runs of one of the controller's settings.
        curves: of its runs that have a record, by step size.
        folder: where the figure goes.
    """
    drawn = [alpha for alpha, runs in curves.items() if runs]
    if not drawn:
        return []
    with figure(folder / f"model{arm.suffix}", len(drawn), size=(8.0, 0.9 + 2.3 * len(drawn))) as axes:
        for axis, alpha in zip(axes, drawn, strict=True):
            i, runs = arm.alphas.index(alpha), curves[alpha]
            for values, style in (
                ([run.way_sys for run in runs], (_MODEL, "model of the command, from the start")),
                ([run.way_meas for run in runs], (_MEASURED, "measured, from the start")),
                ([run.apart_sys for run in runs], (_APART, "model to measured")),
            ):
                draw_mean(axis, mean_curve(values, runs[0].period), style)
            if i == 0:
                _published_ends(axis)
            axis.set(ylabel=_WAY, ylim=(0, None), xlim=(0, None))
            axis.set_title(f"α = {alpha}, as {_FIGURES_OF_MODEL[i]}")
        axes[-1].set_xlabel("time (s)")
        axes[0].figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    caption = (
        "Gripper of the commanded state, f(q_sys), and measured one: their distances from where it hangs after "
        f"calibration, and from each other, like figs. 9, 18 and 20, {arm.title}. Mean of the runs still under way, up "
        "to the median length, with their standard deviation. Crosses: the ends of the thesis's curves, by sec. 5.2, "
        "at its median time."
    )
    return [Figure(f"model{arm.suffix}", caption)]


def draw_estimate(arm: Helix1Runs, curves: Mapping[float, Sequence[RunCurves]], folder: Path) -> list[Figure]:
    """Draw the same by the estimated state instead of the commanded one, with the distance that eq. (16) bounds.

    Args:
        arm: the runs of one of the controller's settings.
        curves: of its runs that have a record, by step size.
        folder: where the figure goes.
    """
    drawn = [alpha for alpha, runs in curves.items() if runs]
    if not drawn:
        return []
    bound = 1000 * settings_of(arm.tuning)["epsilon_pose_bound"]
    with figure(folder / f"estimate{arm.suffix}", len(drawn), 2, size=(9.0, 0.9 + 2.2 * len(drawn))) as axes:
        for left, right, alpha in zip(axes[0::2], axes[1::2], drawn, strict=True):
            i, runs = arm.alphas.index(alpha), curves[alpha]
            period = runs[0].period
            draw_mean(left, mean_curve([run.way_est for run in runs], period), (_MODEL, "estimate, from the start"))
            style = (_MEASURED, "measured, from the start")
            draw_mean(left, mean_curve([run.way_meas for run in runs], period), style, "--")
            draw_mean(right, mean_curve([run.pose_est for run in runs], period), (_APART, "over wrist and gripper"))
            draw_mean(right, mean_curve([run.apart_est for run in runs], period), (COLOURS[3], "of the gripper"))
            right.axhline(bound, color="#4d5866", lw=0.9, ls=":", label="ε_pose,bound")
            left.set(ylabel=_WAY, ylim=(0, None), xlim=(0, None))
            left.set_title(f"α = {alpha}, as {_FIGURES_OF_ESTIMATE[i]}")
            right.set(ylim=(0, 1.5 * bound), xlim=(0, None))
            right.set_title("estimate to measured")
        for axis in axes[-2:]:
            axis.set_xlabel("time (s)")
        shown = [axis.get_legend_handles_labels() for axis in axes[:2]]
        handles = [handle for of_axis, _ in shown for handle in of_axis]
        axes[0].figure.legend(
            handles, [name for _, names in shown for name in names], loc="outside lower center", ncols=3
        )
    caption = (
        "Gripper of the estimated state, f(q_est), and measured one: their distances from where it hangs after "
        f"calibration (left) and from each other (right), like figs. 10, 19 and 21, {arm.title}. Mean of the runs "
        "still under way, up to the median length, with their standard deviation."
    )
    return [Figure(f"estimate{arm.suffix}", caption)]


def _published_ends(axis: Axes) -> None:
    printed = published()
    time = printed["arm_time_median"][0]
    for name, colour in (("model_travel", _MODEL), ("arm_travel", _MEASURED), ("model_mismatch", _APART)):
        axis.plot(time, 1000 * printed[name], "x", ms=8, mew=2.0, color=colour)
    axis.plot([], [], "x", ms=8, mew=2.0, color="#4d5866", label="published ends")
