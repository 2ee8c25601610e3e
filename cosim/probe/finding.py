"""Findings: what was found as a unit was looked at or tried, how much it matters, and the remedy."""

import enum
from collections.abc import Sequence
from dataclasses import dataclass


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


def abbreviated(names: Sequence[str], most: int = 5) -> str:
    """Return the first names, and how many more there are."""
    return ", ".join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")
