"""The command `handover compare`: campaigns, or runs, on one page and in one table."""

import contextlib
import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from handover.scenarios.cli.options import PATH, trust_option
from handover.scenarios.runs.execution.errors import UsageError, one_line_errors, require_extra
from handover.scenarios.runs.execution.progress import doing, say
from handover.scenarios.runs.results.run_folder import RunFolder, dated_folder

if TYPE_CHECKING:
    from handover.scenarios.pages.comparison.page import Comparison

_HELP = """Put campaigns, or runs, of one scenario on one page and in one table.

\b
Examples
  handover sweep ir_grasp thing=cylinder,baby_cup_a -p strategy=reflex --repeat 6 --out ours
  handover sweep ir_grasp thing=cylinder,baby_cup_a -p strategy=forward --repeat 6 --out theirs
  handover compare ours theirs
  handover run flyer_impedance -p behaviour=rigid --out a
  handover run flyer_impedance -p behaviour=compliant --out b
  handover compare a b --name rigid --name compliant --signal robot.p_WB

Points of campaigns are matched by the values of the parameters that any of them varies. At each, success rates and
metrics stand beside each other with 95 % intervals. Each two campaigns are tested against each other: run by run where
they share seeds, as campaigns with the same points and --seed do. Five pairs cannot show a difference, however large: p
stays at 0.0625 or above; six can. Of runs, the same curves are drawn over each other.

The folder holds report.html, comparison.csv and comparison.json; figures/ has figures in the width of a column, as
PDF, SVG and PNG.
Settings in which the entries differ are listed, units and versions included.
"""


@click.command("compare", help=_HELP, short_help="Put campaigns, or runs, on one page: rates, metrics, tests, curves.")
@click.argument("folders", metavar="DIR DIR...", nargs=-1, required=True, type=PATH)
@click.option(
    "--name", "names", multiple=True, metavar="NAME", help="Name of each DIR, in their order.  [default: the folder's]"
)
@click.option(
    "--signal",
    "signals",
    multiple=True,
    metavar="UNIT.PORT",
    help="Signal of runs to be drawn; UNIT.PORT[2] is an element.  [default: the scenario's first curves]",
)
@click.option(
    "--metric",
    "metrics",
    multiple=True,
    metavar="METRIC",
    help="Metric of campaigns to be shown by point.  [default: the first four]",
)
@click.option(
    "--out",
    type=PATH,
    help="Folder for the comparison, a new or an empty one.  [default: one of its own in comparisons/]",
)
@trust_option
@click.option("--json", "as_json", is_flag=True, help="Print what comparison.json holds, and where it is, as JSON.")
def compare(
    folders: Sequence[Path],
    names: Sequence[str],
    signals: Sequence[str],
    metrics: Sequence[str],
    out: Path | None,
    as_json: bool,
) -> None:
    """Put campaigns, or runs, on one page."""
    require_extra("reports", "the page")
    from handover.scenarios.pages.comparison.entries import NotComparable  # pages and statistics take long to load
    from handover.scenarios.pages.comparison.page import compare as compared
    from handover.scenarios.pages.comparison.page import write_comparison

    with one_line_errors(), contextlib.ExitStack() as opened:
        folder = None if out is None else RunFolder(out)
        try:
            comparison = compared(folders, names, signals, metrics)
        except NotComparable as e:
            raise UsageError(str(e)) from e
        folder = folder or RunFolder(opened.enter_context(dated_folder(_PLACE, _stem(comparison))))
        with doing("drawing figures, writing the page"):
            data = write_comparison(comparison, folder.claim(opened))
    for line in data.get("left_out", ()):
        say(line)
    if as_json:
        click.echo(json.dumps({"folder": str(folder.shown), **data}, indent=2, allow_nan=False))
        return
    _print(comparison, folder)


_PLACE = Path("comparisons")


def _stem(comparison: "Comparison") -> str:
    """Return the scenario's name, by which the folder is named."""
    scenario = comparison.entries[0].scenario
    return Path(scenario.partition(":")[2] or scenario).stem


def _print(comparison: "Comparison", folder: RunFolder) -> None:
    from handover.scenarios.cli.summaries.comparison import print_comparison

    print_comparison(comparison, folder)
