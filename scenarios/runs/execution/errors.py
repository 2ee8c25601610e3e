"""Errors that end a command: shown in one line, without a traceback, each with its exit status."""

import errno
from collections.abc import Generator
from contextlib import contextmanager

import click

from handover.cosim.exceptions import CosimError, RecordNotWritten, UnitFailure, WiringError, counted, first_faults
from handover.scenarios.runs.execution.exit_status import UNIT_FAILED, USAGE_ERROR


class PoolError(ValueError):
    """A Dask cluster that cannot be reached, has no workers, or has workers that would compute other numbers.

    Also an address where something else than a Dask scheduler answers.
    """


class ClusterLost(RuntimeError):
    """The cluster was lost while runs were under way. Runs that have ended are kept."""


class UsageError(click.ClickException):
    """Invalid arguments or input files, reported in one line."""

    exit_code = USAGE_ERROR


class UnitLost(click.ClickException):
    """A unit that failed before anything ran, other than by rejecting its parameters."""

    exit_code = UNIT_FAILED


class RunNotWritten(click.ClickException):
    """A run whose record or report cannot be written to its end, as on a full disk; what was written is kept."""

    exit_code = UNIT_FAILED


class FilmFailed(click.ClickException):
    """A film that could not be drawn to its end; nothing of it is kept."""

    exit_code = UNIT_FAILED


class WorkersLost(click.ClickException):
    """A campaign whose workers were lost; runs that have ended are kept; run the same command again to resume."""

    exit_code = UNIT_FAILED


@contextmanager
def one_line_errors() -> Generator[None, None, None]:
    """Report what a user's input, or a missing compiler or package, leads to as UsageError, without a traceback.

    A unit's failure is reported as UnitLost, a full disk as RunNotWritten, a lost cluster as WorkersLost.
    """
    from handover.fmus.binaries import NotCompiled  # loaded here: only commands that build units need it
    from handover.fmus.catalog import PackageFailure
    from handover.fmus.compile import CompilationError, UnknownPlatform
    from handover.scenarios.experiment.parameters import InvalidParameter
    from handover.scenarios.experiment.returned_types import WrongType
    from handover.scenarios.runs.results.run_folder import InvalidRunFolder
    from handover.scenarios.runs.results.tolerated_faults import ScenarioFailed

    try:
        yield
    except UnitFailure as e:
        raise UnitLost(str(e)) from e
    except RecordNotWritten as e:
        raise RunNotWritten(str(e)) from e
    except ClusterLost as e:
        raise WorkersLost(str(e)) from e
    except WiringError as e:
        raise UsageError(f"{counted(len(e.faults), 'fault')} in the system: {'; '.join(first_faults(e.faults))}") from e
    except (CosimError, InvalidParameter, InvalidRunFolder, ScenarioFailed, WrongType) as e:
        raise UsageError(str(e)) from e
    except (PoolError, NotCompiled, UnknownPlatform, PackageFailure) as e:
        raise UsageError(str(e)) from e
    except CompilationError as e:
        raise UsageError(str(e).replace("\n", " ", 1)) from e
    except ImportError as e:
        raise missing_package(e) from e
    except OSError as e:
        if e.errno != errno.ENAMETOOLONG:
            raise
        raise UsageError(f"{e.filename!s:.60}...: the name is longer than this system takes") from e


def require_extra(extra: str, what: str, way_out: str = "") -> None:
    """Refuse what needs an extra of this project that is not installed, before anything starts.

    Args:
        extra: its name, such as `reports`.
        what: what needs it.
        way_out: what else can be done.

    Raises:
        UsageError: modules that it brings are missing; the message names them.
    """
    from handover.fmus.import_failure import install_extra, missing_modules

    if missing := missing_modules(extra):
        instead = f", or {way_out}" if way_out else ""
        raise UsageError(f"{what}: {', '.join(missing)} missing. Cure: {install_extra(extra)}{instead}")


def missing_package(error: ImportError) -> UsageError:
    """Return the report of a package that is missing or cannot be imported, with its cure."""
    from handover.fmus.import_failure import explain_import

    return UsageError(explain_import(error))
