"""Claims of [Gandarias2020] sec. V-C on experiment 2, judged on the runs of `vsl-2`, and what they hang on."""

from dataclasses import replace

from handover.scenarios.published.published_experiment import Claim
from handover.scenarios.published.verdicts import without_verdict
from handover.scenarios.published.vsl.separation import Comparison, separation_claim
from handover.scenarios.published.vsl.vsl_2.runs import (
    CASES,
    CUBIC,
    IMU,
    MODEL_BASED,
    PUBLISHED,
    RIGID,
    TRAINED,
    Arm,
    Case,
    ControlMethod,
    Vsl2Runs,
)

_RIGID_BY_CHOICE = (
    "How far the rigid arm's joints yield is not given in the paper, and was chosen here so that its errors are some "
    "millimetres, as in fig. 5: whether the hybrid has less error depends on that. The claims beyond the paper say at "
    "which stiffness it falls."
)

_NO_NETWORK = "The paper claims this of its network; `--model` takes the file of a trained one."


def claims_of(runs: Vsl2Runs) -> list[Claim]:
    """Return the claims, those beyond the paper last."""
    return [*_estimates(runs), _command(runs), _rigid(runs), *_stiffer(runs), *_other_arms(runs), *_imus(runs)]


def _estimates(runs: Vsl2Runs) -> list[Claim]:
    """Judge the paper's network, if it was trained, and beyond the paper the polynomials that ship."""
    by_polynomials = f"{CUBIC.label} that ship, while the tip goes by rigid kinematics"
    by_network = _estimate(runs, PUBLISHED, f"{PUBLISHED.label}, while the tip goes by its commands")
    if PUBLISHED not in runs.learned:
        by_network = replace(by_network, reason=_NO_NETWORK)
    return [by_network, _estimate(runs, MODEL_BASED, by_polynomials, beyond=True)]


def _estimate(runs: Vsl2Runs, method: ControlMethod, by: str, *, beyond: bool = False) -> Claim:
    comparisons = [
        Comparison(
            case.label, *(runs.metric(f"{what}_error", case, method) for what in ("estimate", "model")), paired=True
        )
        for case in CASES
    ]
    sentence = (
        f"The hybrid forward model, here {by}, predicts the real position of the tip more precisely than rigid "
        "kinematics."
    )
    where, published = ("", "") if beyond else ("sec. V-C, fig. 6", "more precisely")
    return separation_claim(sentence, where, published, comparisons, beyond=beyond)


def _command(runs: Vsl2Runs) -> Claim:
    comparisons = [_compared(runs, case, runs.hybrid, MODEL_BASED) for case in CASES]
    sentence = "With the hybrid inverse model the tip's error is less than with rigid kinematics."
    return _by_network(runs, separation_claim(sentence, "sec. V-C, fig. 7(b)", "lower", comparisons))


def _rigid(runs: Vsl2Runs) -> Claim:
    comparisons = [_compared(runs, case, runs.hybrid, RIGID) for case in CASES]
    sentence = "With the hybrid inverse model the soft arm's tip has less error than that of an arm with rigid links."
    return _by_network(runs, separation_claim(sentence, "sec. V-C, fig. 7(b)", "lower", comparisons), _RIGID_BY_CHOICE)


def _by_network(runs: Vsl2Runs, claim: Claim, why_none: str = "") -> Claim:
    """Say by which corrector a claim of the paper is judged; only its own network gives a verdict, if any does."""
    claim = replace(claim, reason=f"{claim.reason} Measured by {runs.hybrid.label}.")
    if runs.hybrid is not PUBLISHED:
        why_none = f"{why_none} {_NO_NETWORK} Here stands for it what ships.".lstrip()
    return without_verdict(claim, why_none) if why_none else claim


def _stiffer(runs: Vsl2Runs) -> list[Claim]:
    """Judge the claim against rigid arms with stiffer joints: it is told at which it falls."""
    return [
        separation_claim(
            f"By {runs.hybrid.label} the soft arm's tip has less error than that of a rigid arm with joints {factor:g} "
            "times as stiff as assumed.",
            "",
            "",
            [_compared(runs, case, runs.hybrid, rigid) for case in CASES],
            beyond=True,
        )
        for factor, rigid in runs.rigid
        if rigid is not RIGID
    ]


def _other_arms(runs: Vsl2Runs) -> list[Claim]:
    """Judge each method that was taught on arms that it was not taught on."""
    arms = f"each of the {len(runs.arms)} arms" if len(runs.arms) > 1 else "the one arm"
    on = f"On {arms} tried from which nothing was learned the tip's error is less by"
    claims: list[Claim] = []
    pairs = [(case, arm) for case in CASES for arm in runs.arms]
    for method in runs.learned if pairs else ():
        against = {
            "by rigid kinematics": [_compared(runs, case, method, MODEL_BASED, arm, arm) for case, arm in pairs],
            "that of the rigid arm": [_compared(runs, case, method, RIGID, arm) for case, arm in pairs],
        }
        claims += [
            separation_claim(f"{on} {method.label} than {what}.", "", "", comparisons, beyond=True)
            for what, comparisons in against.items()
        ]
    return claims


def _imus(runs: Vsl2Runs) -> list[Claim]:
    """Judge the polynomials with feedback by IMUs against themselves without."""
    pairs = [(case, arm) for case in CASES for arm in (TRAINED, *runs.arms)]
    if IMU not in runs.feedback:
        return []
    comparisons = [_compared(runs, case, IMU, CUBIC, arm, arm) for case, arm in pairs]
    sentence = "On each arm tried the tip's error is less by polynomials with an IMU a link than by polynomials alone."
    return [separation_claim(sentence, "", "", comparisons, beyond=True)]


def _compared(
    runs: Vsl2Runs, case: Case, less: ControlMethod, more: ControlMethod, arm: Arm = TRAINED, other_arm: Arm = TRAINED
) -> Comparison:
    """Return the comparison of a method on an arm with another method, maybe on another arm."""
    label = case.label if arm is TRAINED else f"{case.label}, {arm.label}"
    errors = runs.metric("mean_error", case, less, arm), runs.metric("mean_error", case, more, other_arm)
    return Comparison(label, *errors)
