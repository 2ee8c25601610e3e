"""With which status the command `handover` ends: see its help."""

TASK_FAILED, USAGE_ERROR, UNIT_FAILED = 1, 2, 3

INTERRUPTED = 1
"""A campaign was ended by Ctrl-C: run the same command again to resume."""

ABORTED = 130
"""What Ctrl-C aborted, as shells have it."""
