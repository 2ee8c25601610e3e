"""Experiment 2 of [Gandarias2020], sec. V-B and figs. 6 and 7: a curve by rigid kinematics and by what was learned."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from textwrap import wrap
from typing import Any, ClassVar

import numpy as np
from matplotlib.axes import Axes

from handover.controllers.vsl.hybrid_kinematics import Learned
from handover.controllers.vsl.model_text import InvalidModel, read_model
from handover.cosim.blocks.ports import Floats
from handover.cosim.exceptions import counted
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.paper import paper_values
from handover.scenarios.experiment.plotting import COLOURS
from handover.scenarios.published.figures import Drawable, Mark, Panel, drawn, level
from handover.scenarios.published.published_experiment import Claim, ComparisonTable, PublishedExperiment, Verdict
from handover.scenarios.published.runs import Point, Runs
from handover.scenarios.published.tables import table_of
from handover.scenarios.published.verdicts import without_verdict
from handover.scenarios.published.vsl.path_traces import (
    EQUAL,
    PathBand,
    PathTrace,
    Repetitions,
    desired_path,
    has_completed_path,
    path_of,
    traces_of,
)
from handover.scenarios.published.vsl.separation import Comparison, in_mm, separation_claim, spread_in_mm
from handover.scenarios.robots.vsl.parameters import BAR
from handover.scenarios.robots.vsl.path_experiments import VslHybrid
from handover.scenarios.robots.vsl.plots import draw_box
from handover.scenarios.runs.campaign.plan import CampaignPlan
from handover.scenarios.runs.campaign.table import CampaignTable

_PUBLISHED, _BEYOND = (paper_values("vsl", group) for group in ("published", "beyond"))
_SEED = 2021
"""Of the campaign; nothing was learned from its runs."""

CASES: Mapping[str, Point] = {
    f"{1000 * load:g} g, {pressure / BAR:g} bar": {"load": f"{load:g}", "pressure": f"{pressure:g}"}
    for load, pressure in _PUBLISHED["experiment_2"]
}
"""Left and right of fig. 6; of fig. 7, which names neither, assumed to be the same."""

MODEL_BASED = "model-based"
"""By rigid kinematics, while the hybrid forward model estimates the tip: figs. 6 and 7."""
CUBIC, SMALL, NETWORK, BEAM = "cubic polynomials", "small network", "the paper's network", "beam"
LEARNED: Mapping[str, Point] = {
    CUBIC: {"learned": "cubic"},
    SMALL: {"learned": "small"},
    NETWORK: {"learned": "published"},
    BEAM: {"learned": "physics"},
}
TRACKER, IMU = "polynomials and tracker", "polynomials and IMUs"
FEEDBACK: Mapping[str, Point] = {
    TRACKER: {"learned": "cubic", "closed_loop": "true"},
    IMU: {"learned": "cubic", "imu": "feedback"},
}
"""Beyond the paper's open loop, of its future work: with feedback by a tracker of 30 Hz, or by an IMU a link."""
RIGID = "rigid arm"
JOINTS: Mapping[float, str] = {
    factor: RIGID if factor == 1.0 else f"{RIGID}, joints x {factor:g}" for factor in _BEYOND["joint_factors"]
}
"""Arms of rigid links by rigid kinematics, by how many times as stiff as assumed their joints are."""
METHODS: Mapping[str, Point] = {
    MODEL_BASED: {"kinematics.method": "estimate"},
    **LEARNED,
    **FEEDBACK,
    **{
        label: {"links": "rigid", "kinematics.method": "model_based", "joint_factor": f"{factor:g}"}
        for factor, label in JOINTS.items()
    },
}
TRAINED = "trained"
_SCATTER: float = _BEYOND["scatter"]
"""Standard deviation by which each link, gear and joint of another arm differs, as a share."""
_FACTOR, _FRICTION = (f"{_BEYOND[name]:g}" for name in ("factor", "friction_factor"))
_MORE = f"{100 * (_BEYOND['factor'] - 1):.0f} %"
OTHERS: Mapping[str, Point] = {
    f"links {_MORE} stiffer": {"EI_factor": _FACTOR},
    f"links {_MORE} heavier": {"mass_factor": _FACTOR},
    f"friction x {_FRICTION}": {"friction_factor": _FRICTION},
    **{
        f"arm {n} of its kind": {"arm_scatter": f"{_SCATTER:g}", "arm_seed": str(n)}
        for n in range(1, _BEYOND["arms"] + 1)
    },
}
"""Arms that nothing was learned from: with one thing otherwise, and some whose links scatter."""
ARMS: Mapping[str, Point] = {TRAINED: {}, **OTHERS}

