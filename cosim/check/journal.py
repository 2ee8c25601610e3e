"""What a process that is watched tells of itself: a line of JSON for each call that begins and each finding."""

import json
from pathlib import Path
from typing import Any

from handover.cosim.check.finding import Finding

_MOST_OF_A_MESSAGE = 2000


class Journal:
    """Writes lines that are on disk before what they announce begins: a crash loses none."""

    def __init__(self, file: Path) -> None:
        self._room = 1_000_000  # characters
        self._file = file.open("a", encoding="utf-8")

    def begins(self, call: str, t: float | None = None) -> None:
        """Note that a call begins, at a simulated time or before there is one."""
        self._write({"call": call, "t": t})

    def found(self, finding: Finding) -> None:
        """Note a finding."""
        self._write({"level": finding.level, "what": finding.what, "where": finding.where, "cure": finding.cure,
                     "log": finding.log})  # fmt: skip

    def logs(self, message: str) -> None:
        """Note what the unit logged; of a unit that logs without end, the beginning."""
        if self._room > 0:
            self._room -= len(message)
            self._write({"log of the unit": message[:_MOST_OF_A_MESSAGE]})

    def tells(self, **facts: Any) -> None:
        """Note facts by name."""
        self._write({"facts": facts})

    def ends(self) -> None:
        """Note that all was carried out."""
        self._write({"end": True})

    def _write(self, line: dict[str, Any]) -> None:
        self._file.write(json.dumps(line) + "\n")
        self._file.flush()
