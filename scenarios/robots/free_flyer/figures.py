"""Figures of the scene, for papers: a handover at key moments with its transfers from near, and a push."""

from pathlib import Path

import numpy as np

from handover.cosim.record.reader import Record
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.robots.free_flyer.handover.handover_evaluation import HandoverEvaluator
from handover.scenarios.robots.free_flyer.parameters import ImpedanceParameters, Wrench
from handover.scenarios.robots.free_flyer.push.impedance_evaluation import Errors
from handover.scenarios.robots.free_flyer.scene import draw_near, draw_scene, jaw_gap, person_at, robot_at


def draw_scenes(evaluator: HandoverEvaluator, record: Record, folder: Path) -> list[Figure]:
    """Draw the scene, and the transfers from near, into a folder."""
    gap, rows = jaw_gap(record), _moments(evaluator, record)
    solids = {title: robot_at(record, row, float(gap[row])) + person_at(record, row) for title, row in rows.items()}
    scene = draw_scene(solids, "Blue: jaws; orange: object.", folder)
    between = list(rows)[1:-1]
    if not between:
        return [scene]
    middle = (record["robot.p_WG"] + record["person.p_WH"]) / 2
    near = {title: middle[rows[title]] for title in between}
    return [scene, draw_near({title: solids[title] for title in between}, near, folder)]


def _moments(evaluator: HandoverEvaluator, record: Record) -> dict[str, int]:
    """Return the rows of the start, the end, and each pull or push that the robot felt or signalled for, by title."""
    times = [(0.0, "start")]
    for name, transfer in zip(("transfer", "return"), evaluator.transfers, strict=False):
        times += [(t, "failed reception") for t in transfer.in_vain]
        times.append((transfer.asked, f"{name}: signal") if transfer.felt is None else (transfer.felt, name))
    if len(times) == 1 and len(evaluator.phases) > 1:
        phase, began = evaluator.phases[-1]
        times.append((began, phase.replace("_", " ").lower()))
    times.append((float(record.time[-1]), "end"))
    return {f"{t:.1f} s, {title}": int(np.searchsorted(record.time, t)) for t, title in times}


def draw_moments(errors: Errors, parameters: ImpedanceParameters, record: Record, folder: Path) -> Figure:
    """Draw the start, the greatest error (of position, or of orientation for a twist), and the end, into a folder."""
    size = np.linalg.norm(errors.p if parameters.kind is Wrench.FORCE else errors.R, axis=1)
    rows = (0, int(np.argmax(size)), len(record.time) - 1)
    titles = (f"{record.time[r]:.1f} s, {what}" for r, what in zip(rows, ("start", "farthest", "end"), strict=True))
    moments = {title: robot_at(record, r, 0.0) for title, r in zip(titles, rows, strict=True)}
    return draw_scene(moments, "Blue: jaws.", folder)
