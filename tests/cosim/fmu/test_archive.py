import contextlib
import gc
import io
import os
import struct
import sys
import tracemalloc
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

from handover.cosim.exceptions import InvalidFmu
from handover.cosim.fmu.file.archive import FmuArchive, archive_faults, write_archive
from handover.cosim.fmu.file.fmpy_edge import problems_of
from handover.cosim.fmu.file.icon import Icon, read_icon
from handover.cosim.master.master import Master
from handover.cosim.system.system import System

PLAIN = {"modelDescription.xml": b"<fmiModelDescription/>" * 20, "resources/table.csv": b"1,2,3\n" * 100}


def packed(*names: str, adjust: Callable[[zipfile.ZipInfo], None] = lambda _: None) -> bytes:
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in (*PLAIN, *names):
            member = zipfile.ZipInfo(name)
            member.compress_type = zipfile.ZIP_DEFLATED
            if name in names:
                adjust(member)
            archive.writestr(member, PLAIN.get(name, b"x"))
    return content.getvalue()


def refusal(folder: Path, content: bytes) -> str:
    """Return why an archive is rejected; nothing may have been unpacked."""
    file, target = folder / "a.fmu", folder / "target"
    file.write_bytes(content)
    with pytest.raises(InvalidFmu) as caught:
        FmuArchive(file).unpack(target)
    assert not target.exists()
    return caught.value.fault


def test_a_sound_archive_is_unpacked(tmp_path: Path):
    file = tmp_path / "a.fmu"
    file.write_bytes(packed("binaries/", "binaries/x86_64-linux/größe.so"))
    FmuArchive(file).unpack(tmp_path / "target")
    assert (tmp_path / "target" / "resources" / "table.csv").read_bytes() == PLAIN["resources/table.csv"]
    assert (tmp_path / "target" / "binaries" / "x86_64-linux" / "größe.so").read_bytes() == b"x"


@pytest.mark.skipif(os.name == "nt", reason="files have no such permission there")
def test_programs_may_be_executed_after_unpacking(tmp_path: Path):
    files = {"binaries/unit.so": b"x", "resources/program": b"x", "resources/table.csv": b"x"}
    file = write_archive(tmp_path / "a.fmu", files, ["resources/program"])
    FmuArchive(file).unpack(tmp_path / "target")
    executable = [name for name in files if os.access(tmp_path / "target" / name, os.X_OK)]
    assert executable == ["binaries/unit.so", "resources/program"]


@pytest.mark.parametrize(
    "name", ["../x", "a/../../x", "/etc/x", "C:/x", "C:x", "..\\x", "a\\..\\..\\b", "..", "\\\\host\\share\\x", "."]
)
def test_a_path_that_leads_out_is_refused(tmp_path: Path, name: str):
    value = refusal(tmp_path, packed(name))
    assert "paths that lead out of it" in value
    assert name in value


def test_backslashes_in_names_are_read_as_slashes(tmp_path: Path):
    file = tmp_path / "a.fmu"
    file.write_bytes(packed("binaries\\", "binaries\\win64\\x.dll"))
    archive = FmuArchive(file)
    archive.unpack(tmp_path / "target")
    assert archive.read("binaries/win64/x.dll") == (tmp_path / "target" / "binaries" / "win64" / "x.dll").read_bytes()
    assert archive.with_backslashes == ("binaries\\", "binaries\\win64\\x.dll")
    (tmp_path / "other").mkdir()
    assert "the same path twice" in refusal(tmp_path / "other", packed("resources\\table.csv"))


def test_links_are_refused(tmp_path: Path):
    def link(member: zipfile.ZipInfo) -> None:
        member.create_system, member.external_attr = 3, 0o120777 << 16

    assert "symbolic links" in refusal(tmp_path, packed("binaries/x", adjust=link))


@pytest.mark.filterwarnings("ignore:Duplicate name")
@pytest.mark.parametrize(("first", "second"), [(b"x", b"y"), (b"x", b"xx"), (b"x" * 10, b"y" * 10)])
def test_one_path_twice_with_different_contents_is_refused(tmp_path: Path, first: bytes, second: bytes):
    assert "the same path twice, with different contents: resources/a" in refusal(tmp_path, doubled(first, second))


@pytest.mark.filterwarnings("ignore:Duplicate name")
def test_contents_of_one_length_and_checksum_are_compared_byte_by_byte(tmp_path: Path):
    """Whoever makes two such contents must not be able to show one and unpack the other."""
    assert zlib.crc32(b"plumless") == zlib.crc32(b"buckeroo")
    content = doubled(b"plumless", b"buckeroo")
    assert "the same path twice, with different contents: resources/a" in refusal(tmp_path, content)


@pytest.mark.filterwarnings("ignore:Duplicate name")
def test_one_path_twice_with_the_same_content_is_unpacked_once(tmp_path: Path):
    file = tmp_path / "a.fmu"
    file.write_bytes(doubled(b"same", b"same"))
    archive = FmuArchive(file)
    archive.unpack(tmp_path / "target")
    assert archive.names.count("resources/a") == 1
    assert (tmp_path / "target" / "resources" / "a").read_bytes() == b"same"