_NO_NETWORK = "The paper claims this of its network; `--model` takes the file of a trained one."
_RIGID_BY_CHOICE = (
    "How far the rigid arm's joints yield was chosen, and whether the hybrid has less error depends on that. The "
    "claims beyond the paper say at which stiffness it falls."
)
_OWN_LAW = (
    " The beam has the law of bending and the masses of the simulated arm itself: on a real arm its errors would be "
    "larger."
)
_RANKS = {MODEL_BASED: "most", RIGID: "between"}
"""What sec. V-C says of the errors of fig. 7(b), of which it prints no numbers; of the learned method the least."""
_WORDS = {Verdict.REPRODUCED: "yes", Verdict.NOT_REPRODUCED: "no", Verdict.NOT_COMPARABLE: "too few runs"}
_BLUE, _RED, _GREEN, _PURPLE = COLOURS[:4]
_STROKES: tuple[Any, ...] = ("-", "--", ":", "-.")


class Vsl2(PublishedExperiment):
    """The curve with 25 g at 1.5 bar and with 75 g at 0.5 bar, five times each, by rigid kinematics and by corrections.

    Corrections are those of cubic polynomials, the default, of a small network, and of a beam of four fitted numbers.
    These ship; the paper's network is tried if `--model` gives the file of one. Polynomials are tried with
    feedback, too, by the tracker or by an IMU a link. Besides, the arm of rigid links goes by rigid kinematics, with
    joints as stiff as assumed and stiffer. Corrections are tried on the arm that they were learned from, and on others.
    The quick plan has each case once by rigid kinematics and by polynomials, on the arm that was learned from and on
    another, and on two rigid arms.

    The beam has the law of bending and the masses of the arm that it is tried on (an inverse crime). Its errors are the
    least that such a correction could reach, and say nothing of one on a real arm.
    """

    name: ClassVar[str] = "vsl-2"
    title: ClassVar[str] = "the same by rigid kinematics and by learned corrections ([Gandarias2020] figs. 6, 7)"
    scenario: ClassVar[str] = VslHybrid.name

    def __init__(self) -> None:
        self._network: Path | None = None

    def take_model(self, file: Path) -> None:
        """Let the paper's network be tried, too, from the file of a trained one.

        Raises:
            InvalidModel: it is none, or of another kind.
        """
        model = read_model(file)
        if model.kind is not Learned.PUBLISHED:
            kind = model.kind.name.lower()
            remedy = "handover vsl-train --learned published"
            raise InvalidModel(str(file), f"it is a {kind} model, and not the paper's network", remedy)
        self._network = file

    def plan(self, quick: bool) -> CampaignPlan:
        """Return cases x methods, and cases x corrections x other arms, five times each; if quick, a few once."""
        network = () if self._network is None else (NETWORK,)
        rigid, arms = [*JOINTS.values()], [*OTHERS]
        methods = (MODEL_BASED, CUBIC, SMALL, BEAM, *network, *FEEDBACK)
        if quick:
            methods, rigid, arms = (MODEL_BASED, CUBIC, *network), [rigid[0], rigid[-1]], arms[:1]
        tried = [*product((TRAINED, *arms), methods), *product((TRAINED,), rigid)]
        given = {NETWORK: {"model": str(self._network)}}
        points = [
            {**CASES[case], **METHODS[method], **ARMS[arm], **given.get(method, {})}
            for arm, method in tried
            for case in CASES
        ]
        return self.campaign(points, repetitions=1 if quick else _BEYOND["repetitions"], seed=_SEED)

    def claims(self, table: CampaignTable) -> Sequence[Claim]:
        """Judge what sec. V-C says of figs. 6 and 7, and beyond it stiffer rigid arms and arms not learned from."""
        runs = Vsl2Runs(table)
        hybrid, others = runs.hybrid, [*product(CASES, runs.arms)]
        inverse, by = "With the hybrid inverse model", f"Measured by {hybrid}."
        of_network = separation_claim(
            _ESTIMATES.format(f"{NETWORK}, while the tip goes by its commands"),
            "sec. V-C, fig. 6",
            "more precisely",
            runs.estimates(NETWORK),
        )
        command, rigid = (
            separation_claim(f"{inverse} {what}.", "sec. V-C, fig. 7(b)", "lower", runs.compared(hybrid, other))
            for what, other in (
                ("the tip's error is less than with rigid kinematics", MODEL_BASED),
                ("the soft arm's tip has less error than that of an arm with rigid links", RIGID),
            )
        )
        command, rigid = (replace(claim, reason=f"{claim.reason} {by}") for claim in (command, rigid))
        if hybrid != NETWORK:
            command = without_verdict(command, _NO_NETWORK)
            of_network = replace(of_network, reason=_NO_NETWORK)
        arms = f"each of the {len(runs.arms)} arms" if len(runs.arms) > 1 else "the one arm"
        on = f"On {arms} tried from which nothing was learned the tip's error is less by"
        own = [(_ESTIMATES.format(f"{CUBIC} that ship, while the tip goes by rigid kinematics"),
                runs.estimates(MODEL_BASED))]  # fmt: skip
        own += [
            (f"By {hybrid} the soft arm's tip has less error than that of a rigid arm with joints "
             f"{'' if factor == 1.0 else f'{factor:g} times '}as stiff as assumed.", runs.compared(hybrid, label))
            for factor, label in runs.joints.items()
        ]  # fmt: skip
        for method in runs.learned if runs.arms else ():
            own += [
                (f"{on} {method} than by rigid kinematics.", runs.compared(method, MODEL_BASED, others)),
                (f"{on} {method} than that of the rigid arm.", runs.compared(method, RIGID, others, same_arm=False)),
            ]
        if IMU in runs.feedback:
            on_each = "On each arm tried the tip's error is less by polynomials with an IMU a link"
            every = [*product(CASES, (TRAINED, *runs.arms))]
            own.append((f"{on_each} than by polynomials alone.", runs.compared(IMU, CUBIC, every)))
        return [
            of_network,
            command,
            without_verdict(rigid, _RIGID_BY_CHOICE),
            *(separation_claim(sentence, "", "", comparisons) for sentence, comparisons in own),
        ]

    def tables(self, table: CampaignTable) -> Sequence[ComparisonTable]:
        """Return errors by method, the rigid arm's by its joints, those on other arms, and those of estimates."""
        runs = Vsl2Runs(table)
        tables = [*(_errors(runs, case) for case in CASES), _by_joints(runs), _other_arms(runs), _estimates(runs)]
        return [filled for filled in tables if filled.rows]

    def draw(self, table: CampaignTable, runs: Path, folder: Path) -> Sequence[Figure]:
        """Draw estimates, compensated paths and errors, like figs. 6 and 7, and errors by joints and by arm."""
        found = Vsl2Runs(table)
        traces = {(case, m): traces_of(runs, found.of(case, m).names) for case in CASES for m in found.methods}
        plain, hybrid = ([traces.get((case, m), []) for case in CASES] for m in (MODEL_BASED, found.hybrid))
        estimates = [_panel_of_estimates(case, t) for case, t in zip(CASES, plain, strict=True)] if all(plain) else []
        both = all(plain) and all(hybrid)
        compensated = [
            _panel_of_command(case, a[0], b[0], found.hybrid) for case, a, b in zip(CASES, plain, hybrid, strict=True)
        ] if both else []  # fmt: skip
        boxes = [
            Panel([_Box(k, traces[case, m], _colour(m)) for k, m in enumerate(found.methods)],
                  {"title": case, "ylabel": "error (mm)", **_logarithmic(_TICKS)}, _names(found.methods), _text(_TICKS))
            for case in CASES
        ] if found.methods and all(traces.values()) else []  # fmt: skip
        joints = [_panel_of_joints(found, case) for case in CASES]
        arms = [_panel_of_arms(found, case) for case in CASES]
        return [
            *drawn(folder / "estimates", "Where the tip is taken to be as it is commanded along the curve by rigid "
                   "kinematics, like [Gandarias2020] fig. 6. Means of the runs with bands of their standard "
                   "deviation. Equal scales.", estimates, 2, size=(9.0, 4.2)),
            *drawn(folder / "compensated", "The curve in a single run of each, like [Gandarias2020] fig. 7(a). Shown "
                   "are the tip by the tracker, and where the compensated command would put the tip of a rigid arm. "
                   "Equal scales.",
                   compensated, 2, size=(9.0, 4.2)),
            *drawn(folder / "errors", "Distances of the tip from the desired points of the curve, like [Gandarias2020] "
                   "fig. 7(b), of all runs: 25th to 75th percentile (box), range, median (line) and mean (dot).",
                   boxes, size=(11.0, 6.6)),
            *drawn(folder / "rigid_joints", "Mean error of an arm with rigid links by how many times its joints are "
                   "stiffer than assumed, and that of the soft arm, with joints as assumed, by what was learned.",
                   joints if len(found.joints) > 1 and found.learned else [], 2, size=(9.0, 3.6)),
            *drawn(folder / "other_arms", "Mean errors of the tip along the curve on the arm that was learned from and "
                   "on others, by method.", arms if found.arms else [], size=(9.0, 6.6)),
        ]  # fmt: skip


