"""Archives: what is unpacked, what is refused before anything is, icons, and what is written."""

import contextlib
import gc
import io
import os
import sys
import tracemalloc
import warnings
import zipfile
import zlib
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from types import FrameType
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from support.cosim.native_units import native_fmu
from support.wording import Wording

from handover.cosim.exceptions import InvalidFmu
from handover.cosim.fmu.file.archive import FmuArchive, archive_faults, write_archive
from handover.cosim.fmu.file.fmpy_edge import problems_of
from handover.cosim.fmu.file.icon import Icon, read_icon
from handover.cosim.master.master import Master
from handover.cosim.system.system import System

PLAIN = {"modelDescription.xml": b"<fmiModelDescription/>" * 20, "resources/table.csv": b"1,2,3\n" * 100}


def packed(
    *names: str, adjust: Callable[[zipfile.ZipInfo], None] = lambda _: None, twice: tuple[bytes, ...] = ()
) -> bytes:
    """Return an archive with further members, one of them perhaps there with several contents."""
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as archive, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of names that are there twice
        for name in (*PLAIN, *names):
            member = zipfile.ZipInfo(name)
            member.compress_type = zipfile.ZIP_DEFLATED
            if name in names:
                adjust(member)
            archive.writestr(member, PLAIN.get(name, b"x"))
        for data in twice:
            archive.writestr("resources/a", data)
    return content.getvalue()


def test_a_sound_archive_is_unpacked(tmp_path: Path):
    file, target = tmp_path / "a.fmu", tmp_path / "target"
    names = ("binaries/", "binaries/x86_64-linux/größe.so", "./", "other\\", "other\\win64\\x.dll")
    file.write_bytes(packed(*names, twice=(b"same", b"same")))
    archive = FmuArchive(file)
    archive.unpack(target)
    assert (target / "resources" / "table.csv").read_bytes() == PLAIN["resources/table.csv"]
    assert (target / "binaries" / "x86_64-linux" / "größe.so").read_bytes() == b"x"
    assert archive.read("other/win64/x.dll") == (target / "other" / "win64" / "x.dll").read_bytes() == b"x"
    assert archive.with_backslashes == names[-2:]
    assert archive.names.count("resources/a") == 1
    assert (target / "resources" / "a").read_bytes() == b"same"
    assert "./" not in archive.names


@pytest.mark.skipif(os.name == "nt", reason="files have no such permission there")
def test_programs_may_be_executed_after_unpacking(tmp_path: Path):
    files = {"binaries/unit.so": b"x", "resources/program": b"x", "resources/table.csv": b"x"}
    file = write_archive(tmp_path / "a.fmu", files, ["resources/program"])
    FmuArchive(file).unpack(tmp_path / "target")
    executable = [name for name in files if os.access(tmp_path / "target" / name, os.X_OK)]
    assert executable == ["binaries/unit.so", "resources/program"]


def link(member: zipfile.ZipInfo) -> None:
    member.create_system, member.external_attr = 3, 0o120777 << 16


def changed(content: bytes, *changes: tuple[bytes, int, int]) -> bytes:
    """Return an archive in which a byte, some bytes after the last place of a text, is another by these bits."""
    made = bytearray(content)
    for text, after, bits in changes:
        made[made.rindex(text) + after] ^= bits
    return bytes(made)


ABSOLUTE = ("/etc/x", "C:/x", "C:x", "\\\\host\\share\\x")
UPWARDS = ("../x", "a/../../x", "..\\x", "a\\..\\..\\b", "..", ".")
SECRET = changed(packed("secret"), (b"PK\x01\x02", 8, 1), (b"PK\x03\x04", 6, 1))
REFUSED = {
    **{name: packed(name) for name in (*ABSOLUTE, *UPWARDS)},
    "link": packed("binaries/x", adjust=link),
    "twice by backslash": packed("resources\\table.csv"),
    "twice by the folder itself": packed("./resources/table.csv"),
    "twice with another byte": packed(twice=(b"x", b"y")),
    "twice with another length": packed(twice=(b"x", b"xx")),
    "twice with one checksum": packed(twice=(b"plumless", b"buckeroo")),
    "file and folder": packed("a", "a/b/c"),
    "two kinds of faults": packed("../x", "a", "a/b"),
    "encrypted": SECRET,
    "unknown compression": changed(packed("odd"), (b"PK\x01\x02", 10, 99 ^ zipfile.ZIP_DEFLATED)),
    "damaged member": changed(packed("z_last"), (b"z_last\xab", 6, 0xFF)),
    "empty": b"",
    "another format": b"\x7fELF and so on",
    "cut off": packed()[:200],
}


@pytest.mark.parametrize("content", REFUSED.values(), ids=REFUSED)
def test_it_is_refused_before_anything_is_unpacked(tmp_path: Path, content: bytes, wording: Wording):
    assert zlib.crc32(b"plumless") == zlib.crc32(b"buckeroo")  # must not be shown as one and unpacked as the other
    file, target = tmp_path / "a.fmu", tmp_path / "target"
    file.write_bytes(content)
    with pytest.raises(InvalidFmu) as caught:
        FmuArchive(file).unpack(target)
    assert not target.exists()
    wording.check(caught.value)


def declared(size: int, name: str = "a") -> zipfile.ZipInfo:
    member = zipfile.ZipInfo(name)
    member.file_size = size
    return member


