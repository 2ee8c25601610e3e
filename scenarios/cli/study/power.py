"""The command `handover study power`: what a planned study could find, by simulation, before the first person comes."""

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from rich.table import Table

from handover.scenarios.cli.console import open_console, print_json
from handover.scenarios.cli.options import PATH, SEED, FiniteRange
from handover.scenarios.cli.study.group import checked_plan
from handover.scenarios.runs.execution.errors import UsageError, one_line_errors, require_extra

if TYPE_CHECKING:
    from handover.scenarios.study.statistics.power import Power, Share

_HELP = """Simulate the ratings of the study in PLAN.toml many times, and print how often its tests find an effect.

An effect is in standard deviations of the participants' differences between the two behaviours, each of means of the
rounds of a task. Ratings come in whole steps; the ends of the scale are not simulated. Tests are exact, of signed
ranks, at 5 %, two-sided, with Holm's correction over all statements and tasks.
"""
_COLUMNS = (
    ("single_uncorrected", "one test alone, uncorrected"),
    ("one_effect_holm", "one rating has it, Holm"),
    ("each_of_all_holm", "all have it: each, Holm"),
    ("any_of_all_holm", "all have it: any, Holm"),
    ("familywise_error", "none has it: any, Holm (error)"),
    ("t_test", "t-test alone, uncorrected"),
)


class People(click.ParamType):  # type: ignore (generic in newer versions only)
    """Numbers of participants, such as 10,12,18."""

    name = "people"

    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> tuple[int, ...]:
        """Return the numbers."""
        parts = str(value).split(",")
        if not all(p.strip().isdecimal() and 2 <= int(p) <= _MOST for p in parts):
            self.fail(f"{value!r}: expected whole numbers from 2 to {_MOST}, such as 10,12,18", param, ctx)
        return tuple(int(p) for p in parts)


_MOST = 200


@click.command("power", help=_HELP, short_help="Simulate what a planned study could find.")
@click.argument("file", metavar="PLAN.toml", type=PATH)
@click.option(
    "--effect",
    type=FiniteRange(min=0),
    default=0.8,
    show_default=True,
    metavar="SD",
    help="Mean difference of the behaviours, in standard deviations of the participants' differences.",
)
@click.option("--participants", type=People(), metavar="N,...", help="So many.  [default: the plan's]")
@click.option(
    "--correlation",
    type=FiniteRange(min=0, max=1),
    default=0.6,
    show_default=True,
    help="Of a participant's differences in all statements and tasks. The default is assumed.",
)
@click.option(
    "--spread",
    type=FiniteRange(min=0, min_open=True),
    default=1.5,
    show_default=True,
    metavar="POINTS",
    help="The standard deviation in points of the scale, on which ties depend. The default is assumed.",
)
@click.option("--repeat", type=click.IntRange(100, 100000), default=2000, show_default=True, help="Simulated studies.")
@click.option("--seed", type=SEED, default=0, show_default=True, help="Of their random numbers.")
@click.option("--json", "as_json", is_flag=True, help="Print it as JSON, with intervals of the simulation.")
def power(
    file: Path,
    effect: float,
    participants: tuple[int, ...] | None,
    correlation: float,
    spread: float,
    repeat: int,
    seed: int,
    *,
    as_json: bool,
) -> None:
    """Simulate what a planned study could find."""
    plan = checked_plan(file)
    with one_line_errors():
        require_extra("study", "the simulation of a study")
        from handover.scenarios.study.statistics.power import PowerAssumptions, fewest_participants, simulated_power

        people = participants or (plan.participants,)
        if min(people) < 2:
            raise UsageError(
                f"{file}: of {min(people)} participant nothing can be found; --participants 10,12,18 tries others"
            )
        assumed = PowerAssumptions(effect=effect, spread=spread, correlation=correlation, repeats=repeat, seed=seed)
        found = [simulated_power(plan, n, assumed) for n in people]
    tests = len(plan.statements) * len(plan.tasks)
    least = fewest_participants(tests)
    if as_json:
        print_json({"assumed": vars(assumed), "least_participants": least, "power": [_data(p) for p in found]})
        return
    console = open_console()
    console.print(
        f"Effect {effect:g} SD of the participants' differences, {spread:g} points, correlated by {correlation:g} "
        f"over {tests} ratings; {repeat} simulated studies each"
    )
    table = Table(box=None, padding=(0, 2))
    for heading in ("participants", *(words for _, words in _COLUMNS)):
        table.add_column(heading, justify="right", min_width=9, overflow="fold")
    for p in found:
        table.add_row(str(p.participants), *(_text(getattr(p, name)) for name, _ in _COLUMNS))
    console.print(table)
    console.print("In parentheses: intervals of the simulation at 95 %, Clopper and Pearson.")
    console.print("Differences are not clipped to the scale: where most ratings are near its end, the power is lower.")
    console.print(f"Corrected over {tests}, nothing can be found with fewer than {least} participants.")


def _text(share: "Share") -> str:
    return f"{share.estimate:.0%} ({100 * share.low:.0f}-{100 * share.high:.0f})"


def _data(p: "Power") -> dict[str, Any]:
    return {"participants": p.participants, **{name: _share_data(getattr(p, name)) for name, _ in _COLUMNS}}


def _share_data(share: "Share") -> dict[str, float]:
    return {"estimate": share.estimate, **asdict(share)}
