"""The writer of zip files, interrupted at each of its lines."""

import contextlib
import gc
import io
import os
import sys
import zipfile
from pathlib import Path
from types import FrameType
from typing import Any

import pytest

from handover.cosim.fmu.file.archive import write_archive

FILES = {"a.txt": b"a" * 100, "binaries/b": b"b" * 100, "empty": b"", "größe.txt": bytes(range(256)) * 300}
PLACES = ("archive.py", "zipfile.py", "zipfile/__init__.py")


class Interrupt:
    """Raises KeyboardInterrupt at one of the lines that the writer passes, as a signal's handler does."""

    def __init__(self, at: int) -> None:
        self._left = at

    def __call__(self, frame: FrameType, event: str, _argument: Any) -> "Interrupt | None":
        if not frame.f_code.co_filename.endswith(PLACES):
            return None
        self._left -= event == "line"
        if not self._left:
            self._left = -1
            raise KeyboardInterrupt
        return self

    def write(self, path: Path) -> bool:
        """Write an archive; return whether that was interrupted."""
        before = sys.gettrace()
        sys.settrace(self)
        with contextlib.suppress(KeyboardInterrupt):
            write_archive(path, FILES)
        sys.settrace(before)
        return self._left < 0


def test_the_content_is_on_the_disk_before_it_has_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    path, written = tmp_path / "x.fmu", list[int]()

    def sync(descriptor: int) -> None:
        assert not path.exists()
        written.append(os.fstat(descriptor).st_size)

    monkeypatch.setattr(os, "fsync", sync)
    write_archive(path, FILES)
    assert written == [path.stat().st_size]


@pytest.mark.machine
def test_an_interrupt_leaves_nothing_and_says_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    said: list[Any] = []
    monkeypatch.setattr(sys, "unraisablehook", said.append)
    path, at = tmp_path / "x.fmu", 1
    while Interrupt(at).write(path):
        left = list(tmp_path.iterdir())
        assert left in ([], [path]), at
        for file in left:  # interrupted after all was done
            with zipfile.ZipFile(file) as archive:
                assert archive.testzip() is None
            file.unlink()
        at += 1
    gc.collect()
    assert [value for value in said if value.exc_type is not KeyboardInterrupt] == []  # which may strike in a finalizer
    assert at > 50
    assert path.stat().st_mode & 0o777 == 0o644


def test_the_bytes_are_those_that_pythons_zipfile_writes(tmp_path: Path):
    expected = io.BytesIO()
    with zipfile.ZipFile(expected, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in sorted(FILES):
            member = zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0))
            member.compress_type, member.create_system = zipfile.ZIP_DEFLATED, 3
            member.external_attr = (0o755 if name.startswith("binaries/") else 0o644) << 16
            archive.writestr(member, FILES[name])
    assert write_archive(tmp_path / "x.fmu", FILES).read_bytes() == expected.getvalue()


def test_a_file_is_the_same_whatever_order_its_members_come_in(tmp_path: Path):
    one = write_archive(tmp_path / "one.fmu", FILES).read_bytes()
    other = write_archive(tmp_path / "other.fmu", dict(reversed(FILES.items()))).read_bytes()
    assert one == other
