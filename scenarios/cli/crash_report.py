"""Tells how the process of a run crashed, when what it left is completed."""

import sys

from handover.cosim.exceptions import RecordNotWritten
from handover.cosim.fmu.heartbeat import Heartbeat
from handover.scenarios.cli.listing import print_summary
from handover.scenarios.execution.child_process import ChildEnd
from handover.scenarios.execution.crash import Crash
from handover.scenarios.execution.exit_status import UNIT_FAILED
from handover.scenarios.reporting.run_page import write_run_page
from handover.scenarios.results.run_folder import disk_errors_reported

_BY_SIGNAL = 128  # what shells add to a signal's number


def report_crash(heartbeat: Heartbeat, end: ChildEnd, wall: float) -> int:
    """Complete what a run has left, tell how it crashed, and return the exit status that says so.

    For the arguments see `Death`.
    """
    death = Crash(heartbeat, end, wall)
    sys.stderr.write(f"{death.message}\n")
    if death.folder is None:
        return UNIT_FAILED if death.failure is not None else _BY_SIGNAL + (end.signal or 0)
    try:
        ended = death.complete(death.folder)
        with disk_errors_reported(death.folder.path):
            write_run_page(death.folder)
        print_summary(ended, (), death.folder)
    except RecordNotWritten as e:
        sys.stderr.write(f"{e}\n")
    return UNIT_FAILED
