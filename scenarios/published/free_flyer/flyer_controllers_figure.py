"""Figure of the controllers in the place of the free-flyer's impedance control."""

from pathlib import Path

from matplotlib.axes import Axes

from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.plotting import COLOURS, figure
from handover.scenarios.free_flyer.parameters import Behaviour, Propulsion, Task
from handover.scenarios.published.free_flyer.flyer_controllers import CONTROLLERS, PROPULSIONS, ControllerRows

_TASKS = {Task.ROBOT_TO_HUMAN: "robot to human", Task.HUMAN_TO_ROBOT: "human to robot"}
_SHOWN = (("displacement", "displacement (mm)", 1e3), ("force", "force on the hand (N)", 1.0))


def draw_controllers(rows: ControllerRows, folder: Path) -> list[Figure]:
    """Draw displacement and force by controller, task, behaviour and propulsion; nothing where a task has no runs."""
    if not all(rows.of(c, t, Behaviour.RIGID, Propulsion.IDEAL) for c in CONTROLLERS for t in _TASKS):
        return []
    with figure(folder / "controllers", 2, 2, size=(9.0, 5.6)) as panels:
        for k, (metric, label, scale) in enumerate(_SHOWN):
            for axis, propulsion in zip(panels[2 * k : 2 * k + 2], PROPULSIONS, strict=True):
                _draw_panel(axis, rows, propulsion, f"transfer_{metric}", scale)
                axis.set(ylabel=label, ylim=(0.0, None), title=f"{propulsion.item} thrust" if k == 0 else "")
        panels[0].legend(loc="upper left", fontsize=8)
    caption = (
        "How far the gripper is taken and the greatest force on the hand in a transfer, by what takes the place of the "
        "impedance control; means of the runs, ideal thrust on the left, Astrobee's limits on the right."
    )
    return [Figure("controllers", caption)]


def _draw_panel(axis: Axes, rows: ControllerRows, propulsion: Propulsion, metric: str, scale: float) -> None:
    cases = [(task, behaviour) for task in _TASKS for behaviour in Behaviour]
    for i, (controller, name) in enumerate(CONTROLLERS.items()):
        means = [rows.mean(metric, rows.of(controller, task, b, propulsion)) for task, b in cases]
        places = [n + 0.27 * (i - 1) for n, mean in enumerate(means) if mean is not None]
        heights = [scale * mean for mean in means if mean is not None]
        axis.bar(places, heights, width=0.25, color=COLOURS[i], label=name)
    labels = [f"{_TASKS[task]}\n{behaviour.item}" for task, behaviour in cases]
    axis.set_xticks(range(len(cases)), labels, fontsize=7)
