"""Compiles C sources of this project to shared libraries with `zig cc`, once for each state of the sources.

Used while the package is built, where nothing but the standard library and ziglang is installed, and for what is
missing or out of date in a checkout.
"""

import hashlib
import importlib.util
import os
import platform
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

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

FLAGS = (
    "-O2",
    "-std=c11",
    "-shared",
    "-fPIC",
    "-fvisibility=hidden",
    "-s",
    "-Wall",
    "-Wextra",
    "-Wno-unused-parameter",
)
STAMP = "sources.sha256"
"""The name of the file beside compiled libraries that tells what they were made from."""

Compiler = Callable[["list[str]"], "subprocess.CompletedProcess[str]"]
"""Takes a C compiler's arguments; returns what it said in `stdout`."""


class CompilationError(RuntimeError):
    """Libraries could not be compiled for a platform; the message holds what the compiler said."""

    def __init__(self, what: str, target: str, output: str) -> None:
        super().__init__(f"the {what} does not compile for {target}:\n{output}")
        self.what, self.target, self.output = what, target, output


@dataclass(frozen=True)
class NativeLibraries:
    """Libraries that are made of the C sources in one folder and lie below it, or else in the cache.

    Attributes:
        what: what they are, for messages; `cache_name` is its folder in the cache.
        folder: where the sources are.
        sources: by library's name, the files that it is made of.
        compiler: compiles a library.
    """

    what: str
    cache_name: str
    folder: Path
    sources: Mapping[str, Sequence[str]]
    compiler: Compiler

    def library(self, target: str, name: str) -> Path:
        """Return where a library for a platform lies, or, if it is not compiled, where it should."""
        return (self._current(target) or self.folder / "bin" / target) / f"{name}{TARGETS[target][1]}"

    def is_current(self, target: str) -> bool:
        """Tell whether the libraries for a platform are there and made from the sources as they are."""
        return target in TARGETS and self._current(target) is not None

    def compile(self, target: str) -> None:
        """Compile what is missing or older than its sources; safe when two processes do it at once.

        The libraries go beside the sources, as in a checkout, or into the cache where that place cannot be written.

        Raises:
            CompilationError: the compiler refused or is missing, or there is no place for the libraries.
        """
        if self.is_current(target):
            return
        fingerprint = self._fingerprint()
        folder = self._place_to_write(target, fingerprint)
        names = {name: f"{name}{TARGETS[target][1]}" for name in self.sources}
        with tempfile.TemporaryDirectory(dir=folder, prefix="compiling-") as scratch:
            for name, own in self.sources.items():
                files = [str(self.folder / source) for source in own]
                done = self.compiler([*_arguments(target, Path(scratch) / names[name]), *files])
                if done.returncode:
                    raise CompilationError(self.what, target, done.stdout)
            (Path(scratch) / STAMP).write_text(fingerprint)
            for file in (*names.values(), STAMP):
                os.replace(Path(scratch) / file, folder / file)

    def _current(self, target: str) -> "Path | None":
        fingerprint = self._fingerprint()
        for place in self._places(target, fingerprint):
            made = all((place / f"{name}{TARGETS[target][1]}").is_file() for name in self.sources)
            if made and (place / STAMP).is_file() and (place / STAMP).read_text() == fingerprint:
                return place
        return None

    def _places(self, target: str, fingerprint: str) -> "tuple[Path, Path]":
        """Return a platform's folder beside the sources, and in the cache, where versions of sources are kept apart."""
        return self.folder / "bin" / target, cache_folder() / self.cache_name / fingerprint[:16] / target

    def _place_to_write(self, target: str, fingerprint: str) -> Path:
        why = ""
        for place in self._places(target, fingerprint):
            try:
                place.mkdir(parents=True, exist_ok=True)
                with tempfile.TemporaryFile(dir=place):
                    return place
            except OSError as e:
                why += f"{e}\n"
        raise CompilationError(self.what, target, f"{why}HANDOVER_CACHE must be a folder that can be written")

    def _fingerprint(self) -> str:
        digest = hashlib.sha256(repr((sorted(self.sources.items()), TARGETS, FLAGS)).encode())
        for source in sorted(self.folder.glob("*.[ch]")):
            digest.update(source.name.encode() + b"\0" + source.read_bytes())
        return digest.hexdigest()


def host_platform() -> str:
    """Return this machine's platform by its FMI 3.0 name, such as `x86_64-linux`."""
    machine = platform.machine().lower()
    architecture = {"amd64": "x86_64", "arm64": "aarch64"}.get(machine, machine)
    system = {"win32": "windows"}.get(sys.platform, sys.platform)
    return f"{architecture}-{system}"


def has_compiler() -> bool:
    """Tell whether this Python has ziglang."""
    return importlib.util.find_spec("ziglang") is not None


def cache_folder() -> Path:
    """Return the folder HANDOVER_CACHE, or the one for this project in the user's cache folder."""
    given = os.environ.get("HANDOVER_CACHE")
    base = os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA") or Path.home() / ".cache"
    return Path(given) if given else Path(base) / "handover-cosim"


def zig_cc(arguments: "list[str]") -> "subprocess.CompletedProcess[str]":
    """Run zig's C compiler with its caches outside the source tree; output and errors come together in `stdout`."""
    cache = cache_folder() / "zig"
    environment = {"ZIG_GLOBAL_CACHE_DIR": str(cache), "ZIG_LOCAL_CACHE_DIR": str(cache / "local")}
    return subprocess.run(
        [sys.executable, "-m", "ziglang", "cc", *arguments],
        env={**os.environ, **environment},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )


def _arguments(target: str, made: Path) -> "list[str]":
    arguments = [*FLAGS, "-target", TARGETS[target][0], "-o", str(made)]
    if target.endswith("linux"):
        arguments.append("-ldl")
    if target.endswith("darwin"):
        arguments.append(f"-Wl,-install_name,@rpath/{made.name}")  # else the scratch folder's name stays in it
    return arguments
