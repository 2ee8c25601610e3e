"""Figure 8 of Luberto et al.: what the infrared sensors read over distance, and the curve of eq. (11) through it."""

from collections.abc import Sequence
from pathlib import Path
from typing import ClassVar

import numpy as np

from handover.controllers.ir_grasp.parameters import Params as ReflexParams
from handover.scenarios.campaign.plan import CampaignPlan
from handover.scenarios.campaign.table import CampaignTable
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.ir_grasp.ir_sensor import AT, Finger, IrSensor
from handover.scenarios.ir_grasp.sensor_curve import Fit, controller_curve
from handover.scenarios.published.ir_grasp.ir_sensor_cases import (
    CONSTANTS,
    INCIDENCES,
    REFLECTIVITIES,
    TOLERANCES,
    Case,
    SensorRuns,
)
from handover.scenarios.published.ir_grasp.ir_sensor_figures import draw_sensor
from handover.scenarios.published.published_experiment import Claim, ComparisonTable, PublishedExperiment, Verdict
from handover.scenarios.published.verdicts import format_share, nothing_measured, verdict_of

_LAST = {Finger.THUMB: "0.003", Finger.INDEX: "0.010", Finger.RING: "0.003"}
"""Ends of the approaches, m: below the range, but for the index, before which the ring finger would touch the box."""

_REPETITIONS = 3
_SPAN = (0.5, 1.5)
"""Reflectivities about 1 between which one curve is asked to be good enough."""

_COMPARED = np.linspace(100.0, 3000.0, 30)
"""Readings, ticks, at which curves are compared: from some 63 to 6 mm."""

_BY_CONSTRUCTION = (
    "The sensors of the scene have a curve of this form by construction, so agreement is no evidence: what is left are "
    "the width of the beam, noise and rounding. The paper prints no coefficients."
)
_PUT_IN = (
    "How far sensors differ is put in: in the scene they are alike but for where they are on the hand, or each "
    "constant is off by a stated part, drawn evenly. The paper gives no figures for its circuit's tolerances."
)


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
        tolerances = TOLERANCES[1:2] if quick else TOLERANCES
        cases = [Case(finger, rho) for rho in ((1.0,) if quick else REFLECTIVITIES) for finger in Finger]
        cases += [Case(Finger.RING, rho) for rho in (0.5, 2.0)] if quick else []
        cases += [] if quick else [Case(Finger.RING, incidence=angle) for angle in INCIDENCES]
        cases += [Case(finger, tolerance=t) for t in tolerances for finger in Finger]
        return CampaignPlan(
            scenario=self.scenario,
            points=[{**case.parameters, "last": _last(case)} for case in cases],
            repetitions=1 if quick else _REPETITIONS,
            seed=8,
            experiment=self.name,
        )

    def claims(self, table: CampaignTable) -> Sequence[Claim]:
        """Judge the form of the curve, how alike sensors are, and what one curve for all materials is worth."""
        runs = SensorRuns(table)
        return [_form(runs), _alike(runs), _in_order(runs), _one_curve(runs)]

    def tables(self, table: CampaignTable) -> Sequence[ComparisonTable]:
        """Return the fits of eq. (11), and what one curve makes of materials."""
        runs = SensorRuns(table)
        return [_fits(runs), _spreads(runs), _materials(runs)]

    def draw(self, table: CampaignTable, runs: Path, folder: Path) -> Sequence[Figure]:
        """Draw figure 8, what one curve makes of materials, and the time of flight of eq. (3)."""
        return draw_sensor(SensorRuns(table), runs, folder)


def _last(case: Case) -> str:
    """Return where an approach ends, m: before an oblique face the finger's own end would touch it."""
    return _LAST[Finger[case.values["finger"].upper()]] if case.incidence == 0.0 else "0.010"


