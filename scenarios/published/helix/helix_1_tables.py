"""Tables of `helix-1`: table 1 of [Vervloet2025] in its layout, its steps, its times by place, and fig. 9."""

from collections.abc import Callable, Sequence

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.scenarios.campaign.statistics import Statistic
from handover.scenarios.helix.parameters import HandPlace, Tuning
from handover.scenarios.published.helix.helix_1_runs import Helix1Runs, published
from handover.scenarios.published.published_experiment import ComparisonTable
from handover.scenarios.published.verdicts import format_median

_ON_EQUAL_BOUNDS = (
    " The thesis's ε_pose,bound and ε_control are both 5 mm. One iteration of the Jacobian loop leaves about "
    "ε_pose,bound, so that the last digits decide whether the loop goes on. Where it does, it takes that much back "
    "from the step, and the error stalls near ε_pose,bound / α: at α = 0.1 that is 50 mm, the threshold itself."
)

_ON_ASSUMED = (
    "The arm's stiffness and masses were chosen for these three lengths in one state at rest, and the ball's place is "
    "assumed: 0.19 m from there."
)
_ON_FITTED = (
    "The arm's axial stiffness and prestress were fitted to these lengths at α = 0.1, on average over the places, with "
    "the ball 0.16 m from there; times were not fitted, but known when arm and place were chosen."
)


def table_1(arm: Helix1Runs) -> ComparisonTable:
    """Return the times for the arm's movement by step size, published beside ours."""
    printed = published()
    header = ["α", *(f"{alpha} {whose}" for alpha in arm.alphas for whose in ("published", "ours"))]
    rows = [
        _row("Minimum", printed["arm_time_min"], arm, lambda x: _figure(x, np.min)),
        _row("Median", printed["arm_time_median"], arm, lambda x: format_median(x, 1)),
        _row("Maximum", printed["arm_time_max"], arm, lambda x: _figure(x, np.max)),
        _row("Mean", _plus_minus(printed["arm_time_mean"], printed["arm_time_std"]), arm, _mean),
        ["Timestep"],
        ["Gripper began to close"],
        ["Handover succeeded"],
    ]
    for alpha, timestep in zip(arm.alphas, _plus_minus(printed["timestep_mean"], printed["timestep_std"]), strict=True):
        tried, runs = len(arm.rows[alpha]), printed["runs"]
        succeeded = sum(bool(row["success"]) for row in arm.rows[alpha])
        rows[4] += [timestep, ", ".join(sorted({f"{row['control_period']:.2f}" for row in arm.rows[alpha]}))]
        rows[5] += [f"{runs} of {runs}", f"{len(arm.times(alpha))} of {tried}"]
        rows[6] += [f"{runs} of {runs}", f"{succeeded} of {tried}"]
    note = (
        "Time until the gripper begins to close, in s; the handover takes another 10 s. In brackets: 95 % interval by "
        "bootstrap. ±: standard deviation of the runs. Our time step is set, the published one is what computing took."
    )
    return ComparisonTable(title=f"Table 1, {arm.title}", header=header, rows=rows, note=note)


def steps(arm: Helix1Runs) -> ComparisonTable:
    """Return how many control steps the arm takes, which does not depend on the time of a step."""
    printed = published()
    rows: list[Sequence[str]] = []
    for i, alpha in enumerate(arm.alphas):
        x, step = arm.metric("steps", alpha), printed["timestep_mean"][i]
        ends = [f"{printed[f'arm_time_{end}'][i] / step:.0f}" for end in ("min", "max")]
        ours = ["–".join(_figure(x, end, 0) for end in (np.min, np.max)) if len(x) else ""]
        rows.append([str(alpha), str(printed["steps_median"][i]), "–".join(ends), format_median(x, 0), *ours])
    header = ["α", "published median", "published range", "our median", "our range"]
    note = "Published: times of table 1 over its mean time steps. In brackets: 95 % interval by bootstrap."
    if arm.tuning is Tuning.THESIS:
        note += _ON_EQUAL_BOUNDS
    return ComparisonTable(title=f"Control steps, {arm.title}", header=header, rows=rows, note=note)


def by_place(arm: Helix1Runs) -> ComparisonTable:
    """Return the times at each place, which the paper does not give."""
    rows = [
        [place.name.lower().replace("_", "-"), *(_at(arm, place, alpha) for alpha in arm.alphas)] for place in HandPlace
    ]
    note = "Time of each run until the gripper begins to close, in s. ✗: the handover did not succeed."
    header = ["place", *(f"α = {alpha}" for alpha in arm.alphas)]
    return ComparisonTable(title=f"Times by place, {arm.title}", header=header, rows=rows, note=note)


def fig_9(arm: Helix1Runs) -> ComparisonTable:
    """Return how far the model is from the arm at the end, in the words of sec. 5.2."""
    printed = published()
    lengths = (("model to arm", "model_mismatch"), ("arm", "arm_travel"), ("model", "model_travel"))
    rows = [
        [name, f"{printed[metric]:.2f}", *(_figure(arm.metric(metric, alpha), np.mean, 3) for alpha in arm.alphas)]
        for name, metric in lengths
    ]
    header = ["m", "α = 0.1, published", *(f"α = {alpha}, ours" for alpha in arm.alphas)]
    note = (
        "When the gripper begins to close, in m, means of the runs: gripper of the commanded state to the measured "
        f"one, and both from where the gripper hangs after calibration. {_ON_FITTED if arm.fitted else _ON_ASSUMED}"
    )
    return ComparisonTable(title=f"Model and arm as in fig. 9, {arm.title}", header=header, rows=rows, note=note)


def _row(name: str, printed: Sequence[float | str], arm: Helix1Runs, text: Callable[[Floats], str]) -> list[str]:
    ours = [text(arm.times(alpha)) for alpha in arm.alphas]
    return [name, *(str(cell) for pair in zip(printed, ours, strict=True) for cell in pair)]


def _at(arm: Helix1Runs, place: HandPlace, alpha: float) -> str:
    here = [row for row in arm.rows[alpha] if row["place"] == place.name.lower()]
    times = ("never" if row.get("arm_time") is None else f"{row['arm_time']:.1f}" for row in here)
    return ", ".join(time if row["success"] else f"{time} ✗" for time, row in zip(times, here, strict=True))


def _plus_minus(values: Sequence[float], deviations: Sequence[float]) -> list[str]:
    return [f"{v} ± {d}" for v, d in zip(values, deviations, strict=True)]


def _mean(x: Floats) -> str:
    return f"{np.mean(x):.1f} ± {np.std(x, ddof=1):.1f}" if len(x) > 1 else _figure(x, np.mean)


def _figure(x: Floats, statistic: Statistic, digits: int = 1) -> str:
    return f"{statistic(x):.{digits}f}" if len(x) else ""
