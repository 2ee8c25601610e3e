"""Figure 8 of Luberto et al.: what the infrared sensors read over distance, and the curve of eq. (11) through it."""

from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import ClassVar

import numpy as np

from handover.controllers.ir_grasp.parameters import Params as ReflexParams
from handover.cosim.blocks.ports import Floats
from handover.cosim.exceptions import counted
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.plotting import COLOURS
from handover.scenarios.published.claims import Statement
from handover.scenarios.published.figures import SOFT, Mark, Panel, drawn, level, records_of
from handover.scenarios.published.published_experiment import Claim, ComparisonTable, PublishedExperiment
from handover.scenarios.published.runs import Point, Row, Runs, is_done
from handover.scenarios.published.tables import table_of
from handover.scenarios.published.verdicts import format_share
from handover.scenarios.robots.ir_grasp.ir_sensor import AT, Finger, IrSensor
from handover.scenarios.robots.ir_grasp.plots import FINGER_COLOURS
from handover.scenarios.robots.ir_grasp.sensor_curve import (
    Fit,
    apparent_distance,
    controller_curve,
    readings_of,
    time_of_flight,
)
from handover.scenarios.runs.campaign.plan import CampaignPlan
from handover.scenarios.runs.campaign.table import CampaignTable

REFLECTIVITIES = (0.2, 0.5, 0.8, 1.0, 1.5, 2.0)
"""Of faces, over that of the surface which the curve is of: 0.8 is the cup of the grasps, 1 the paper box."""
_INCIDENCES = (-0.4, 0.4)
"""Angles of oblique faces, rad."""
TOLERANCES = (0.02, 0.05, 0.10)
"""Parts by which each constant of a sensor is off at most."""
_CONSTANTS = ("a", "b", "c", "d")
_LAST = {Finger.THUMB: "0.003", Finger.INDEX: "0.010", Finger.RING: "0.003"}
"""Ends of the approaches, m: below the range, but for the index, before which the ring finger would touch the box."""
_REPETITIONS = 3
_SPAN = (0.5, 1.5)
"""Reflectivities about 1 between which one curve is asked to be good enough."""
_COMPARED = np.linspace(100.0, 3000.0, 30)
"""Readings, ticks, at which curves are compared: from some 63 to 6 mm."""
_EVERY = 7
"""One of so many readings is drawn."""

_BY_CONSTRUCTION = (
    "The sensors of the scene have a curve of this form by construction, so agreement is not evidence. The paper "
    "prints no coefficients."
)
_PUT_IN = (
    "How far sensors differ is put in, as the paper gives no figures. By that part: the largest deviation of any "
    "constant from its mean, and of a curve from that of the controller."
)


def case(
    finger: Finger | None = None, *, reflectivity: float = 1.0, incidence: float = 0.0, tolerance: float = 0.0
) -> list[Point]:
    """Return the parameters of a finger's sensor, or of each, that comes to a face.

    Args:
        finger: None for all.
        reflectivity: of the face.
        incidence: angle of the face, rad.
        tolerance: how far the sensor's constants are off at most.
    """
    numbers = {"reflectivity": reflectivity, "incidence": incidence, "scene.sensor_tolerance": tolerance}
    face = {name: f"{value:g}" for name, value in numbers.items()}
    return [{"finger": f.name.lower(), **face} for f in (Finger if finger is None else (finger,))]