_ESTIMATES = (
    "The hybrid forward model, here {}, predicts the real position of the tip more precisely than rigid kinematics."
)


class Vsl2Runs:
    """Our results by case, method and arm, of runs that completed the path; and what of the plan any run is of."""

    def __init__(self, table: CampaignTable) -> None:
        tried = Vsl2().runs(table, keep=lambda _: True)
        self._done = tried.where(has_completed_path)
        left = len(tried) - len(self._done)
        self.unfinished = f" Not counted: {counted(left, 'run')} that did not complete the path." if left else ""
        first = next(iter(CASES))
        self.arms = [a for a in OTHERS if any(len(self.of(first, m, a)) for m in (MODEL_BASED, *LEARNED))]
        self.learned = [m for m in LEARNED if any(len(self.of(case, m)) for case in CASES)]
        self.feedback = [m for m in FEEDBACK if len(self.of(first, m))]
        self.joints = {factor: m for factor, m in JOINTS.items() if len(self.of(first, m))}
        plain = [MODEL_BASED] if len(self.of(first, MODEL_BASED)) else []
        self.methods = [*plain, *self.learned, *self.feedback, *self.joints.values()]
        self.soft = [m for m in self.methods if m in (MODEL_BASED, *LEARNED, *FEEDBACK)]
        self.hybrid = NETWORK if NETWORK in self.learned else CUBIC
        """The method that the paper's claims are judged by: its own network if there is one, else the default."""

    def of(self, case: str, method: str, arm: str = TRAINED) -> Runs:
        """Return the runs."""
        return self._done.of({**CASES[case], **METHODS[method], **ARMS[arm]})

    def error(self, case: str, method: str, arm: str = TRAINED) -> Floats:
        """Return the mean errors of the runs' tips, m."""
        return self.of(case, method, arm).metric("mean_error")

    def estimates(self, method: str) -> list[Comparison]:
        """Compare the errors of the hybrid forward model with those of rigid kinematics, run by run."""
        return [
            Comparison(case, *(self.of(case, method).metric(f"{x}_error") for x in ("estimate", "model")), paired=True)
            for case in CASES
        ]

    def compared(
        self, less: str, more: str, cases: Sequence[tuple[str, str]] = (), *, same_arm: bool = True
    ) -> list[Comparison]:
        """Compare a method on arms with another, on the same arm or else on the trained one."""
        found = cases or [(case, TRAINED) for case in CASES]
        return [
            Comparison(case if arm == TRAINED else f"{case}, {arm}", self.error(case, less, arm),
                       self.error(case, more, arm if same_arm else TRAINED))
            for case, arm in found
        ]  # fmt: skip


