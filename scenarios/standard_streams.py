"""The standard streams, of which a process may be started without any, as by a daemon or by `>&-`."""

import os
import sys


def open_standard_streams() -> None:
    """Let streams that are closed lead nowhere.

    Otherwise the next files that are opened, such as a record, take their numbers, and what a unit prints goes there.
    """
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest free number: this one, as those below are taken
        if getattr(sys, name) is None:
            mode = "w" if number else "r"
            setattr(sys, name, open(number, mode, encoding="utf-8", closefd=False))  # noqa: SIM115