class IrSensorCurve(PublishedExperiment):
    """Each finger's sensor comes to the face of a box, of several materials, twice oblique, and with constants off.

    The sensors are those of the grasps, on their fingers, in the same scene: what is fitted is what the hand would
    have measured of itself.
    """

    name: ClassVar[str] = "ir-sensor"
    title: ClassVar[str] = "infrared sensors over distance, by material: Luberto et al., fig. 8, eqs. (3) and (11)"
    scenario: ClassVar[str] = IrSensor.name

    def plan(self, quick: bool) -> CampaignPlan:
        """Return sensors x materials, oblique faces, and sensors that are off; a few of them once if quick."""
        points = [p for rho in ((1.0,) if quick else REFLECTIVITIES) for p in case(reflectivity=rho)]
        points += [p for rho in (0.5, 2.0) for p in case(Finger.RING, reflectivity=rho)] if quick else []
        points += [] if quick else [p for angle in _INCIDENCES for p in case(Finger.RING, incidence=angle)]
        points += [p for t in (TOLERANCES[1:2] if quick else TOLERANCES) for p in case(tolerance=t)]
        return self.campaign(
            [{**point, "last": _last(point)} for point in points], repetitions=1 if quick else _REPETITIONS, seed=8
        )

    def claims(self, table: CampaignTable) -> Sequence[Claim]:
        """Judge the form of the curve, how alike sensors are, and what one curve for all materials is worth."""
        runs = sensor_runs(table)
        return [_form(runs), _alike(runs), _in_order(runs), _one_curve(runs)]

    def tables(self, table: CampaignTable) -> Sequence[ComparisonTable]:
        """Return the fits of eq. (11), and what one curve makes of materials."""
        runs = sensor_runs(table)
        cases = {
            f"{f.name.lower()}, reflectivity {rho:g}": case(f, reflectivity=rho)
            for rho, f in product(REFLECTIVITIES, Finger)
        }
        cases |= {f"ring, face at {np.degrees(x):.0f}°": case(Finger.RING, incidence=x) for x in _INCIDENCES}
        fitted = {title: fits for title, points in cases.items() if (fits := fits_of(runs.of(*points)))}
        unusable = len(table.rows) - len(runs)
        off = {t: fits for t in (0.0, *TOLERANCES) if (fits := fits_of(runs.of(*case(tolerance=t))))}
        seen = {rho: found for rho in REFLECTIVITIES if len(found := runs.of(*case(reflectivity=rho)))}
        return [
            table_of(
                "Fits of eq. (11), as in fig. 8",
                [_fit("the controller's curve", [controller_curve()], own=True)]
                + [_fit(title, fits) for title, fits in fitted.items()],
                "Medians over runs, by least squares in distance over 4 to 60 mm. Two exponentials are hard to "
                "separate: constants differ more than curves do. The last column: from the controller's curve, at "
                "readings of 100 to 3000."
                + (f" Not counted: {counted(unusable, 'run')} that failed, or touched the box." if unusable else ""),
            ),
            table_of(
                "Sensors whose constants are off",
                [_spread(tolerance, fits) for tolerance, fits in off.items()],
                "Largest deviation of each fitted constant from its mean over the sensors; and of the sensors' curves "
                "from the controller's one curve. The curves are compared at readings of 100 to 3000, before a face "
                "of reflectivity 1.",
            ),
            table_of(
                "Distance by the controller's one curve (mm)",
                [_material(rho, found) for rho, found in seen.items()],
                "Medians over sensors and runs. A distance by the curve beyond 65 mm is not seen.",
            ),
        ]

    def draw(self, table: CampaignTable, runs: Path, folder: Path) -> Sequence[Figure]:
        """Draw figure 8, what one curve makes of materials, and the time of flight of eq. (3)."""
        found = sensor_runs(table)
        by_sensor: list[Mark] = []
        ticks = np.linspace(1.0, 4095.0, 400)
        for finger in Finger:
            of, colour = found.of(*case(finger)), FINGER_COLOURS[finger]
            d, x = readings_of_rows(of.rows[:1], runs)
            by_sensor.append(Mark(x[::_EVERY], 1e3 * d[::_EVERY], ".", colour, style={"ms": 3, "alpha": 0.6}))
            for fit in fits_of(of)[:1]:
                constants = ", ".join(
                    f"{1e3 * getattr(fit, n):.{k}f}" for n, k in zip(_CONSTANTS, (1, 2) * 2, strict=True)
                )
                by_sensor.append(
                    Mark(ticks, 1e3 * fit.distance(ticks), "-", colour, f"{finger.name.lower()}: {constants}")
                )
        own = 1e3 * controller_curve().distance(ticks)
        by_sensor.append(Mark(ticks, own, "--", SOFT, "the controller's", style={"lw": 1.0}))
        by_face: list[Mark] = []
        one_curve: list[Mark] = []
        for k, rho in enumerate(REFLECTIVITIES):
            rows = found.of(*case(Finger.RING, reflectivity=rho)).rows[:1]
            d, x = readings_of_rows(rows, runs)
            if rows:
                style, colour, label = {"ms": 3}, COLOURS[k % len(COLOURS)], f"reflectivity {rho:g}"
                by_face.append(Mark(x[::3], 1e3 * d[::3], ".", colour, label, style=style))
                one_curve.append(Mark(1e3 * d, 1e3 * apparent_distance(x), ".", colour, label, style=style))
        reading = {"xlabel": "reading of the converter (ticks)", "ylabel": "distance (mm)"}
        limits = {"xlim": (0, 4095), "ylim": (0, 86)}
        ends = [0.0, 1e3 * ReflexParams().distance_max]
        one_curve += [Mark(ends, ends, "-", SOFT, style={"lw": 0.8})]
        square = {"xlim": (0, 67), "ylim": (0, 67), "aspect": "equal"}
        square |= {"xlabel": "distance along the beam (mm)", "ylabel": "distance by the controller's curve (mm)"}
        target = level(1e3 * ReflexParams().target, label="target", lw=0.8)
        return [
            *drawn(folder / "characteristic", "Distance over reading as in [Luberto] fig. 8: points are readings as a "
                   "sensor comes to a box, lines the fits of eq. (11), with a, b, c, d in mm and 1/1000 ticks. Nearer "
                   "than 4 mm readings fall again; beyond 65 mm nothing comes back.",
                   [Panel(by_sensor, {"title": "sensors, reflectivity 1", **reading, **limits}),
                    Panel(by_face, {"title": "the ring's sensor, by reflectivity", **reading, **limits})], 2,
                   size=(9.0, 5.0), legend=3),
            *drawn(folder / "one_curve", "What the controller's one curve, [Luberto] eq. (11), makes of readings by "
                   "the face's reflectivity (the ring's sensor). A face that returns less seems farther, so the hand "
                   "is nearer than it believes.", [Panel([*one_curve, target], square)], size=(6.2, 5.4), legend=3),
            *_draw_flight(folder),
        ]  # fmt: skip


