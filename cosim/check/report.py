"""The report of one file's check: sections with findings."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from handover.cosim.probe.finding import Finding, Level

RUN = "run"
"""Name of the section in which the unit runs."""

EXPERIMENTS = "experiments"
"""Name of the section in which the experiments that it contains are run again."""


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
                    "summary": s.summary,
                    "findings": [
                        {"level": f.level.name.lower(), "where": f.where, "what": f.what, "cure": f.cure, "log": f.log}
                        for f in s.findings
                    ],
                }
                for s in self.sections
            ],
        }
