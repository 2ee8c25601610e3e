"""Why a zip archive is not to be unpacked: its members would lead out of a folder, fill the disk, or not be read."""

import re
import stat
import zipfile
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import PurePosixPath

STANDARD_METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
"""Compressions that the standards know."""

_METHODS = (*STANDARD_METHODS, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA)
_MIB = 1 << 20
_MOST_FILES = 100_000
_MOST_BYTES = 16 << 30
_SUSPECT_BYTES, _SUSPECT_RATIO = 256 * _MIB, 200  # libraries and tables shrink to a tenth, rarely to a hundredth
_MOST_TOLD = 5


def archive_faults(members: Sequence[zipfile.ZipInfo], size: int) -> list[str]:
    """Return why members of an archive of `size` bytes are not to be unpacked, a line for each kind of fault."""
    names = [m.orig_filename for m in members]
    plain = {n for n in names if not n.endswith("/")}
    kinds: tuple[tuple[str, Iterable[str]], ...] = (
        ("paths that lead out of it; they must be relative, with slashes", filter(_leads_out, names)),
        ("the same path twice", (n for n, count in Counter(names).items() if count > 1)),
        ("symbolic links or devices; store the files themselves", (m.orig_filename for m in members if _special(m))),
        ("encrypted files; store them without a password", (m.orig_filename for m in members if m.flag_bits & 0x1)),
        (
            "files in a compression that cannot be read; use deflate",
            (m.orig_filename for m in members if m.compress_type not in _METHODS),
        ),
        ("files that are folders of other files", (n for n in plain if plain & _parents(n))),
    )
    found = ((what, sorted(set(paths))) for what, paths in kinds)
    return [
        *(f"the archive holds {what}: {listed(paths)}" for what, paths in found if paths),
        *_size_faults(members, size),
    ]


def _size_faults(members: Sequence[zipfile.ZipInfo], size: int) -> list[str]:
    if len(members) > _MOST_FILES:
        return [f"the archive holds {len(members)} files; at most {_MOST_FILES} are unpacked"]
    total = sum(m.file_size for m in members)
    if total > _MOST_BYTES:
        return [f"the archive would unpack to {total / 2**30:.0f} GiB; at most {_MOST_BYTES >> 30} GiB are unpacked"]
    if total > _SUSPECT_BYTES and total > _SUSPECT_RATIO * size:
        told = f"{size / _MIB:.1f} MiB would unpack to {total / _MIB:.0f} MiB"
        return [f"the archive looks like a zip bomb: {told}; at most {_SUSPECT_RATIO} times as much is believed"]
    return []


def _leads_out(name: str) -> bool:
    windows = "\\" in name or ":" in name  # other systems take these for letters; Windows goes elsewhere
    return windows or name.startswith("/") or "\0" in name or ".." in PurePosixPath(name).parts or not name.strip("./")


def _special(member: zipfile.ZipInfo) -> bool:
    kind = stat.S_IFMT(member.external_attr >> 16)
    return kind not in (0, stat.S_IFREG, stat.S_IFDIR)


def _parents(name: str) -> set[str]:
    return {str(p) for p in PurePosixPath(name).parents}


def listed(names: Iterable[str]) -> str:
    """Return the first of some paths, shortened and without what would steer a terminal."""
    shown = [_shown(n) for n in names]
    more = f", and {len(shown) - _MOST_TOLD} more" if len(shown) > _MOST_TOLD else ""
    return ", ".join(shown[:_MOST_TOLD]) + more


def _shown(name: str) -> str:
    shown = re.sub(r"[^\x20-\x7e]", lambda m: m[0].encode("unicode_escape").decode(), name)
    return shown if len(shown) <= 100 else shown[:97] + "..."
