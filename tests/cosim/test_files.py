import errno
import os
import tempfile
from pathlib import Path

import pytest

from handover.cosim.files import FileTaken, give_name, read_csv, read_regular, scratch_folder


@pytest.mark.skipif(os.name == "nt", reason="needs fork and locks")
def test_what_a_killed_process_left_is_removed_and_what_is_in_use_stays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    (tmp_path / "handover-of-somebody").mkdir()
    with scratch_folder("units") as used:
        child = os.fork()
        if child == 0:
            scratch = scratch_folder("units")
            (scratch.__enter__() / "unit.so").touch()
            os._exit(0)
        os.waitpid(child, 0)
        assert len(list(tmp_path.glob("*/unit.so"))) == 1
        with scratch_folder("check") as later:
            assert {used, later} == {*tmp_path.glob("handover-scratch-*")}
    assert [p.name for p in tmp_path.iterdir()] == ["handover-of-somebody"]


@pytest.mark.skipif(os.name == "nt", reason="needs pipes and devices")
def test_only_regular_files_of_a_sane_size_are_read(tmp_path: Path):
    pipe, device, large, link = (tmp_path / name for name in ("pipe", "device", "large", "link"))
    os.mkfifo(pipe)
    device.symlink_to("/dev/zero")
    large.touch()
    os.truncate(large, 2**40)
    (tmp_path / "text").write_text("text")
    link.symlink_to("text")
    assert read_regular(link) == b"text"
    for path, fault in ((pipe, "pipe"), (device, "device"), (large, "1048576 MiB; at most 64"), (tmp_path, "a folder")):
        with pytest.raises(OSError, match=fault):
            read_regular(path)


def test_a_table_that_would_take_gigabytes_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("handover.cosim.files._MOST_CELLS", 10)
    (tmp_path / "u.csv").write_text("time,u\n0,1\n1,2\n", encoding="utf-8")
    assert len(read_csv(tmp_path / "u.csv")) == 3
    (tmp_path / "u.csv").write_text("time,u\n0,1\n1,2\n2,3\n", encoding="utf-8")
    with pytest.raises(ValueError, match="line 4: over"):
        read_csv(tmp_path / "u.csv")


@pytest.mark.parametrize("links", [True, False])
def test_a_finished_file_takes_a_name_that_no_other_has(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, links: bool):
    def refuse(*_: object) -> None:
        raise PermissionError(errno.EPERM, "no links here")

    if not links:
        monkeypatch.setattr(os, "link", refuse)
    first, second, path = (tmp_path / name for name in ("first", "second", "path"))
    first.write_text("first")
    second.write_text("second")
    give_name(first, path, replace=False)
    with pytest.raises(FileTaken):
        give_name(second, path, replace=False)
    assert {p.name: p.read_text() for p in tmp_path.iterdir()} == {"path": "first", "second": "second"}
    give_name(second, path)
    assert {p.name: p.read_text() for p in tmp_path.iterdir()} == {"path": "second"}
