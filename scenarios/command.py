"""The command `handover`."""

import click

from handover.cosim.exceptions import nearest
from handover.fmus.catalog import UNITS
from handover.scenarios.bad_call import BadCall
from handover.scenarios.build_command import build_command
from handover.scenarios.catalog import SCENARIOS
from handover.scenarios.check_command import check
from handover.scenarios.export_command import export_command
from handover.scenarios.listing import print_catalog, print_scenario, print_unit
from handover.scenarios.paper_command import paper
from handover.scenarios.report_command import report
from handover.scenarios.resume_command import resume
from handover.scenarios.run_command import run
from handover.scenarios.sweep_command import sweep
from handover.scenarios.vsl_train_command import vsl_train

_HELP = """Robots that hand objects over, co-simulated as Functional Mock-up Units.

\b
Look
  handover list                          scenarios and units
  handover list helix_handover           a scenario's parameters, with ranges
  handover list VslArm                   a unit's parameters, inputs and outputs

\b
Run
  handover run helix_handover            one run; leaves a folder with a report
  handover run x.ssp --stop 5            a system from another tool, for 5 s
  handover resume runs/long              goes on with a run with checkpoints
  handover sweep ir_grasp strategy=reflex,blind --repeat 20
                                         a campaign: many runs, one table
  handover paper ir-table                a paper's experiment: ours beside the published
  handover report runs/long              its page anew, also of a killed run
  handover vsl-train --out model.json    kinematics learned on the VSL arm

\b
Exchange
  handover build TendonArm --fmi both    units for other tools
  handover export ir_grasp --ssp x.ssp   a scenario for other tools
  handover check Their.fmu               what is wrong with an FMU, whoever made it

\b
Exit status
  0    the task succeeded; of a campaign: all runs ended
  1    the run ended, but the task failed; of a campaign: interrupted, the same call goes on
  2    bad call or bad input; nothing was written
  3    a unit failed, a run was killed or lost, or the disk is full; what was recorded until then is kept
  130  aborted with Ctrl-C: before the run, or by a second one during it

\b
Environment
  HANDOVER_CACHE  folder of built units [default: the user's cache folder]
  Those that units read, here as in other tools: see `handover build --help`
"""


@click.group(help=_HELP, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.version_option(package_name="handover-cosim")
def main() -> None:
    """Robots that hand objects over, co-simulated as Functional Mock-up Units."""


@main.command("list", short_help="List scenarios and units, or what one of them takes and gives.")
@click.argument("name", required=False, metavar="[SCENARIO|UNIT]")
def list_(name: str | None) -> None:
    """List scenarios and units, the parameters of a SCENARIO, or parameters and ports of a UNIT."""
    if name is None:
        print_catalog()
    elif name in UNITS:
        print_unit(UNITS[name])
    elif name in SCENARIOS:
        print_scenario(SCENARIOS[name])
    else:
        raise BadCall(f"no scenario or unit {name!r}: {nearest(name, [*SCENARIOS, *UNITS])}")


main.add_command(build_command)
main.add_command(check)
main.add_command(export_command)
main.add_command(paper)
main.add_command(report)
main.add_command(resume)
main.add_command(run)
main.add_command(sweep)
main.add_command(vsl_train)