@dataclass(frozen=True)
class _Box:
    """The errors of a method's runs at its place."""

    place: int
    traces: Sequence[PathTrace]
    colour: str

    def draw(self, axes: Axes) -> None:
        errors = np.concatenate([np.linalg.norm(t.tracked - t.desired, axis=1) for t in self.traces])
        draw_box(axes, self.place, 1000 * errors, self.colour)


def _errors(runs: Vsl2Runs, case: str) -> ComparisonTable:
    def mean(metric: str, method: str) -> str:
        return in_mm(runs.of(case, method).metric(metric))

    note = (
        "Distances of the tip from the desired points along the curve, by the tracker, on the arm that was learned "
        "from: means over the runs, ± the standard deviation between them. Published is the paper's order."
        + (_OWN_LAW if BEAM in runs.learned else "")
        + ("" if NETWORK in runs.learned else " The paper's network is left out: no file of a trained one was given.")
        + runs.unfinished
    )
    rows = [
        {
            "method": method,
            "published": "least" if method == runs.hybrid else _RANKS.get(method, ""),
            "mean": spread_in_mm(runs.error(case, method)),
            "median": mean("median_error", method),
            "25th to 75th percentile": f"{mean('error_p25', method)} to {mean('error_p75', method)}",
            "largest": mean("max_error", method),
        }
        for method in runs.methods
    ]
    return table_of(f"Fig. 7(b), {case}: errors (mm)", rows, note)


