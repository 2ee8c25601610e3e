"""The commands `handover study ...`: a user study, from its plan to its report. Here: the group, `new` and `plan`."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from handover.cosim.exceptions import counted, first_faults
from handover.cosim.files import FileTaken
from handover.scenarios.cli.command import DeferredCommand, DeferringGroup
from handover.scenarios.cli.console import open_console, print_json, print_rows
from handover.scenarios.cli.options import PATH
from handover.scenarios.runs.execution.errors import UsageError, one_line_errors
from handover.scenarios.runs.execution.progress import say
from handover.scenarios.runs.results.run_folder import check_place, make_folder_of, write_whole

if TYPE_CHECKING:
    from handover.scenarios.study.plan.plan import StudyPlan

_HELP = """Carry out a user study with people, or with scripted pilots, after [Fernandes2020] ch. 5.

\b
  handover study new plan.toml           the thesis's plan, to be changed as you like
  handover study plan plan.toml          checks it, and shows who plays what in which order
  handover study serve plan.toml --out DIR
                                         the page that people take part in
  handover study power plan.toml         simulates what so many participants could find
  handover study report DIR              a study's page: failures, ratings, tests, methods
  handover study replay DIR P01 3        what happened in a round, and its page; --check
  handover study export DIR              tables of all participants, for pandas and others
  handover study withdraw DIR P01        leaves out who has withdrawn; --delete deletes
"""

_COMMANDS = (
    DeferredCommand(
        "export",
        "handover.scenarios.cli.study.report:export",
        short_help="Write the tables of all participants.",
    ),
    DeferredCommand(
        "power",
        "handover.scenarios.cli.study.power:power",
        short_help="Simulate what a planned study could find.",
    ),
    DeferredCommand(
        "replay",
        "handover.scenarios.cli.study.report:replay",
        short_help="Show a round: what happened, and its page.",
    ),
    DeferredCommand(
        "report",
        "handover.scenarios.cli.study.report:report",
        short_help="Write the page of a study, and all its tables.",
    ),
    DeferredCommand(
        "serve",
        "handover.scenarios.cli.study.serve:serve",
        short_help="Carry out a study: the page that people take part in.",
    ),
    DeferredCommand(
        "withdraw",
        "handover.scenarios.cli.study.report:withdraw",
        short_help="Leave a participant who has withdrawn out of all results.",
    ),
)


@click.group(
    "study",
    cls=DeferringGroup,
    commands=_COMMANDS,
    help=_HELP,
    short_help="Carry out a user study: its plan, sessions, report.",
)
def study() -> None:
    """Carry out a user study."""


@study.command("new", short_help="Write the plan of the thesis's study, to start from.")
@click.argument("file", metavar="PLAN.toml", type=PATH)
def new(file: Path) -> None:
    """Write the plan of the thesis's study to PLAN.toml, to start from: tasks, behaviours, all that people read.

    A file that is there is not overwritten.
    """
    from handover.scenarios.study.plan.plan import default_plan

    with one_line_errors():
        if file.exists():
            raise UsageError(f"{file} is there already; name a new file")
        check_place(file.parent)
        make_folder_of(file)
        try:
            write_whole(file, default_plan(), replace=False)
        except FileTaken as e:
            raise UsageError(f"{e}; name a new file") from e
    click.echo(file)
    say(f"try: handover study plan {file}")


@study.command("plan", short_help="Check a plan, and show who plays what in which order.")
@click.argument("file", metavar="PLAN.toml", type=PATH)
@click.option("--participants", type=click.IntRange(1, 999), metavar="N", help="So many.  [default: the plan's]")
@click.option("--json", "as_json", is_flag=True, help="Print it as JSON, with the seed of every round.")
def plan(file: Path, participants: int | None, *, as_json: bool) -> None:
    """Check PLAN.toml and print what follows from it: orders, whether they are balanced, devices, how long it takes."""
    from handover.scenarios.study.plan.led_hands import hand_faults

    found = checked_plan(file)
    if faults := hand_faults(found):
        raise _refused(file, faults)
    data = plan_data(found, found.participants if participants is None else participants)
    print_json(data) if as_json else _print_plan(data, found)


def checked_plan(file: Path) -> "StudyPlan":
    """Read a plan.

    Raises:
        UsageError: with all that is wrong with it, a line each.
    """
    from handover.scenarios.study.plan.plan import InvalidPlan, read_plan

    try:
        return read_plan(file)
    except InvalidPlan as e:
        raise _refused(file, e.faults) from e


def _refused(file: Path, faults: Sequence[str]) -> UsageError:
    lines = "".join(f"\n  {fault}" for fault in first_faults(faults))
    return UsageError(f"{file}: {counted(len(faults), 'fault')} in the plan{lines}")


def plan_data(plan: "StudyPlan", participants: int) -> dict[str, Any]:
    """Return what follows from a plan with so many participants, as JSON can hold it; times are in seconds."""
    from handover.scenarios.study.folder.session_folder import pseudonym_of
    from handover.scenarios.study.plan.order import balance, order_row, rounds_of, session_duration

    return {
        "title": plan.title,
        "pilot": plan.pilot,
        "participants": participants,
        "balance": balance(plan, participants),
        "rounds": plan.rounds,
        "longest_session": session_duration(plan),
        "devices": list(plan.devices),
        "languages": list(plan.texts),
        "orders": [
            {
                "participant": pseudonym_of(number),
                "order_row": order_row(plan, number),
                "rounds": [
                    {"round": r.number, "task": r.condition.task, "behaviour": r.condition.behaviour, "seed": r.seed}
                    for r in rounds_of(plan, number)
                ],
            }
            for number in range(1, participants + 1)
        ],
    }


def _print_plan(data: dict[str, Any], plan: "StudyPlan") -> None:
    from handover.scenarios.study.plan.order import session_duration

    console = open_console()
    console.print(data["title"], markup=False)
    if plan.pilot:
        console.print("scripted pilot: no person takes part")
    letters = {(c.task, c.behaviour): chr(ord("A") + k) for k, c in enumerate(plan.conditions)}
    duration = session_duration(plan)
    rated = f"{len(plan.statements)} statements from {plan.scale[0]} to {plan.scale[1]} after each"
    length = (
        f"{duration['together'] / 60:.0f} min at most: practice {duration['practice'] / 60:.2g}, rounds at most "
        f"{duration['rounds'] / 60:.0f}, ratings some {duration['ratings'] / 60:.0f} (assumed)"
    )
    print_rows(
        console,
        [
            ("session", length),
            ("rounds", f"{plan.rounds}, {rated}"),
            ("devices", "; ".join(_device(name) for name in plan.devices)),
            ("languages", ", ".join(f"{name}, {text.language}" for name, text in plan.texts.items())),
        ],
    )
    console.print("\nConditions")
    print_rows(
        console,
        [(letters[c.task, c.behaviour], c.task, c.behaviour, c.scenario, " ".join(c.given)) for c in plan.conditions],
    )
    console.print("\nOrders")
    orders = [
        (of["participant"], " ".join(letters[r["task"], r["behaviour"]] for r in of["rounds"])) for of in data["orders"]
    ]
    print_rows(console, orders)
    console.print(f"\n{data['balance']}", markup=False)


def _device(name: str) -> str:
    from handover.scenarios.study.plan.plan import DEVICES, WEBCAM

    return f"{name}, {DEVICES[name]}" + (" (offered by `study serve --webcam FOLDER`)" if name == WEBCAM else "")
