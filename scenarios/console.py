"""The console that commands print to."""

import os
import sys

from rich.console import Console


def open_console() -> Console:
    """Return standard output's console: in colours and as wide as the terminal, plain and wide when piped."""
    return _Console(highlight=False, width=None if sys.stdout.isatty() else 160)


class _Console(Console):
    def on_broken_pipe(self) -> None:
        """Say no more to a reader who has left; how the run ended is still told by the exit status."""
        self.quiet = True
        with open(os.devnull, "w", encoding="utf-8") as nowhere:
            os.dup2(nowhere.fileno(), sys.stdout.fileno())
