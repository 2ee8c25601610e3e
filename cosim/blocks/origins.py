"""Where the default of a parameter comes from: its status, and its place in the source."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Origin:
    """Where a value comes from.

    Attributes:
        status: "stated", "derived", "read off figure" or "assumed".
        where: the place in the source; of an assumed value, what it rests on.
    """

    status: str
    where: str

    def __str__(self) -> str:
        """Return both, as in "stated: table 1"."""
        return f"{self.status}: {self.where}"


def stated(where: str) -> Origin:
    """Return the origin of a value that a source states."""
    return Origin("stated", where)


def derived(where: str) -> Origin:
    """Return the origin of a value that follows from what a source states."""
    return Origin("derived", where)


def read_off(where: str) -> Origin:
    """Return the origin of a value that is read off a figure."""
    return Origin("read off figure", where)


def assumed(where: str) -> Origin:
    """Return the origin of a value that no source gives."""
    return Origin("assumed", where)


NOT_GIVEN = assumed("not given")
"""Origin of a value that its source leaves out."""
