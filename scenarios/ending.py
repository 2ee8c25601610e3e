"""How a command tells the end of a run."""

import sys
from typing import NoReturn

import click

from handover.scenarios.execution.exit_status import TASK_FAILED, UNIT_FAILED
from handover.scenarios.execution.task import Ended, Task
from handover.scenarios.listing import print_summary


def end_with(ended: Ended, task: Task) -> NoReturn:
    """Print how a run ended, and exit with the status that says so."""
    if ended.failure:
        click.echo(str(ended.failure), err=True)
    print_summary(ended, task.experiment.headline, task.folder)
    sys.exit(UNIT_FAILED if ended.failure else 0 if ended.outcome.success else TASK_FAILED)