def _form(runs: SensorRuns) -> Claim:
    sentence, where = "Distance over reading follows y = a exp(b x) + c exp(d x).", "sec. V-B, eq. (11), fig. 8"
    residuals = runs.values(Case(), "fit_residual")
    if not len(residuals):
        return nothing_measured(sentence, where)
    return Claim(
        claim=sentence,
        published="a curve, without coefficients",
        measured=f"fits leave {1e3 * residuals.min():.2f} to {1e3 * residuals.max():.2f} mm (root mean square)",
        verdict=Verdict.NOT_COMPARABLE,
        reason=_BY_CONSTRUCTION,
        where=where,
    )


def _alike(runs: SensorRuns) -> Claim:
    sentence, where = "a, b, c, d vary only slightly from one sensor to another.", "sec. V-B"
    parts = [
        f"off by {format_share(tolerance)}: {spread}"
        for tolerance in (0.0, *TOLERANCES)
        if (spread := _spread(runs, tolerance))
    ]
    if not parts:
        return nothing_measured(sentence, where, "only slightly")
    return Claim(
        claim=sentence,
        published="only slightly",
        measured="; ".join(parts),
        verdict=Verdict.NOT_COMPARABLE,
        reason=f"{_PUT_IN} By that part: the largest deviation of any constant from its mean, and of a curve from "
        "that of the controller.",
        where=where,
    )


def _spread(runs: SensorRuns, tolerance: float) -> str:
    fits = runs.fits(Case(tolerance=tolerance))
    if not fits:
        return ""
    return f"{100 * max(_deviations(fits).values()):.0f} %, {1e3 * _largest_error(fits):.1f} mm"


def _deviations(fits: Sequence[Fit]) -> dict[str, float]:
    """Return the largest deviation of each constant from its mean over fits, as a part of the mean."""
    values = {name: np.array([getattr(fit, name) for fit in fits]) for name in CONSTANTS}
    return {name: float(np.max(np.abs(v / v.mean() - 1.0))) for name, v in values.items()}


def _largest_error(fits: Sequence[Fit]) -> float:
    """Return how far the controller's curve is from fits at most, m."""
    curve = controller_curve().distance(_COMPARED)
    return max(float(np.max(np.abs(fit.distance(_COMPARED) - curve))) for fit in fits)


def _in_order(runs: SensorRuns) -> Claim:
    """Return what of a relative measure the readings can show: that nearer reads as nearer."""
    sentence = "A relative estimate of the distance is enough, which one curve gives for all materials."
    where = "sec. V-B"
    ranks = {rho: runs.values(Case(reflectivity=rho), "rank_correlation") for rho in REFLECTIVITIES}
    ranks = {rho: found for rho, found in ranks.items() if len(found)}
    if len(ranks) < 2:
        return nothing_measured(sentence, where, "enough", reason="There are runs of fewer than two materials.")
    least = {rho: float(found.min()) for rho, found in ranks.items()}
    worst = min(least, key=lambda rho: least[rho])
    return Claim(
        claim=sentence,
        published="enough",
        measured=f"rank correlation {least[worst]:.4f} at least (reflectivity {worst:g})",
        verdict=Verdict.NOT_COMPARABLE,
        reason="By construction: readings of the scene's sensors are the reflectivity times one falling curve, so that "
        "nearer reads as nearer but for noise. The rank correlation is that of distances by the controller's curve "
        f"with the true ones from 10 mm to 60 mm, as far as the face is seen, of reflectivities from {min(ranks):g} to "
        f"{max(ranks):g}. What one curve does to grasps is judged by the experiment ir-limits.",
        where=where,
    )


def _one_curve(runs: SensorRuns) -> Claim:
    target = 1e3 * ReflexParams().target
    allowed = float(np.sqrt(ReflexParams().threshold))
    sentence = (
        f"With one curve the distance is wrong by less than {1e3 * allowed:.0f} mm at the target of {target:.0f} mm, "
        f"for reflectivities from {_SPAN[0]:g} to {_SPAN[1]:g}."
    )
    errors = {
        rho: np.abs(runs.values(Case(reflectivity=rho), "apparent_at_10_mm") - ReflexParams().target)
        for rho in REFLECTIVITIES
        if _SPAN[0] <= rho <= _SPAN[1]
    }
    errors = {rho: found for rho, found in errors.items() if len(found)}
    if not errors:
        return nothing_measured(sentence, beyond=True)
    return Claim(
        claim=sentence,
        published="",
        measured="; ".join(f"{1e3 * found.max():.1f} mm at {rho:g}" for rho, found in errors.items()),
        verdict=verdict_of(all(found.max() < allowed for found in errors.values()), could_be_either=len(errors) > 1),
        reason="Holds if it is so in each run. The bound is that part of the reflex's threshold of cost which each of "
        "two fingers has.",
        beyond=True,
    )


