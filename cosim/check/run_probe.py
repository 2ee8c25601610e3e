"""The smoke run's process, see `watched_process`."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from handover.cosim.check.journal import Journal
from handover.cosim.check.smoke_run import SmokeRun
from handover.cosim.fmu.description import describe_fmu


def main(task: Mapping[str, Any]) -> None:
    """Run the FMU `task["fmu"]`, unpacked in `task["folder"]`."""
    journal = Journal(Path(task["journal"]))
    run = SmokeRun(
        describe_fmu(Path(task["fmu"])),
        Path(task["folder"]),
        journal,
        start=task["start"],
        step=task["step"],
        keeps_state=task["keeps_state"],
        serialises=task["serialises"],
        allows_two=task["allows_two"],
    )
    run.carry_out()
    journal.begins("unloading the library")
    journal.ends()
