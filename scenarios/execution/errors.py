"""Calls of a command that cannot be carried out.

Workers that cannot carry out a campaign.
"""

from collections.abc import Generator
from contextlib import contextmanager

import click

from handover.cosim.exceptions import CosimError, RecordNotWritten, UnitFailure
from handover.scenarios.execution.exit_status import UNIT_FAILED, USAGE_ERROR


class PoolError(ValueError):
    """A cluster that cannot be reached, is none, has no workers, or has workers that would give other numbers."""


class ClusterLost(RuntimeError):
    """The cluster has gone while runs were under way. What has ended is kept."""


class UsageError(click.ClickException):
    """A call that cannot be carried out, told in one line."""

    exit_code = USAGE_ERROR


class UnitLost(click.ClickException):
    """A unit that failed before anything ran, in another way than by refusing what it was given."""

    exit_code = UNIT_FAILED


class RunNotWritten(click.ClickException):
    """A run whose record or report cannot be written to its end, as on a full disk; what was written is kept."""

    exit_code = UNIT_FAILED


class WorkersLost(click.ClickException):
    """A campaign whose workers have gone; what has ended is kept; run the same command again to resume."""

    exit_code = UNIT_FAILED


@contextmanager
def one_line_errors() -> Generator[None, None, None]:
    """Tell what a user's input, or the lack of a compiler, leads to as UsageError, without a traceback.

    A unit that does not answer at all is told as UnitLost, a full disk as RunNotWritten,
    a cluster that has gone as WorkersLost.
    """
    from handover.fmus.binaries import NotCompiled  # what builds and records is loaded by commands that do it
    from handover.fmus.compile import CompilationError, UnknownPlatform
    from handover.scenarios.experiment.parameters import InvalidParameter
    from handover.scenarios.results.run_folder import InvalidRunFolder

    try:
        yield
    except UnitFailure as e:
        raise UnitLost(str(e)) from e
    except RecordNotWritten as e:
        raise RunNotWritten(str(e)) from e
    except ClusterLost as e:
        raise WorkersLost(str(e)) from e
    except (CosimError, InvalidParameter, InvalidRunFolder, PoolError, NotCompiled, UnknownPlatform) as e:
        raise UsageError(str(e)) from e
    except CompilationError as e:
        raise UsageError(str(e).replace("\n", " ", 1)) from e