def _fits(runs: SensorRuns) -> ComparisonTable:
    cases = [(f"{f.name.lower()}, reflectivity {rho:g}", Case(f, rho)) for rho in REFLECTIVITIES for f in Finger]
    cases += [(f"ring, face at {np.degrees(x):.0f}°", Case(Finger.RING, incidence=x)) for x in INCIDENCES]
    curve = controller_curve()
    rows = [["the controller's curve", *_constants([curve]), "", ""]]
    for title, case in cases:
        fits = runs.fits(case)
        if fits:
            rows.append(
                [
                    title,
                    *_constants(fits),
                    f"{1e3 * np.median([f.residual for f in fits]):.2f}",
                    f"{1e3 * _largest_error(fits):.1f}",
                ]
            )
    note = (
        "Medians over runs, by least squares in distance over 4 to 60 mm. Two exponentials are hard to separate: "
        "constants differ more than curves do. Fits of a face that returns more or less are of another curve, since "
        "readings grow with what comes back. The last column: from the controller's curve, at readings of 100 to 3000."
    )
    if runs.unusable:
        note += f" {runs.unusable} runs failed, or touched the box, and do not count."
    header = [
        "sensor and face",
        "a (mm)",
        "b (1/1000 ticks)",
        "c (mm)",
        "d (1/1000 ticks)",
        "residual (mm)",
        "curves apart (mm)",
    ]
    return ComparisonTable(title="Fits of eq. (11), as in fig. 8", header=header, rows=rows, note=note)


def _constants(fits: Sequence[Fit]) -> list[str]:
    scales = {"a": 1e3, "b": 1e3, "c": 1e3, "d": 1e3}
    return [f"{scale * float(np.median([getattr(f, name) for f in fits])):.3g}" for name, scale in scales.items()]


def _spreads(runs: SensorRuns) -> ComparisonTable:
    rows: list[list[str]] = []
    for tolerance in (0.0, *TOLERANCES):
        fits = runs.fits(Case(tolerance=tolerance))
        if fits:
            deviations = [f"{100 * v:.1f} %" for v in _deviations(fits).values()]
            rows.append([f"{100 * tolerance:.0f} %", str(len(fits)), *deviations, f"{1e3 * _largest_error(fits):.1f}"])
    return ComparisonTable(
        title="Sensors whose constants are off",
        header=["off by at most", "sensors", *CONSTANTS, "curves apart (mm)"],
        rows=rows,
        note="Largest deviation of each fitted constant from its mean over the sensors, and of the sensors' curves "
        "from the one that the controller has for all, at readings of 100 to 3000. All before a face of reflectivity "
        "1.",
    )


def _materials(runs: SensorRuns) -> ComparisonTable:
    rows: list[list[str]] = []
    for rho in REFLECTIVITIES:
        case = Case(reflectivity=rho)
        if runs.rows(case):
            seen = [_apparent(runs, case, name) for name in AT]
            first = runs.values(case, "first_seen")
            rows.append([f"{rho:g}", *seen, f"{1e3 * np.median(first):.0f}" if len(first) else "not seen"])
    return ComparisonTable(
        title="Distance by the controller's one curve (mm)",
        header=["reflectivity", *(f"at {1e3 * d:.0f} mm" for d in AT.values()), "seen from"],
        rows=rows,
        note="Medians over sensors and runs. A distance by the curve beyond 65 mm is not seen.",
    )


def _apparent(runs: SensorRuns, case: Case, name: str) -> str:
    values = runs.values(case, name)
    if 2 * len(values) <= len(runs.rows(case)):
        return "not seen"
    return f"{1e3 * np.median(values):.1f}"
