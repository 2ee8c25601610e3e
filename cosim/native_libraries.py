"""Compiles C sources of this project to libraries and programs with `zig cc`, once for each state of the sources.

Used while the package is built, where nothing but the standard library and ziglang is installed, and for what is
missing or out of date in a checkout.
"""

import hashlib
import importlib.util
import logging
import os
import platform
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from handover.cosim.python_process import module_command

# by FMI 3.0's name of the platform: zig's name, the suffix of a shared library
TARGETS = {
    "x86_64-linux": ("x86_64-linux-gnu.2.17", ".so"),
    "aarch64-linux": ("aarch64-linux-gnu.2.17", ".so"),
    "x86_64-windows": ("x86_64-windows-gnu", ".dll"),
    "x86_64-darwin": ("x86_64-macos.11.0", ".dylib"),
    "aarch64-darwin": ("aarch64-macos.11.0", ".dylib"),
}
"""Where x86-64 and AArch64 share a folder of FMI 2 that holds one library, the first in this table has it.

glibc 2.17 is the oldest with AArch64, macOS 11 the oldest on Apple silicon; zig's own choice is the latest but two.
"""

_FLAGS = ("-fvisibility=hidden", "-s", "-Wall", "-Wextra", "-Wno-unused-parameter")
FLAGS = ("-O2", "-std=c11", "-shared", "-fPIC", *_FLAGS)
_PROGRAM_FLAGS = ("-O2", "-std=c11", *_FLAGS)
STAMP = "sources.sha256"
"""The name of the file beside compiled libraries that holds the fingerprint of the sources they were made from."""
DIGESTS = "libraries.sha256"
"""The name of the file beside them that holds the libraries' own digests, by which a damaged one is found."""

_log = logging.getLogger(__name__)

Compiler = Callable[["list[str]"], "subprocess.CompletedProcess[str]"]
"""Takes a C compiler's arguments; its messages are in the returned `stdout`."""


class CompilationError(RuntimeError):
    """Libraries could not be compiled for a platform; the message holds the compiler's output."""

    def __init__(self, what: str, target: str, output: str) -> None:
        super().__init__(f"the {what} does not compile for {target}:\n{output}")
        self.what, self.target, self.output = what, target, output


