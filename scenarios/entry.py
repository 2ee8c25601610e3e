"""Where the command `handover` starts: Ctrl-C counts from its first instant."""

import sys

ABORTED = 130


def main() -> None:
    """Run the command; loading it takes a second or so, in which it can be aborted like later."""
    try:
        from scenarios.command import main as command
    except KeyboardInterrupt:
        sys.stderr.write("Aborted!\n")
        sys.exit(ABORTED)
    command()