def sensor_runs(table: CampaignTable) -> Runs:
    """Return the runs that succeeded, as a touched box may have moved."""
    return IrSensorCurve().runs(table, lambda row: is_done(row) and bool(row["success"]), free=("last",))


def fits_of(runs: Runs) -> list[Fit]:
    """Return the fits of runs."""
    rows = [row for row in runs if row["fit_a"] is not None and row["fit_a"] == row["fit_a"]]
    return [Fit(*(row[f"fit_{name}"] for name in _CONSTANTS), residual=row["fit_residual"]) for row in rows]


def readings_of_rows(rows: Sequence[Row], runs: Path) -> tuple[Floats, Floats]:
    """Return distances, m, and readings, ticks, of rows' runs, whose folders are in `runs`, one after the other."""
    found = [
        readings_of(record, Finger[row["finger"].upper()]) for row in rows for record in records_of([row["run"]], runs)
    ]
    if not found:
        return np.zeros(0), np.zeros(0)
    distances, ticks = zip(*found, strict=True)
    return np.concatenate(distances), np.concatenate(ticks)


def _last(point: Point) -> str:
    """Return where an approach ends, m: before an oblique face the finger's own end would touch it."""
    return _LAST[Finger[point["finger"].upper()]] if point["incidence"] == "0" else "0.010"


def _deviations(fits: Sequence[Fit]) -> dict[str, float]:
    """Return the largest deviation of each constant from its mean over fits, as a part of the mean."""
    values = {name: np.array([getattr(fit, name) for fit in fits]) for name in _CONSTANTS}
    return {name: float(np.max(np.abs(v / v.mean() - 1.0))) for name, v in values.items()}


def _largest_error(fits: Sequence[Fit]) -> float:
    """Return how far the controller's curve is from fits at most, m."""
    curve = controller_curve().distance(_COMPARED)
    return max(float(np.max(np.abs(fit.distance(_COMPARED) - curve))) for fit in fits)


def _form(runs: Runs) -> Claim:
    says = Statement(
        "Distance over reading follows y = a exp(b x) + c exp(d x).",
        "sec. V-B, eq. (11), fig. 8",
        "a curve, without coefficients",
    )
    left = runs.of(*case()).metric("fit_residual")
    if not len(left):
        return Statement(says.claim, says.where).unknown()
    measured = f"fits leave {1e3 * left.min():.2f} to {1e3 * left.max():.2f} mm (root mean square)"
    return says.not_comparable(measured, _BY_CONSTRUCTION)


def _alike(runs: Runs) -> Claim:
    says = Statement("a, b, c, d vary only slightly from one sensor to another.", "sec. V-B", "only slightly")
    found = {t: fits for t in (0.0, *TOLERANCES) if (fits := fits_of(runs.of(*case(tolerance=t))))}
    if not found:
        return says.unknown()
    parts = [
        f"off by {format_share(t)}: {100 * max(_deviations(fits).values()):.0f} %, {1e3 * _largest_error(fits):.1f} mm"
        for t, fits in found.items()
    ]
    return says.not_comparable("; ".join(parts), _PUT_IN)