@dataclass(frozen=True)
class NativeLibraries:
    """Libraries compiled from the C sources in one folder; they are kept below it, or else in the cache.

    Attributes:
        what: what they are, for messages.
        cache_name: their folder in the cache.
        folder: where the sources are.
        sources: by library's name, the source files that it is compiled from.
        compiler: compiles a library.
        programs: by program's name, likewise; there are none for Windows.
    """

    what: str
    cache_name: str
    folder: Path
    sources: Mapping[str, Sequence[str]]
    compiler: Compiler
    programs: Mapping[str, Sequence[str]] = field(default_factory=dict[str, Sequence[str]])

    def library(self, target: str, name: str) -> Path:
        """Return the path of a library for a platform or, if it is not compiled, the path that it will have."""
        return self._place(target) / f"{name}{TARGETS[target][1]}"

    def program(self, target: str, name: str) -> Path:
        """Return the path of a program for a platform, likewise."""
        return self._place(target) / name

    def is_current(self, target: str) -> bool:
        """Return whether the libraries for a platform exist and were compiled from the present sources."""
        return target in TARGETS and self._current(target) is not None

    def compile(self, target: str) -> None:
        """Compile what is missing or older than its sources; safe when two processes do it at the same time.

        The libraries go beside the sources, as in a checkout, or into the cache where that folder is not writable.

        Raises:
            CompilationError: the compiler failed or is missing, or neither folder is writable.
        """
        if self.is_current(target):
            return
        fingerprint = self._fingerprint()
        folder = self._writable_folder(target, fingerprint)
        if self._is_made(folder, target, fingerprint):
            _log.warning("a library of the %s in %s is damaged; it is compiled again", self.what, folder)
        files = self._files(target)
        with tempfile.TemporaryDirectory(dir=folder, prefix="compiling-") as scratch:
            for file, sources in files.items():
                flags = _PROGRAM_FLAGS if file in self.programs else FLAGS
                paths = [str(self.folder / source) for source in sources]
                done = self.compiler([*_arguments(target, Path(scratch) / file, flags), *paths])
                if done.returncode:
                    raise CompilationError(self.what, target, done.stdout)
            (Path(scratch) / DIGESTS).write_text(_digests([Path(scratch) / file for file in files]))
            (Path(scratch) / STAMP).write_text(fingerprint)
            for file in (*files, DIGESTS, STAMP):
                _write_through(Path(scratch) / file)
                os.replace(Path(scratch) / file, folder / file)

    def _place(self, target: str) -> Path:
        return self._current(target) or self.folder / "bin" / target

    def _files(self, target: str) -> "dict[str, Sequence[str]]":
        """Return what is compiled from which sources, by the name of its file."""
        return {**{f"{name}{TARGETS[target][1]}": s for name, s in self.sources.items()}, **self.programs}

    def _current(self, target: str) -> "Path | None":
        fingerprint = self._fingerprint()
        for folder in self._folders(target, fingerprint):
            if self._is_made(folder, target, fingerprint) and not self._is_damaged(folder, target):
                return folder
        return None

    def _is_made(self, folder: Path, target: str, fingerprint: str) -> bool:
        is_complete = all((folder / file).is_file() for file in self._files(target))
        return is_complete and (folder / STAMP).is_file() and (folder / STAMP).read_text() == fingerprint

    def _is_damaged(self, folder: Path, target: str) -> bool:
        digests = folder / DIGESTS  # there is none beside libraries of earlier versions
        libraries = [folder / file for file in self._files(target)]
        return digests.is_file() and digests.read_text() != _digests(libraries)

    def _folders(self, target: str, fingerprint: str) -> "tuple[Path, Path]":
        """Return a platform's folder beside the sources, and in the cache, where versions of sources are kept apart."""
        return self.folder / "bin" / target, cache_folder() / self.cache_name / fingerprint[:16] / target

    def _writable_folder(self, target: str, fingerprint: str) -> Path:
        reasons = ""
        for folder in self._folders(target, fingerprint):
            try:
                folder.mkdir(parents=True, exist_ok=True)
                with tempfile.TemporaryFile(dir=folder):
                    return folder
            except OSError as e:
                reasons += f"{e}\n"
        raise CompilationError(self.what, target, f"{reasons}HANDOVER_CACHE must be a writable folder")

    def _fingerprint(self) -> str:
        programs = (sorted(self.programs.items()), _PROGRAM_FLAGS) if self.programs else ()
        digest = hashlib.sha256(repr((sorted(self.sources.items()), TARGETS, FLAGS, *programs)).encode())
        for source in sorted(self.folder.glob("*.[ch]")):
            digest.update(source.name.encode() + b"\0" + source.read_bytes())
        return digest.hexdigest()


def _digests(libraries: Sequence[Path]) -> str:
    return "".join(f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.name}\n" for path in libraries)


def _write_through(file: Path) -> None:
    """Wait until the disk has a file, so that it is whole under its later name, also after the machine went down."""
    with file.open("rb+") as written:
        os.fsync(written.fileno())


def host_platform() -> str:
    """Return this machine's platform by its FMI 3.0 name, such as `x86_64-linux`."""
    machine = platform.machine().lower()
    architecture = {"amd64": "x86_64", "arm64": "aarch64"}.get(machine, machine)
    system = {"win32": "windows"}.get(sys.platform, sys.platform)
    return f"{architecture}-{system}"


def has_compiler() -> bool:
    """Return whether the ziglang package is installed for this Python."""
    return importlib.util.find_spec("ziglang") is not None


def cache_folder() -> Path:
    """Return the folder HANDOVER_CACHE, or the one for this project in the user's cache folder."""
    configured = os.environ.get("HANDOVER_CACHE")
    base = os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA") or Path.home() / ".cache"
    return Path(configured) if configured else Path(base) / "handover-cosim"


def zig_cc(arguments: "list[str]") -> "subprocess.CompletedProcess[str]":
    """Run zig's C compiler with its caches outside the source tree; output and errors come together in `stdout`."""
    cache = cache_folder() / "zig"
    environment = {"ZIG_GLOBAL_CACHE_DIR": str(cache), "ZIG_LOCAL_CACHE_DIR": str(cache / "local")}
    return subprocess.run(
        module_command("ziglang", "cc", *arguments),
        env={**os.environ, **environment},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )


def _arguments(target: str, file: Path, flags: Sequence[str]) -> "list[str]":
    arguments = [*flags, "-target", TARGETS[target][0], "-o", str(file)]
    if target.endswith("linux"):
        arguments += ["-ldl", *(["-lpthread", "-lm"] if flags is _PROGRAM_FLAGS else [])]
    if target.endswith("darwin") and flags is FLAGS:
        # the default name would be the path in the scratch folder, which differs with every compilation
        arguments.append(f"-Wl,-install_name,@rpath/{file.name}")
    return arguments
