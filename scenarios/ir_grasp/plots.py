"""What the report draws of an infrared grasp over time."""

import numpy as np

from handover.controllers.ir_grasp.parameters import Params as ReflexParams
from handover.cosim.blocks.ports import Floats
from handover.cosim.record.reader import Record
from handover.scenarios.experiment.time_plot import Curve, Level, TimePlot
from handover.scenarios.ir_grasp.parameters import Parameters

FINGER_NAMES = ("thumb", "index", "ring")
_PHASES = "reflex.phase"
_WRIST = ("reflex.p_WH_cmd", "scene.p_WH")
_LEAST_COST = 0.1
"""What is drawn of a smaller cost, mm²: a logarithm has no zero."""


def plot_grasp(parameters: Parameters, record: Record) -> list[TimePlot]:
    """Return distances seen and true, cost, and what is commanded of wrist, heading and closure."""
    return [
        _distances(parameters, record),
        TimePlot(
            title="Cost of thumb and ring, [Luberto] eq. (4)",
            quantity="cost f",
            unit="mm²",
            phases=_PHASES,
            logarithmic=True,
            curves=(Curve(label="cost f", values=cost(record), held=True),),
            levels=(Level(label="the hand closes", value=1e6 * closing_cost(parameters)),),
        ),
        *(
            _followed(f"Wrist along {name} of W", name, "mm", *(1000 * record[s][:, i] for s in _WRIST))
            for i, name in enumerate("xy")
        ),
        _followed("Heading", "yaw", "°", *(np.degrees(record[s]) for s in ("reflex.yaw_cmd", "scene.yaw"))),
        _followed("Closure", "closure, from 0 to 1", "", record["reflex.sigma_cmd"], record["scene.sigma"]),
    ]


def in_sight(record: Record, signal: str) -> Floats:
    """Return distances of the three fingers, shape (rows, 3), mm; not a number where there is nothing in range."""
    return np.where(record[signal] < ReflexParams().distance_max, 1000 * record[signal], np.nan)


def cost(record: Record) -> Floats:
    """Return the cost over time, mm², as a logarithmic axis can show it."""
    return np.maximum(1e6 * record["reflex.cost"], _LEAST_COST)


def closing_cost(parameters: Parameters) -> float:
    """Return the cost at which the hand closes, m²."""
    reflex = ReflexParams()
    return reflex.threshold_literal if parameters.literal else reflex.threshold


def _distances(parameters: Parameters, record: Record) -> TimePlot:
    seen, true = in_sight(record, "reflex.distance"), in_sight(record, "scene.range")
    curves: list[Curve] = []
    for i, finger in enumerate(FINGER_NAMES):
        curves.append(Curve(label=f"{finger}, as seen", values=seen[:, i], held=True, group=finger))
        curves.append(Curve(label=f"{finger}, true along the beam", values=true[:, i], faint=True, group=finger))
    target = (
        () if parameters.literal else (Level(label="target of thumb and ring", value=1000 * ReflexParams().target),)
    )
    return TimePlot(
        title="Distances of the fingers from the object",
        quantity="distance",
        unit="mm",
        curves=curves,
        levels=target,
        phases=_PHASES,
    )


def _followed(title: str, quantity: str, unit: str, commanded: Floats, measured: Floats) -> TimePlot:
    curves = (
        Curve(label="commanded", values=commanded, held=True),
        Curve(label="measured", values=measured),
    )
    return TimePlot(title=title, quantity=quantity, unit=unit, curves=curves, phases=_PHASES)
