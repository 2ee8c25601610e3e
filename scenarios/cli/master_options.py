"""Options of commands that run units: how the master couples them and chooses their steps."""

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import click

from handover.cosim.master.unit_options import ALL
from handover.cosim.stepping.options import AdaptiveStep, Algorithm, Extrapolation, MasterOptions
from handover.scenarios.cli.options import HeadedOption, Seconds, WholeNumber
from handover.scenarios.runs.execution.errors import UsageError

_PLAIN = MasterOptions()
_CONTROL = AdaptiveStep()


class _Above0(click.ParamType):  # type: ignore (generic in newer versions only)
    """A positive finite number; `click.FloatRange` lets infinity and not-a-number through."""

    name = "number"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Return the number."""
        try:
            number = float(value)
        except ValueError:
            number = math.nan
        if not 0 < number < math.inf:
            self.fail(f"{value!r} is not a finite number above 0, such as 1e-4", param, ctx)
        return number


def _choice(values: type[Algorithm] | type[Extrapolation]) -> click.Choice[str]:
    return click.Choice([v.value for v in values])


isolate_option = click.option(
    "--isolate",
    multiple=True,
    metavar="UNIT|foreign|all",
    help="Run a unit, those that were not built by this project, or all in processes of their own. One that"
    " crashes, exits or hangs harms itself alone. Units that do not wait for each other step at the same time."
    " May be given more than once. Units that are named foreign or all themselves are isolated by all only.",
)
"""For commands that take the other options from elsewhere; `isolated` converts it."""

_coupling_option = partial(click.option, cls=HeadedOption, heading="Coupling of units")
_step_option = partial(click.option, cls=HeadedOption, heading="Length of steps")

_OPTIONS = (
    _coupling_option(
        "--algorithm",
        type=_choice(Algorithm),
        default=_PLAIN.algorithm.value,
        help=f"Which values units step from. {' '.join(f'{a.value}: {a.summary}.' for a in Algorithm)}",
    ),
    _coupling_option(
        "--tolerance",
        type=_Above0(),
        default=_PLAIN.tolerance,
        help="What iterated signals may differ by, relative to their magnitude.",
    ),
    _coupling_option(
        "--iterations",
        type=WholeNumber(min=1),
        default=_PLAIN.max_iterations,
        help="After so many iterations of one step, the run fails.",
    ),
    click.option(
        "--unit-tolerance",
        multiple=True,
        metavar="NUMBER|UNIT=NUMBER",
        help="Relative tolerance that a unit, or all others, is given for its own solver, if it has one; may be given"
        " more than once.  [default: what each FMU proposes]",
    ),
    _coupling_option(
        "--extrapolation",
        type=_choice(Extrapolation),
        default=_PLAIN.extrapolation.value,
        help="Inputs during a step: held, or extrapolated linearly from the last two values.",
    ),
    _step_option(
        "--adaptive",
        type=_Above0(),
        metavar="ERROR",
        help="Let the step follow its error, with rollback: what one step may be wrong by, relative to a signal's "
        "magnitude, such as 1e-4. Errors of steps add up over a run. Connected real outputs are controlled (all where "
        "none is). `--extrapolation linear` pays here, with longer steps for the same error.  [default: fixed steps]",
    ),
    _step_option(
        "--adaptive-absolute",
        type=_Above0(),
        metavar="ERROR",
        help="With --adaptive: what a step may be wrong by besides, relative to a signal's nominal value."
        f"  [default: {_CONTROL.absolute:g}]",
    ),
    _step_option(
        "--first-step",
        type=Seconds(),
        metavar="SECONDS",
        help="With --adaptive: the step to try first.  [default: the shortest that units take]",
    ),
    _step_option(
        "--smallest-step",
        type=Seconds(),
        metavar="SECONDS",
        help="With --adaptive: the run fails where a shorter step would be needed."
        f"  [default: {float(_CONTROL.smallest):g}]",
    ),
    _step_option(
        "--largest-step", type=Seconds(), metavar="SECONDS", help="With --adaptive: the longest step.  [default: any]"
    ),
    _step_option(
        "--uncontrolled",
        multiple=True,
        metavar="UNIT.PORT",
        help="With --adaptive: an output whose error is not controlled, such as noise; may be given more than once.",
    ),
    _step_option(
        "--repeat-discarded",
        is_flag=True,
        help="Roll all units back and take a shorter step where one of them discards it, as with --adaptive anyway.",
    ),
)
CONTROL_FIELDS: Mapping[str, str] = {
    "adaptive_absolute": "absolute",
    "first_step": "initial",
    "smallest_step": "smallest",
    "largest_step": "largest",
    "uncontrolled": "uncontrolled",
}


def master_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add the options; `coupling_of` converts them to those of `MasterOptions`."""
    for option in reversed((*_OPTIONS, isolate_option)):
        command = option(command)
    return command


def isolated(isolate: Sequence[str]) -> dict[str, Any]:
    """Return the option `--isolate` as that of `MasterOptions`."""
    return {"isolated": tuple(dict.fromkeys(isolate))}


def _unit_tolerances(texts: Sequence[str]) -> dict[str, float]:
    """Return the option `--unit-tolerance` as that of `MasterOptions`.

    Raises:
        UsageError: a text is of another form, or a unit is given two.
    """
    found: dict[str, float] = {}
    for text in texts:
        unit, equals, number = text.rpartition("=")
        unit = unit.strip() if equals else ALL
        try:
            tolerance = float(number)
        except ValueError:
            tolerance = math.nan
        if not (unit and 0 < tolerance < math.inf):
            raise UsageError(f"--unit-tolerance {text!r}: expected UNIT=NUMBER or NUMBER, above 0, such as 1e-6")
        if unit in found:
            raise UsageError(f"--unit-tolerance: {unit} is given twice")
        found[unit] = tolerance
    return found


def coupling_of(given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the options as those of `MasterOptions`; `given` has their values by name, and no others.

    Raises:
        UsageError: options of step size control are given without --adaptive.
        InvalidOptions: options contradict each other.
    """
    limits = {name: given[name] for name in CONTROL_FIELDS if given[name] not in (None, ())}
    if given["adaptive"] is None and limits:
        text = ", ".join("--" + name.replace("_", "-") for name in limits)
        raise UsageError(f"{text}: with --adaptive only; without it, steps are fixed")
    control = {CONTROL_FIELDS[name]: value for name, value in limits.items()}
    return {
        "algorithm": Algorithm(given["algorithm"]),
        "tolerance": given["tolerance"],
        "max_iterations": given["iterations"],
        "extrapolation": Extrapolation(given["extrapolation"]),
        "adaptive": None if given["adaptive"] is None else AdaptiveStep(relative=given["adaptive"], **control),
        "repeat_discarded": given["repeat_discarded"],
        **isolated(given["isolate"]),
        "unit_tolerances": _unit_tolerances(given["unit_tolerance"]),
    }