def _in_order(runs: Runs) -> Claim:
    """Return what of a relative measure the readings can show: that nearer reads as nearer."""
    says = Statement(
        "A relative estimate of the distance is enough, which one curve gives for all materials.", "sec. V-B", "enough"
    )
    ranks = {rho: runs.of(*case(reflectivity=rho)).metric("rank_correlation") for rho in REFLECTIVITIES}
    least = {rho: float(found.min()) for rho, found in ranks.items() if len(found)}
    if len(least) < 2:
        return says.unknown("There are runs of fewer than two materials.")
    worst = min(least, key=lambda rho: least[rho])
    return says.not_comparable(
        f"rank correlation {least[worst]:.4f} at least (reflectivity {worst:g})",
        "By construction readings are the reflectivity times one falling curve, so that nearer reads as nearer but for "
        "noise. What one curve does to grasps is judged by the experiment ir-limits.",
    )


def _one_curve(runs: Runs) -> Claim:
    target, allowed = ReflexParams().target, float(np.sqrt(ReflexParams().threshold))
    says = Statement(
        f"With one curve the distance is wrong by less than {1e3 * allowed:.0f} mm at the target of "
        f"{1e3 * target:.0f} mm, for reflectivities from {_SPAN[0]:g} to {_SPAN[1]:g}."
    )
    within = [rho for rho in REFLECTIVITIES if _SPAN[0] <= rho <= _SPAN[1]]
    seen = {rho: runs.of(*case(reflectivity=rho)).metric("apparent_at_10_mm") for rho in within}
    errors = {rho: float(np.abs(found - target).max()) for rho, found in seen.items() if len(found)}
    if not errors:
        return says.unknown()
    lacking = [f"{rho:g}" for rho in within if rho not in errors]
    return says.judged(
        "; ".join(f"{1e3 * error:.1f} mm at {rho:g}" for rho, error in errors.items()),
        max(errors.values()) < allowed,
        "it is so in each run",
        "The bound is that part of the reflex's threshold of cost which each of two fingers has."
        + (f" There are no runs at {', '.join(lacking)}." if lacking else ""),
        enough=not lacking or max(errors.values()) >= allowed,
    )


def _fit(title: str, fits: Sequence[Fit], *, own: bool = False) -> dict[str, str]:
    units = {"a": "mm", "b": "1/1000 ticks", "c": "mm", "d": "1/1000 ticks"}
    medians = {name: float(np.median([getattr(f, name) for f in fits])) for name in units}
    return {
        "sensor and face": title,
        **{f"{name} ({unit})": f"{1e3 * medians[name]:.3g}" for name, unit in units.items()},
        "residual (mm)": "" if own else f"{1e3 * np.median([f.residual for f in fits]):.2f}",
        "curves apart (mm)": "" if own else f"{1e3 * _largest_error(fits):.1f}",
    }


def _spread(tolerance: float, fits: Sequence[Fit]) -> dict[str, str]:
    return {
        "off by at most": f"{100 * tolerance:.0f} %",
        "sensors": str(len(fits)),
        **{name: f"{100 * v:.1f} %" for name, v in _deviations(fits).items()},
        "curves apart (mm)": f"{1e3 * _largest_error(fits):.1f}",
    }


def _material(rho: float, runs: Runs) -> dict[str, str]:
    cells = {"reflectivity": f"{rho:g}"}
    for name, d in AT.items():
        values = runs.metric(name)
        seen = 2 * len(values) > len(runs)
        cells[f"at {1e3 * d:.0f} mm"] = f"{1e3 * np.median(values):.1f}" if seen else "not seen"
    first = runs.metric("first_seen")
    return {**cells, "seen from": f"{1e3 * np.median(first):.0f}" if len(first) else "not seen"}


def _draw_flight(folder: Path) -> list[Figure]:
    near, far = 4.0, 65.0
    d, y = np.linspace(near, far, 200), 1e3 * controller_curve().distance(np.arange(0.0, 4096.0))
    shown = (y >= near) & (y <= far)
    axes = {"xlabel": "distance (mm)", "xlim": (0, 67)}
    flight = Mark(d, 1e12 * time_of_flight(d / 1e3), "-", COLOURS[0])
    steps = Mark(y[shown], -1.0 / np.gradient(y)[shown], "-", COLOURS[1])
    per_mm = 1e12 * float(time_of_flight(np.array(1e-3)))
    caption = (
        f"Eq. (3) of [Luberto] gives the distance by time of flight, {per_mm:.1f} ps a millimetre; the hardware "
        "measures intensity instead (sec. V-B). Right: by the controller's curve, by how many ticks the reading "
        "changes with a millimetre."
    )
    panels = [
        Panel([flight], {"title": "eq. (3): t = 2 d / v", "ylabel": "time of flight (ps)", **axes}),
        Panel([steps], {"title": "eq. (11): intensity", "ylabel": "ticks per mm", "yscale": "log", **axes}),
    ]
    return drawn(folder / "time_of_flight", caption, panels, 2, size=(9.0, 3.2))