@pytest.mark.parametrize("files", [40_000, 70_000])  # of over 65,535 the number is elsewhere in the archive
def test_too_many_files_are_refused_before_their_list_is_read(
    files: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    file = tmp_path / "a.fmu"
    with zipfile.ZipFile(file, "w") as z:
        for number in range(files):
            z.writestr(f"{number}", "")
    monkeypatch.delattr(zipfile, "ZipFile")
    with pytest.raises(InvalidFmu, match=f"holds {files} files"):
        FmuArchive(file)


def test_a_zip_bomb_is_refused_by_what_it_declares(monkeypatch: pytest.MonkeyPatch, wording: Wording):
    wording.check(archive_faults([declared(1 << 30)], 1 << 20)[0])
    wording.check(archive_faults([declared(1 << 40)], 1 << 38)[0])
    monkeypatch.setattr("handover.cosim.fmu.file.archive._MAX_FILES", 1000)
    wording.check(archive_faults([declared(1, str(i)) for i in range(1001)], 1 << 30)[0])
    assert archive_faults([declared(2 << 30)], 200 << 20) == []
    assert archive_faults([declared(200 << 20)], 1 << 18) == []  # a table of zeros


def test_a_bomb_costs_no_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("handover.cosim.fmu.file.archive._SUSPECT_BYTES", 16 << 20)
    file = tmp_path / "bomb.fmu"
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive, archive.open("modelDescription.xml", "w") as bomb:
        for _ in range(20):
            bomb.write(bytes(1 << 20))
    tracemalloc.start()
    try:
        with pytest.raises(InvalidFmu):
            FmuArchive(file)
        assert tracemalloc.get_traced_memory()[1] < 1 << 20
    finally:
        tracemalloc.stop()


def test_what_has_no_description_is_refused_with_what_is_there(tmp_path: Path, wording: Wording):
    contents = (["unit/modelDescription.xml"], ["ModelDescription.xml"], ["readme.txt"], [])
    for path in (*contents, tmp_path, Path(os.devnull)):
        if isinstance(path, list):
            with zipfile.ZipFile(tmp_path / "a.fmu", "w") as archive:
                for name in path:
                    archive.writestr(name, b"")
        with pytest.raises(InvalidFmu) as caught:
            FmuArchive(path if isinstance(path, Path) else tmp_path / "a.fmu").description()
        wording.check(caught.value)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=100)
@given(data=st.data())
def test_whatever_happens_to_an_archive_it_is_unpacked_or_refused(tmp_path: Path, data: st.DataObject):
    content = bytearray(packed("a", "b/c"))
    for _ in range(data.draw(st.integers(1, 6))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    file, target = tmp_path / "a.fmu", tmp_path / "target"
    file.write_bytes(bytes(content[: data.draw(st.integers(0, len(content))) or None]))
    with contextlib.suppress(InvalidFmu):
        archive = FmuArchive(file)
        archive.description()
        archive.unpack(target)


def test_an_fmu_whose_paths_begin_at_the_folder_itself_runs(tmp_path: Path):
    dotted = tmp_path / "dotted.fmu"
    with zipfile.ZipFile(native_fmu("gain", 3)) as plain, zipfile.ZipFile(dotted, "w") as archive:
        for name in plain.namelist():
            archive.writestr(f"./{name}", plain.read(name))
    assert set(FmuArchive(dotted).names) >= {"modelDescription.xml"}
    system = System()
    system.add("gain", dotted)
    with Master(system) as master:
        master.run(Fraction(1))
    assert problems_of(dotted) == ([], "")


BEGIN, END = b"\x89PNG\r\n\x1a\n", b"IEND\xaeB`\x82"
PNG, OTHER = BEGIN + b" and pixels" + END, BEGIN + b" and others" + END
SVG = b'<svg xmlns="http://www.w3.org/2000/svg"/>'
FMI2, FMI3, DRAWING = "model.png", "terminalsAndIcons/icon.png", "terminalsAndIcons/icon.svg"


@pytest.mark.parametrize(
    ("files", "icon", "best"),
    [
        ({}, Icon(), ("", b"")),
        ({FMI2: PNG}, Icon(PNG), ("image/png", PNG)),
        ({FMI2: PNG, FMI3: OTHER}, Icon(OTHER), ("image/png", OTHER)),
        ({FMI3: PNG, DRAWING: SVG}, Icon(PNG, SVG), ("image/svg+xml", SVG)),
        ({FMI3: PNG, DRAWING: b"<svg"}, Icon(PNG), ("image/png", PNG)),
        ({FMI3: PNG, DRAWING: b"<svg/>"}, Icon(PNG), ("image/png", PNG)),
        ({FMI3: b"GIF89a", FMI2: PNG}, Icon(PNG), ("image/png", PNG)),
        ({FMI3: PNG[:-3], FMI2: OTHER}, Icon(OTHER), ("image/png", OTHER)),
        ({FMI3: b"", DRAWING: b""}, Icon(), ("", b"")),
    ],
)
def test_an_icon_is_read(tmp_path: Path, files: dict[str, bytes], icon: Icon, best: tuple[str, bytes]):
    unit = FmuArchive(native_fmu("mass", 2))
    others = {name: unit.read(name) for name in unit.names if not name.endswith("/")}
    found = read_icon(FmuArchive(write_archive(tmp_path / "mass.fmu", {**others, **files})))
    assert found == icon
    assert found.best == best


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


def test_the_bytes_are_those_that_pythons_zipfile_writes_whatever_order_members_come_in(tmp_path: Path):
    expected = io.BytesIO()
    with zipfile.ZipFile(expected, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in sorted(FILES):
            member = zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0))
            member.compress_type, member.create_system = zipfile.ZIP_DEFLATED, 3
            member.external_attr = (0o755 if name.startswith("binaries/") else 0o644) << 16
            archive.writestr(member, FILES[name])
    for files in (FILES, dict(reversed(FILES.items()))):
        assert write_archive(tmp_path / "x.fmu", files).read_bytes() == expected.getvalue()
