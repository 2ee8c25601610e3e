"""The command `handover`: its subcommands by name, each loaded when it is called or its help is asked for."""

import logging
from importlib import import_module
from typing import Any

import click

from handover.scenarios.runs.execution.exit_status import abort

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
  handover run x.fmu --input u.csv --stop 5
                                         one unit from any tool, with inputs from a table
  handover play flyer_impedance          the same in a browser, with sliders for its parameters
  handover resume runs/long              resumes a run with checkpoints
  handover sweep ir_grasp strategy=reflex,blind --repeat 20
                                         a campaign: many runs, one table
  handover compare ours theirs           campaigns, or runs, on one page: rates, tests, curves
  handover paper ir-table                a paper's experiment: ours beside the published
  handover report runs/long              writes its page again, also of a killed run
  handover film runs/long --out x.mp4    its scene beside plots, as a film
  handover vsl-train --out model.json    kinematics learned on the VSL arm
  handover flyer-track runs/x            the hand's track, for -p hand_track=FILE

\b
Study with people
  handover study new plan.toml           its plan; see `handover study --help`

\b
Your own
  handover new scenario Reach            writes a start: scenario, plant, controller, tests
  handover run reach:Reach               one of your own, MODULE:CLASS, from the working directory

\b
Exchange
  handover build TendonArm --fmi both    units for other tools
  handover export ir_grasp --ssp grasp.ssp
                                         a scenario for other tools
  handover info Their.fmu                what is in it: ports, steps, capabilities
  handover check Their.fmu               what is wrong with an FMU, whoever made it

\b
Exit status
  0    the task succeeded; of a campaign: all runs ended
  1    the run ended, but the task failed; of a campaign: interrupted, run the same command again to resume
  2    usage error or invalid input; nothing was written
  3    a unit failed, a run was killed or lost, or the disk is full; what was recorded until then is kept
  130  aborted with Ctrl-C: before the run, or by a second one during it

\b
Environment
  HANDOVER_CACHE    folder of built units [default: the user's cache folder]
  HANDOVER_COMPILE  0: the Helix's units as plain Python, though Numba is there
  For variables that units read, here as in other tools, see `handover build --help`
"""


class DeferredCommand(click.Command):
    """A placeholder for a command in the group's help; the command is loaded when it is called.

    Args:
        name: of the command.
        path: where it is, `module:attribute`.
        help: the first sentence of its help, which click shortens for the group's help.
        short_help: its short help, where it has one.
    """

    def __init__(self, name: str, path: str, *, help: str | None = None, short_help: str | None = None) -> None:  # noqa: A002
        super().__init__(name, help=help, short_help=short_help)
        self.path = path

    def load(self) -> click.Command:
        """Return the command itself."""
        module, _, attribute = self.path.partition(":")
        return getattr(import_module(module), attribute)


class _VisibleLog(logging.Formatter):
    """Warnings as they may be shown in a terminal: they may quote files of others."""

    def format(self, record: logging.LogRecord) -> str:
        from handover.cosim.exceptions import visible  # loaded for this alone

        return visible(super().format(record))


class DeferringGroup(click.Group):
    """A group that loads the command that is called, and no other.

    Physics, tables and pages take seconds to load, which `handover --help` should not take.
    """

    def invoke(self, ctx: click.Context) -> Any:
        """Call the command, which Ctrl-C aborts; a missing package is named in a line, and errors are made visible."""
        if logging.lastResort is not None:
            logging.lastResort.setFormatter(_VisibleLog())
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt:  # click would end with the status of a task that failed
            abort()
        except click.ClickException as e:  # such messages may quote files of others
            from handover.cosim.exceptions import visible  # loaded for this alone

            vars(e)["message"] = visible(e.message)
            raise
        except ImportError as e:
            from handover.scenarios.runs.execution.errors import missing_package  # loaded for this alone

            raise missing_package(e) from e

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Return the command that the arguments name, loaded, and the arguments after its name."""
        name, command, rest = super().resolve_command(ctx, args)
        return name, command.load() if isinstance(command, DeferredCommand) else command, rest


COMMANDS = (
    DeferredCommand(
        "build",
        "handover.scenarios.cli.units.build:build_command",
        help="Build UNITs (all by default) as FMUs for other tools.",
    ),
    DeferredCommand(
        "check",
        "handover.scenarios.cli.units.check:check",
        short_help="Find what is wrong with FMUs and SSPs, whoever made them.",
    ),
    DeferredCommand(
        "compare",
        "handover.scenarios.cli.compare:compare",
        short_help="Put campaigns, or runs, on one page: rates, metrics, tests, curves.",
    ),
    DeferredCommand(
        "export",
        "handover.scenarios.cli.export:export_command",
        short_help="Write a SCENARIO as an SSP, for other tools.",
    ),
    DeferredCommand(
        "film", "handover.scenarios.cli.film:film", short_help="Make a film of a run: its scene beside plots."
    ),
    DeferredCommand(
        "flyer-track",
        "handover.scenarios.cli.robots.flyer_track:flyer_track",
        help="Write the track of the hand in a handover of the free-flyer, of the run in DIR.",
    ),
    DeferredCommand(
        "info", "handover.scenarios.cli.units.info:info", short_help="Show what is in an FMU or an SSP, from any tool."
    ),
    DeferredCommand(
        "list",
        "handover.scenarios.cli.list:list_command",
        short_help="List scenarios and units, or what one of them takes and gives.",
    ),
    DeferredCommand(
        "new",
        "handover.scenarios.cli.units.new:new",
        short_help="Write a start for a unit, a controller or a scenario of your own.",
    ),
    DeferredCommand(
        "paper",
        "handover.scenarios.cli.paper:paper",
        help="Run a paper's EXPERIMENT, and compare its results with the published ones.",
    ),
    DeferredCommand(
        "play",
        "handover.scenarios.cli.play:play",
        short_help="Play with a SCENARIO's parameters in a browser.",
    ),
    DeferredCommand(
        "report", "handover.scenarios.cli.report:report", short_help="Write the page of a run or of a campaign."
    ),
    DeferredCommand(
        "resume", "handover.scenarios.cli.resume:resume", short_help="Resume a run from its last checkpoint."
    ),
    DeferredCommand(
        "run",
        "handover.scenarios.cli.run:run",
        help="Run a SCENARIO once and write summary, signals, figures and a report into a folder.",
    ),
    DeferredCommand(
        "study",
        "handover.scenarios.cli.study.group:study",
        short_help="Carry out a user study: its plan, sessions, report.",
    ),
    DeferredCommand(
        "sweep",
        "handover.scenarios.cli.sweep:sweep",
        help="Run a SCENARIO, SSP or FMU many times: all combinations of the given values, each --repeat times.",
    ),
    DeferredCommand(
        "vsl-train",
        "handover.scenarios.cli.robots.vsl_train:vsl_train",
        help="Train the kinematics of the arm with variable-stiffness links on the arm's own FMU.",
    ),
)


@click.group(
    cls=DeferringGroup,
    commands=COMMANDS,
    help=_HELP,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)
@click.version_option(package_name="handover-cosim")
def main() -> None:
    """Robots that hand objects over, co-simulated as Functional Mock-up Units."""
