"""What is kept of a session besides its rounds: the practice, attempts at rounds that do not count, a withdrawal."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

from handover.scenarios.results.run_folder import InvalidRunFolder, read_object, write_whole


@dataclass(frozen=True)
class VoidAttempt:
    """An attempt at a round that does not count, for a reason that is not the participant's; the round is played again.

    Attributes:
        number: of the round, from 1.
        attempt: from 1.
        ended: date and time by ISO 8601.
        reason: why it does not count.
        folder: where its run was put aside, in `rounds/`; "" if there was none.
    """

    number: int
    attempt: int
    ended: str
    reason: str
    folder: str


class SessionNotes:
    """The files practice.json, void_attempts.json and withdrawn.json in a session's folder, each replaced as a whole.

    Args:
        path: the session's folder.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._practice, self._withdrawn = path / "practice.json", path / "withdrawn.json"
        self._attempts = path / "void_attempts.json"

    @property
    def practice(self) -> dict[str, Any] | None:
        """What the practice showed of the device, see `DeviceTest`; None if there was none yet.

        Raises:
            InvalidRunFolder: its file is damaged.
        """
        return read_object(self._practice, "") if self._practice.is_file() else None

    def keep_practice(self, shown: Mapping[str, Any]) -> None:
        """Keep what the practice showed.

        Raises:
            RecordNotWritten: it cannot be written.
        """
        _write(self._practice, shown)

    @property
    def withdrawn(self) -> str | None:
        """When the participant ended the session before its end, by ISO 8601; None if that was not so.

        Raises:
            InvalidRunFolder: its file is damaged.
        """
        return str(read_object(self._withdrawn, "").get("ended", "")) if self._withdrawn.is_file() else None

    def keep_withdrawal(self, when: str) -> None:
        """Note that the participant has ended the session.

        Raises:
            RecordNotWritten: it cannot be written.
        """
        _write(self._withdrawn, {"ended": when})

    @property
    def void_attempts(self) -> list[VoidAttempt]:
        """Attempts at rounds that do not count, in the order of time.

        Raises:
            InvalidRunFolder: their file is damaged.
        """
        if not self._attempts.is_file():
            return []
        kept = read_object(self._attempts, "")
        try:
            return [VoidAttempt(**{f.name: of[f.name] for f in fields(VoidAttempt)}) for of in kept["attempts"]]
        except (KeyError, TypeError) as e:
            raise InvalidRunFolder(self._path, f"its {self._attempts.name} is damaged: {e}") from e

    def attempts_at(self, number: int) -> int:
        """Return how many attempts at a round do not count."""
        return sum(a.number == number for a in self.void_attempts)

    def keep_void_attempt(self, attempt: VoidAttempt) -> None:
        """Keep an attempt that does not count.

        Raises:
            RecordNotWritten: it cannot be written.
        """
        _write(self._attempts, {"attempts": [asdict(a) for a in [*self.void_attempts, attempt]]})


def _write(file: Path, content: Mapping[str, Any]) -> None:
    write_whole(file, json.dumps(content, indent=2, allow_nan=False) + "\n")
