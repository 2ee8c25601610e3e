"""Figures of the experiment `ir-sensor`: readings and their fit, one curve for all materials, and eq. (3)."""

from pathlib import Path

import numpy as np

from handover.controllers.ir_grasp.parameters import Params as ReflexParams
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.plotting import COLOURS, figure
from handover.scenarios.ir_grasp.ir_sensor import Finger
from handover.scenarios.ir_grasp.plots import FINGER_COLOURS
from handover.scenarios.ir_grasp.sensor_curve import Fit, apparent_distance, controller_curve, time_of_flight
from handover.scenarios.published.ir_grasp.ir_sensor_cases import (
    REFLECTIVITIES,
    Case,
    SensorRuns,
    readings_of_rows,
)

_SOFT = "#4d5866"
_EVERY = 7
"""One of so many readings is drawn."""


def draw_sensor(runs: SensorRuns, folders: Path, folder: Path) -> list[Figure]:
    """Draw the figures into a folder, of runs whose folders are in `folders`."""
    return [_characteristic(runs, folders, folder), _one_curve(runs, folders, folder), _flight(folder)]


def _characteristic(runs: SensorRuns, folders: Path, folder: Path) -> Figure:
    ticks = np.linspace(1.0, 4095.0, 400)
    with figure(folder / "characteristic", 1, 2, size=(9.0, 3.9)) as (by_sensor, by_face):
        for finger in Finger:
            case, colour = Case(finger), FINGER_COLOURS[finger]
            d, x = readings_of_rows(runs.rows(case)[:1], folders)
            by_sensor.plot(x[::_EVERY], 1e3 * d[::_EVERY], ".", ms=3, color=colour, alpha=0.6)
            for fit in runs.fits(case)[:1]:
                by_sensor.plot(ticks, 1e3 * fit.distance(ticks), lw=1.2, color=colour, label=_fitted(finger, fit))
        by_sensor.plot(
            ticks, 1e3 * controller_curve().distance(ticks), lw=1.0, ls="--", color=_SOFT, label="the controller's"
        )
        for k, rho in enumerate(REFLECTIVITIES):
            rows = runs.rows(Case(Finger.RING, rho))[:1]
            d, x = readings_of_rows(rows, folders)
            if rows:
                by_face.plot(x[::3], 1e3 * d[::3], ".", ms=3, color=COLOURS[k % len(COLOURS)], label=f"{rho:g}")
        by_sensor.set(title="sensors, reflectivity 1", ylabel="distance (mm)")
        by_face.set(title="the ring's sensor, by reflectivity")
        for axes in (by_sensor, by_face):
            axes.set(xlabel="reading of the converter (ticks)", xlim=(0, 4095), ylim=(0, 86))
        by_sensor.legend(loc="upper right", fontsize=8, title="y = a exp(b x) + c exp(d x)", title_fontsize=8)
        by_face.legend(loc="upper right", fontsize=9, markerscale=3)
    caption = (
        "Distance over reading as in [Luberto] fig. 8, whose numbers are not printed: points are readings as a sensor "
        "comes to a box, lines the fits of eq. (11), with a and c in mm, b and d in 1/1000 ticks. Nearer than 4 mm "
        "readings fall again; beyond 65 mm nothing comes back; at 4095 the converter is at its end."
    )
    return Figure("characteristic", caption)


def _fitted(finger: Finger, fit: Fit) -> str:
    a, b, c, d = (1e3 * v for v in (fit.a, fit.b, fit.c, fit.d))
    return f"{finger.name.lower()}: {a:.1f}, {b:.2f}, {c:.1f}, {d:.2f}"


def _one_curve(runs: SensorRuns, folders: Path, folder: Path) -> Figure:
    reflex = ReflexParams()
    with figure(folder / "one_curve", 1, size=(6.2, 4.6)) as (axes,):
        for k, rho in enumerate(REFLECTIVITIES):
            rows = runs.rows(Case(Finger.RING, rho))[:1]
            d, x = readings_of_rows(rows, folders)
            if rows:
                axes.plot(
                    1e3 * d, 1e3 * apparent_distance(x), ".", ms=2.5, color=COLOURS[k % len(COLOURS)], label=f"{rho:g}"
                )
        ends = [0.0, 1e3 * reflex.distance_max]
        axes.plot(ends, ends, color=_SOFT, lw=0.8)
        axes.axhline(1e3 * reflex.target, color=_SOFT, lw=0.8, ls=(0, (7, 3)))
        axes.text(66.0, 1e3 * reflex.target + 0.8, "target", ha="right", color=_SOFT, fontsize=8)
        axes.set(xlabel="distance along the beam (mm)", ylabel="distance by the controller's curve (mm)")
        axes.set(xlim=(0, 67), ylim=(0, 67), aspect="equal")
        axes.legend(loc="upper left", bbox_to_anchor=(1.02, 1.0), markerscale=4, title="reflectivity")
    caption = (
        "What the controller's one curve, [Luberto] eq. (11), makes of readings by the face's reflectivity (the ring's "
        "sensor); left out where that is beyond the range, and so not seen. A face that returns less seems farther, so "
        "the hand is nearer than it believes."
    )
    return Figure("one_curve", caption)


def _flight(folder: Path) -> Figure:
    near, far = 4.0, 65.0
    d = np.linspace(near, far, 200) / 1e3
    curve = controller_curve()
    x = np.arange(0.0, 4096.0)
    with figure(folder / "time_of_flight", 1, 2, size=(9.0, 3.2)) as (flight, steps):
        flight.plot(1e3 * d, 1e12 * time_of_flight(d), color=COLOURS[0])
        flight.set(xlabel="distance (mm)", ylabel="time of flight (ps)", title="eq. (3): t = 2 d / v")
        y = curve.distance(x)
        shown = (1e3 * y >= near) & (1e3 * y <= far)
        steps.plot(1e3 * y[shown], -1.0 / (1e3 * np.gradient(y))[shown], color=COLOURS[1])
        steps.set(xlabel="distance (mm)", ylabel="ticks per mm", title="eq. (11): intensity", yscale="log")
        for axes in (flight, steps):
            axes.set_xlim(0, 67)
    per_mm = 1e12 * float(time_of_flight(np.array(1e-3)))
    caption = (
        f"Eq. (3) of [Luberto] gives the distance by time of flight, {per_mm:.1f} ps a millimetre, which asks for an "
        "electronic stage of its own; the hardware measures intensity instead (sec. V-B). Right: by the controller's "
        "curve, by how many ticks the reading changes with a millimetre."
    )
    return Figure("time_of_flight", caption)
