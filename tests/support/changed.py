"""The tests of what has changed: `python tests/support/changed.py [COMMIT]` prints what `make test-changed` runs.

Changed is what differs from the commit (HEAD by default), and files that git does not know. A module's tests are those
that import it, by themselves or through a helper module; where there are none, those of the modules that import it, and
so on. A test that has changed is run itself; of another file, such as C or TOML, the tests of its folder are run.
"""

import re
import subprocess
import sys
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
ROOMS = ("controllers", "cosim", "fmus", "plants", "scenarios")

_IMPORT = re.compile(r"^\s*(?:from ([\w.]+) import (\([^)]*\)|.*)|import ([\w.]+))", re.MULTILINE)
_NAME = re.compile(r"\w+")


def changed_files(commit: str) -> list[Path]:
    """Return the files, relative to the root, that differ from a commit or are new."""
    found: set[str] = set()
    for call in (("diff", "--name-only", commit), ("ls-files", "--others", "--exclude-standard")):
        found |= set(subprocess.check_output(["git", *call], cwd=ROOT, text=True).splitlines())
    return sorted(map(Path, found))


def select(files: Iterable[Path]) -> set[Path]:
    """Return the tests of some files: files and folders, relative to the root."""
    found: set[Path] = set()
    importers = _importers()
    for file in files:
        if file.parts[0] == "tests" and file.suffix == ".py":
            found |= _tests({file} | _through(file, importers, {"tests"}))
        elif file.parts[0] in ROOMS and file.suffix == ".py" and file.name != "__init__.py":
            found |= _nearest(file, importers) or _folder(file)
        elif file.parts[0] in (*ROOMS, "tests"):
            found |= _folder(file)
    return {path for path in found if (ROOT / path).exists()}


def _nearest(file: Path, importers: Mapping[Path, set[Path]]) -> set[Path]:
    """Return the tests that import a module, or else those of the modules that do, and so on."""
    modules, seen = {file}, {file}
    while modules:
        above = {importer for module in modules for importer in importers.get(module, ())}
        helpers = {p for helper in above if helper.parts[0] == "tests" for p in _through(helper, importers, {"tests"})}
        if tests := _tests(above | helpers):
            return tests
        modules = {path for path in above if path.parts[0] in ROOMS} - seen
        seen |= modules
    return set()


def _through(file: Path, importers: Mapping[Path, set[Path]], rooms: set[str]) -> set[Path]:
    """Return what imports a file, directly or not, by modules of some rooms."""
    found, open_ = set[Path](), [file]
    while open_:
        new = {path for path in importers.get(open_.pop(), ()) if path.parts[0] in rooms} - found
        found |= new
        open_ += new
    return found


def _tests(files: Iterable[Path]) -> set[Path]:
    return {file for file in files if file.name.startswith("test_")}


def _folder(file: Path) -> set[Path]:
    """Return the folder of tests that mirrors a file's, or the nearest above it."""
    place = file.parent if file.parts[0] == "tests" else "tests" / file.parent
    while not (ROOT / place).is_dir():
        place = place.parent
    return {place}


@cache
def _importers() -> dict[Path, set[Path]]:
    """Return by module, as a file, the files of product and tests that import it."""
    files = {room: sorted((ROOT / room).rglob("*.py")) for room in (*ROOMS, "tests")}
    named: dict[str, Path] = {}
    for room, paths in files.items():
        for path in (p.relative_to(ROOT) for p in paths):
            words = path.with_suffix("").parts
            named[".".join(words[1:] if room == "tests" else ("handover", *words))] = path
    found: dict[Path, set[Path]] = {}
    for path in (p for paths in files.values() for p in paths):
        for name in _imported(path):
            if name in named:
                found.setdefault(named[name], set()).add(path.relative_to(ROOT))
    return found


def _imported(path: Path) -> set[str]:
    """Return the names of modules that a file imports, also within functions and in programs that it writes."""
    names: set[str] = set()
    for module, imported, module_alone in _IMPORT.findall(path.read_text(encoding="utf-8")):
        names |= {module or module_alone, *(f"{module}.{name}" for name in _NAME.findall(imported))}
    return names


if __name__ == "__main__":
    print(*sorted(map(str, select(changed_files(sys.argv[1] if len(sys.argv) > 1 else "HEAD")))))
