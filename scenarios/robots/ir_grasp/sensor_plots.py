"""Curves over time, and the scene in space, of a sensor that approaches a face."""

from dataclasses import replace

import numpy as np

from handover.controllers.ir_grasp.parameters import Params as ReflexParams
from handover.cosim.record.reader import Record
from handover.plants.ir_grasp.objects import Thing
from handover.scenarios.experiment.replay import Replay
from handover.scenarios.experiment.time_plot import Curve, Level, Phase, TimeFigure, TimePlot
from handover.scenarios.robots.ir_grasp.parameters import Parameters
from handover.scenarios.robots.ir_grasp.replay import replay_grasp
from handover.scenarios.robots.ir_grasp.sensor_curve import apparent_distance


def figures_of_sensor(finger: int, record: Record) -> list[TimeFigure]:
    """Return what a finger's sensor reads, and its distance in truth and by the controller's curve, over time."""
    reflex, phases = ReflexParams(), _phases(finger, record)
    ticks, true = record["scene.ticks"][:, finger], record["scene.range"][:, finger]
    caption = (
        "What the sensor reads as it comes to the face, and its distance: along the beam, and as the controller's "
        "curve, [Luberto] eq. (11), has it, left out where that is beyond the range and so is not seen."
    )
    plots = [
        TimePlot(
            title="Reading of the converter",
            quantity="reading",
            unit="ticks",
            curves=(Curve(label="reading", values=ticks, held=True),),
            phases=phases,
            limits=(0.0, None),
        ),
        TimePlot(
            title="Distance of the sensor from the face",
            quantity="distance",
            unit="mm",
            curves=(
                Curve(label="by the curve", values=1000 * apparent_distance(ticks), held=True),
                Curve(label="along the beam", values=1000 * true, stroke="dotted"),
            ),
            levels=(Level(label="end of the range", value=1000 * reflex.distance_max),),
            phases=phases,
            limits=(0.0, None),
        ),
    ]
    return [TimeFigure(name="readings", caption=caption, plots=plots)]


def replay_sensor(thing: Thing, finger: int, record: Record) -> Replay:
    """Return hand, box and beams in space."""
    return replace(replay_grasp(Parameters(thing=thing), record), phases=_phases(finger, record))


def _phases(finger: int, record: Record) -> tuple[Phase, ...]:
    """Return the spans in which the face is beyond the sensor's range, and in it."""
    within = record["scene.range"][:, finger] <= ReflexParams().distance_max
    first = int(np.argmax(within)) if within.any() else len(within) - 1
    begin, entered, end = (float(record.time[k]) for k in (0, first, -1))
    spans = ((begin, entered, "out of range"), (entered, end, "in range"))
    return tuple(Phase(begin=a, end=b, name=name) for a, b, name in spans if b > a or begin == end)
