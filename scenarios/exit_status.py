"""With which status the command `handover` ends: see its help."""

TASK_FAILED, BAD_CALL, UNIT_FAILED = 1, 2, 3

ABORTED = 130
"""What Ctrl-C aborted, as shells have it."""
