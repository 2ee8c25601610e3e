"""What is kept of a session besides its rounds: the practice, attempts at rounds that do not count, a withdrawal."""

import json
import shutil
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

from handover.cosim.typed_data import Count
from handover.scenarios.runs.results.run_folder import disk_errors_reported, read_file, read_object, write_whole


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

    number: Count
    attempt: Count
    ended: str
    reason: str
    folder: str


@dataclass(frozen=True)
class _KeptAttempts:
    """What their file holds."""

    attempts: list[VoidAttempt]


@dataclass(frozen=True)
class Withdrawal:
    """A participant's withdrawal: what was kept of them is in no result.

    Attributes:
        ended: date and time by ISO 8601.
        during: whether the session was under way, and not over.
        deleted: when what was kept was deleted, likewise; "" if it was not.
    """

    ended: str
    during: bool = True
    deleted: str = ""


def timestamp() -> str:
    """Return the present date and time by ISO 8601."""
    return datetime.now(timezone.utc).astimezone().isoformat(timespec="seconds")


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
        return read_object(self._practice, "it has no practice.json") if self._practice.exists() else None

    def keep_practice(self, shown: Mapping[str, Any]) -> None:
        """Keep what the practice showed.

        Raises:
            RecordNotWritten: it cannot be written.
        """
        _write(self._practice, shown)

    @property
    def withdrawn(self) -> Withdrawal | None:
        """The participant's withdrawal; None if there was none.

        Raises:
            InvalidRunFolder: its file is damaged.
        """
        return read_file(self._withdrawn, "it has no withdrawn.json", Withdrawal) if self._withdrawn.exists() else None

    def keep_withdrawal(self, withdrawal: Withdrawal) -> None:
        """Note that the participant has withdrawn.

        Raises:
            RecordNotWritten: it cannot be written.
        """
        _write(self._withdrawn, asdict(withdrawal))

    def delete_all_else(self) -> None:
        """Delete all of the session but the note of its withdrawal.

        Raises:
            RecordNotWritten: something cannot be deleted.
        """
        with disk_errors_reported(self._path):
            for entry in self._path.iterdir():
                if entry.is_dir() and not entry.is_symlink():
                    shutil.rmtree(entry)
                elif entry != self._withdrawn:
                    entry.unlink()

    @property
    def void_attempts(self) -> list[VoidAttempt]:
        """Attempts at rounds that do not count, in the order of time.

        Raises:
            InvalidRunFolder: their file is damaged.
        """
        if not self._attempts.exists():
            return []
        return read_file(self._attempts, "it has no void_attempts.json", _KeptAttempts).attempts

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