def _by_joints(runs: Vsl2Runs) -> ComparisonTable:
    def less(case: str, factor: float) -> dict[str, str]:
        hybrid, rigid = runs.error(case, runs.hybrid), runs.error(case, JOINTS[factor])
        verdict = separation_claim("", "", "", [Comparison("", hybrid, rigid)]).verdict
        texts = (f"hybrid, {case}", f"rigid, {case}", f"hybrid has less error, {case}")
        return dict(zip(texts, (in_mm(hybrid), in_mm(rigid), _WORDS[verdict]), strict=True))

    first, second = CASES
    return table_of(
        "What the claim against the rigid arm hangs on: mean errors (mm)",
        [{"joints stiffer by": f"{factor:g}", **less(first, factor), **less(second, factor)} for factor in runs.joints],
        "The rigid arm's links hardly bend; its tip has errors as joints yield behind the encoder, by an assumed "
        f"stiffness, and as servos droop. Hybrid: {runs.hybrid}. It has less error where each of its runs has.",
    )


def _other_arms(runs: Vsl2Runs) -> ComparisonTable:
    def share(values: Floats) -> str:
        return f"{100 * values.mean():.0f} %" if len(values) else ""

    def row(arm: str, case: str) -> dict[str, str]:
        outside = [runs.of(case, m, arm).metric("outside") for m in runs.learned]
        any_run = any(len(runs.of(case, m, arm)) for m in runs.soft)
        mismatched = {m: runs.of(case, m, arm).metric("model_mismatch") for m in runs.feedback}
        return {
            "arm": arm,
            "load, pressure": case,
            **{m: in_mm(runs.error(case, m, arm)) for m in runs.soft},
            "outside the training": share(np.concatenate(outside)) if any_run else "",
            **{f"mismatch, {m}": share(found) for m, found in mismatched.items()},
        }

    return table_of(
        "The trained arm and others: mean errors (mm)",
        [row(arm, case) for arm in (TRAINED, *runs.arms) for case in CASES] if runs.arms else [],
        "Nothing was learned from the others. Arms of one kind differ in stiffness and mass of each link, friction of "
        f"each gear and stiffness of each joint by {100 * _SCATTER:g} % (standard deviation). Outside the training: "
        "share of the points at which the model reports inputs beyond those it was trained on. Mismatch: share at "
        "which the controller detects by tracker or IMUs that the arm is another."
        f"{_OWN_LAW if BEAM in runs.soft else ''}",
    )


