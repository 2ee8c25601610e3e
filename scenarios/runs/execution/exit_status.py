"""Exit statuses of the command `handover`, which its help explains; loaded before all else of it."""

import sys
from typing import NoReturn

TASK_FAILED, USAGE_ERROR, UNIT_FAILED = 1, 2, 3

INTERRUPTED = 1
"""A campaign was interrupted by Ctrl-C: run the same command again to resume."""

ABORTED = 130
"""Aborted by Ctrl-C: 128 + SIGINT, as shells have it."""


def status_of_run(*, unit_failed: bool, succeeded: bool) -> int:
    """Return the exit status of a run that came to its end, or whose unit failed."""
    return UNIT_FAILED if unit_failed else 0 if succeeded else TASK_FAILED


def abort() -> NoReturn:
    """End the process as Ctrl-C does it before a run has begun: a line, and the status of shells."""
    sys.stderr.write("Aborted!\n")
    sys.exit(ABORTED)
