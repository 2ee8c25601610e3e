"""Findings of a check, and the report of one file's check: sections with findings."""

import enum
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any


class Level(enum.IntEnum):
    """How much a finding matters.

    A note is good to know, a warning can spoil a run, a fault is against the standard or stops a run.
    """

    OK = 0
    NOTE = 1
    WARNING = 2
    FAULT = 3


@dataclass(frozen=True, kw_only=True)
class Finding:
    """What was found.

    Attributes:
        level: how much it matters; never OK.
        where: file, line, variable or call that it is about; empty if it is about the FMU as a whole.
        what: what is wrong.
        cure: the remedy, or valid values; empty where `what` implies it.
        log: lines that the unit or the system wrote about it.
    """

    level: Level
    what: str
    where: str = ""
    cure: str = ""
    log: tuple[str, ...] = ()

    @property
    def line(self) -> str:
        """The finding in one line, without its log."""
        return f"{self.where + ': ' if self.where else ''}{self.what}{'; ' + self.cure if self.cure else ''}"


def fault(what: str, *, where: str = "", cure: str = "", log: tuple[str, ...] = ()) -> Finding:
    """Return a finding that is against the standard or stops a run."""
    return Finding(level=Level.FAULT, what=what, where=where, cure=cure, log=log)


def warning(what: str, *, where: str = "", cure: str = "") -> Finding:
    """Return a finding that can spoil a run."""
    return Finding(level=Level.WARNING, what=what, where=where, cure=cure)


def note(what: str, *, where: str = "", cure: str = "") -> Finding:
    """Return a finding that is good to know."""
    return Finding(level=Level.NOTE, what=what, where=where, cure=cure)


RUN = "run"
"""Name of the section in which the unit runs."""


@dataclass(frozen=True)
class Section:
    """One group of checks.

    Attributes:
        name: its name.
        summary: what was checked, in a few words; of a group that was not reached, why.
        findings: what was found.
        reached: whether it was run.
    """

    name: str
    summary: str
    findings: tuple[Finding, ...] = ()
    reached: bool = True

    @property
    def level(self) -> Level:
        """The level of the worst finding."""
        return max((f.level for f in self.findings), default=Level.OK)


@dataclass(frozen=True)
class CheckReport:
    """The sections of one file's check, in the order in which they were run."""

    path: Path
    sections: Sequence[Section]

    @property
    def passed(self) -> bool:
        """Whether there is no fault."""
        return self.count(Level.FAULT) == 0

    @property
    def ran(self) -> bool:
        """Whether the unit ran without a fault."""
        return any(s.name == RUN and s.reached and s.level is not Level.FAULT for s in self.sections)

    def count(self, level: Level) -> int:
        """Return the number of findings of a level."""
        return sum(f.level is level for s in self.sections for f in s.findings)

    def as_json(self) -> dict[str, Any]:
        """Return the report as a JSON object."""
        return {
            "file": str(self.path),
            "passed": self.passed,
            "checks": [
                {
                    "name": s.name,
                    "result": s.level.name.lower() if s.reached else "not reached",
                    "told": s.summary,
                    "findings": [
                        {"level": f.level.name.lower(), "where": f.where, "what": f.what, "cure": f.cure, "log": f.log}
                        for f in s.findings
                    ],
                }
                for s in self.sections
            ],
        }