def _estimates(runs: Vsl2Runs) -> ComparisonTable:
    return table_of(
        "Fig. 6: where the tip is taken to be (mm off the true tip)",
        [
            {
                "load, pressure": case,
                "commanded by": method,
                "by rigid kinematics": in_mm(runs.of(case, method).metric("model_error")),
                "by the hybrid forward model": in_mm(runs.of(case, method).metric("estimate_error")),
            }
            for case, method in product(CASES, runs.soft)
        ],
        "Mean distance from the true tip along the curve. While the tip is commanded by rigid kinematics, as in fig. "
        "6, the estimate is that of the polynomials that ship. The paper prints no numbers.",
    )


_TICKS, _TICKS_OF_MEANS = (0.02, 0.1, 0.5, 2.0, 10.0, 50.0), (1.0, 2.0, 5.0, 10.0, 20.0, 50.0)


def _logarithmic(ticks: Sequence[float]) -> dict[str, Any]:
    return {"yscale": "log", "ylim": (ticks[0], 1.4 * ticks[-1])}


def _text(ticks: Sequence[float]) -> dict[float, str]:
    return {tick: f"{tick:g}" for tick in ticks}


def _names(methods: Sequence[str]) -> dict[float, str]:
    return {k: "\n".join(wrap(method, 13)) for k, method in enumerate(methods)}


def _colour(method: str) -> str:
    return _GREEN if method == MODEL_BASED else _RED if "learned" in METHODS[method] else _BLUE


def _plane(case: str) -> dict[str, Any]:
    return {"title": case, "xlabel": "x in W (mm)", "ylabel": "z in W (mm)", **EQUAL}


def _panel_of_estimates(case: str, traces: Sequence[PathTrace]) -> Panel:
    bands = [
        PathBand(Repetitions.of(traces, what), colour, label)
        for what, colour, label in (
            ("servo", _GREEN, "tip by rigid kinematics"),
            ("estimated", _PURPLE, "tip by the hybrid forward model"),
            ("tracked", _BLUE, "tip by the tracker"),
        )
    ]
    return Panel([desired_path(traces[0].desired), *bands], _plane(case))


def _panel_of_command(case: str, plain: PathTrace, hybrid: PathTrace, method: str) -> Panel:
    marks = [
        desired_path(plain.desired),
        path_of(plain.tracked, _GREEN, "tip, by rigid kinematics"),
        path_of(hybrid.tracked, _RED, f"tip, by {method}"),
        path_of(hybrid.commanded, _RED, "compensated command", ls="--"),
    ]
    return Panel(marks, _plane(case))


def _panel_of_joints(runs: Vsl2Runs, case: str) -> Panel:
    points = [(factor, 1000 * runs.error(case, m).mean()) for factor, m in runs.joints.items()]
    marks: list[Drawable] = [Mark.through(points, "o-", _BLUE, RIGID)] if points else []
    marks += [
        level(1000 * runs.error(case, m).mean(), _RED, m, ls=_STROKES[k], lw=1.2) for k, m in enumerate(runs.learned)
    ]
    axes = {"title": case, "xlabel": "joints stiffer by", "ylabel": "mean error of the tip (mm)"}
    return Panel(marks, {**axes, "xscale": "log", "ylim": (0.0, None)}, {f: f"{f:g}" for f in runs.joints})


def _panel_of_arms(runs: Vsl2Runs, case: str) -> Panel:
    marks = [Mark(form="o", label="the arm that was learned from, each run"),
             Mark(form="o", label="another arm, mean of its runs", style={"mfc": "none"})]  # fmt: skip
    for k, m in enumerate(runs.soft):
        trained, others = 1000 * runs.error(case, m), [runs.error(case, m, arm) for arm in runs.arms]
        means = [1000 * errors.mean() for errors in others if len(errors)]
        marks.append(Mark([k - 0.12] * len(trained), trained, "o", _colour(m)))
        marks.append(Mark([k + 0.12] * len(means), means, "o", _colour(m), style={"mfc": "none", "ms": 5}))
    axes = {"title": case, "ylabel": "mean error of the tip (mm)", **_logarithmic(_TICKS_OF_MEANS)}
    return Panel(marks, axes, _names(runs.soft), _text(_TICKS_OF_MEANS))
