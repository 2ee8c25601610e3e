"""The last calls of a process, in a file that outlives it."""

import mmap
import struct
from pathlib import Path

SLOTS = 24
SLOT = 240
HEAD = struct.Struct("=Q")


class CallRing:
    """A ring of lines in a mapped file: what was noted before a crash is there after it.

    Args:
        file: made, or emptied.
    """

    def __init__(self, file: Path) -> None:
        file.write_bytes(bytes(HEAD.size + SLOTS * SLOT))
        with file.open("r+b") as opened:
            self._memory = mmap.mmap(opened.fileno(), 0)
        self._count = 0

    def note(self, line: str) -> None:
        """Write a line, cut to what a slot holds."""
        at = HEAD.size + self._count % SLOTS * SLOT
        self._memory[at : at + SLOT] = line.encode("utf-8", "replace")[:SLOT].ljust(SLOT, b"\0")
        self._count += 1
        HEAD.pack_into(self._memory, 0, self._count)

    def lines(self) -> list[str]:
        """Return the last lines, the latest at the end."""
        return _lines(self._memory[:])


def count_of(file: Path) -> int:
    """Return how many lines another process has written so far."""
    with file.open("rb") as opened:
        return HEAD.unpack(opened.read(HEAD.size))[0]


def lines_of(file: Path) -> list[str]:
    """Return the last lines that another process wrote."""
    return _lines(file.read_bytes())


def _lines(content: bytes) -> list[str]:
    (count,) = HEAD.unpack_from(content)
    places = [HEAD.size + i % SLOTS * SLOT for i in range(max(0, count - SLOTS), count)]
    return [content[at : at + SLOT].rstrip(b"\0").decode("utf-8", "replace") for at in places]
