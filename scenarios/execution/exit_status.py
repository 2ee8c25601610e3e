"""Exit statuses of the command `handover`, which its help explains."""

TASK_FAILED, USAGE_ERROR, UNIT_FAILED = 1, 2, 3

INTERRUPTED = 1
"""A campaign was interrupted by Ctrl-C: run the same command again to resume."""

ABORTED = 130
"""Aborted by Ctrl-C: 128 + SIGINT, as shells have it."""