def doubled(*contents: bytes) -> bytes:
    made = io.BytesIO(packed())
    with zipfile.ZipFile(made, "a", zipfile.ZIP_DEFLATED) as archive:
        for content in contents:
            archive.writestr("resources/a", content)
    return made.getvalue()


def test_an_entry_of_the_folder_itself_is_harmless(tmp_path: Path):
    file = tmp_path / "a.fmu"
    file.write_bytes(packed("./"))
    archive = FmuArchive(file)
    archive.unpack(tmp_path / "target")
    assert "./" not in archive.names
    assert (tmp_path / "target" / "resources" / "table.csv").is_file()


def test_a_file_that_is_also_a_folder_is_refused(tmp_path: Path):
    assert "files that are folders of other files: a" in refusal(tmp_path, packed("a", "a/b/c"))


def test_all_kinds_of_faults_are_reported_together(tmp_path: Path):
    value = refusal(tmp_path, packed("../x", "a", "a/b"))
    assert "paths that lead out" in value
    assert "folders of other files" in value


def test_encrypted_members_are_refused(tmp_path: Path):
    content = bytearray(packed("secret"))
    for signature, at in ((b"PK\x01\x02", 8), (b"PK\x03\x04", 6)):
        begin = content.rindex(signature)
        content[begin + at] |= 1
    assert "encrypted files; store them without a password: secret" in refusal(tmp_path, bytes(content))


def test_a_compression_that_nobody_knows_is_refused(tmp_path: Path):
    content = bytearray(packed("odd"))
    struct.pack_into("<H", content, content.rindex(b"PK\x01\x02") + 10, 99)
    assert "compression that cannot be read; use deflate: odd" in refusal(tmp_path, bytes(content))


def test_a_damaged_member_is_refused_before_anything_is_unpacked(tmp_path: Path):
    content = bytearray(packed("z_last"))
    content[content.index(b"z_last") + len("z_last")] ^= 0xFF
    assert "the archive is damaged" in refusal(tmp_path, bytes(content))


@pytest.mark.parametrize(
    ("content", "value"),
    [
        (b"", "the file is empty"),
        (b"\x7fELF and so on", "this file is not one"),
        (packed()[:200], "its end is missing"),
    ],
)
def test_what_is_no_archive_is_refused(tmp_path: Path, content: bytes, value: str):
    assert value in refusal(tmp_path, content)


def declared(size: int, name: str = "a") -> zipfile.ZipInfo:
    member = zipfile.ZipInfo(name)
    member.file_size = size
    return member


def test_a_zip_bomb_is_refused_by_what_it_declares(monkeypatch: pytest.MonkeyPatch):
    assert "zip bomb: 1.0 MiB would unpack to 1024 MiB" in archive_faults([declared(1 << 30)], 1 << 20)[0]
    assert "at most 16 GiB are unpacked" in archive_faults([declared(1 << 40)], 1 << 38)[0]
    monkeypatch.setattr("handover.cosim.fmu.file.archive._MAX_FILES", 1000)
    assert "at most 1000 are unpacked" in archive_faults([declared(1, str(i)) for i in range(1001)], 1 << 30)[0]


def test_large_and_dense_archives_are_not_taken_for_bombs():
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
        with pytest.raises(InvalidFmu, match="zip bomb"):
            FmuArchive(file)
        assert tracemalloc.get_traced_memory()[1] < 1 << 20
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize(
    ("names", "value"),
    [
        (["unit/modelDescription.xml"], "zip what is in that folder, not the folder"),
        (["ModelDescription.xml"], "there is ModelDescription.xml; upper and lower case count"),
        (["readme.txt"], "the archive holds readme.txt"),
        ([], "the archive holds nothing"),
    ],
)
def test_a_missing_description_is_reported_with_what_is_there(tmp_path: Path, names: list[str], value: str):
    file = tmp_path / "a.fmu"
    with zipfile.ZipFile(file, "w") as archive:
        for name in names:
            archive.writestr(name, b"")
    with pytest.raises(InvalidFmu, match=value):
        FmuArchive(file).description()


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


def test_what_is_no_file_is_reported(tmp_path: Path):
    for path, value in ((tmp_path, "at the top of the folder"), (Path(os.devnull), "not a regular file")):
        with pytest.raises(InvalidFmu, match=value):
            FmuArchive(path).description()


@pytest.mark.parametrize("fmi", [2, 3])
def test_an_fmu_whose_paths_begin_at_the_folder_itself_runs(tmp_path: Path, fmi: int):
    dotted = tmp_path / "dotted.fmu"
    with zipfile.ZipFile(native_fmu("gain", fmi)) as plain, zipfile.ZipFile(dotted, "w") as archive:
        for name in plain.namelist():
            archive.writestr(f"./{name}", plain.read(name))
    assert set(FmuArchive(dotted).names) >= {"modelDescription.xml"}
    system = System()
    system.add("gain", dotted)
    with Master(system) as master:
        master.run(Fraction(1))
    assert problems_of(dotted) == ([], "")


def test_a_path_twice_with_and_without_the_folder_itself_has_one_content(tmp_path: Path):
    assert "the same path twice, with different contents: resources/table.csv" in refusal(
        tmp_path, packed("./resources/table.csv")
    )


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
