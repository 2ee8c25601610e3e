"""Compiles the FMI runtime: `fmus/runtime/*.c` to one shared library per standard and platform, with `zig cc`.

Used by `setup.py` while the package is built, where nothing but the standard library and ziglang is installed, and by
`fmus.binaries` for what is missing or out of date. `python fmus/compile.py [PLATFORM...]` compiles by hand.
"""

import argparse
import hashlib
import importlib.util
import os
import platform
import subprocess
import sys
import tempfile
from collections.abc import Iterable
from pathlib import Path

RUNTIME = Path(__file__).with_name("runtime")

SHARED_SOURCES = (
    "derivatives.c",
    "embedded.c",
    "events.c",
    "instance.c",
    "log.c",
    "platform.c",
    "process_lock.c",
    "process_posix.c",
    "process_windows.c",
    "python_api.c",
    "remote.c",
    "sampling.c",
    "shared_memory.c",
    "slave.c",
    "state.c",
    "text.c",
    "variables.c",
)
SOURCES = {
    2: ("fmi2.c",),
    3: ("fmi3.c", "fmi3_clocks.c", "fmi3_derivatives.c", "fmi3_events.c", "fmi3_unsupported.c", "fmi3_values.c"),
}

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

STAMP = "sources.sha256"
"""The name of the file beside compiled libraries that tells what they were made from."""

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


class UnknownPlatform(ValueError):
    """A platform's name is none of those that the runtime is made for."""

    def __init__(self, unknown: "list[str]") -> None:
        super().__init__(
            f"no platform {', '.join(map(repr, unknown))}; there are {', '.join(TARGETS)}, and `host` and `all`"
        )
        self.unknown, self.valid = unknown, (*TARGETS, "host", "all")


class CompilationError(RuntimeError):
    """The runtime could not be compiled for a platform; the message holds what the compiler said."""

    def __init__(self, target: str, output: str) -> None:
        super().__init__(f"the FMI runtime does not compile for {target}:\n{output}")
        self.target, self.output = target, output


def host_platform() -> str:
    """Return this machine's platform by its FMI 3.0 name, such as `x86_64-linux`."""
    machine = platform.machine().lower()
    architecture = {"amd64": "x86_64", "arm64": "aarch64"}.get(machine, machine)
    system = {"win32": "windows"}.get(sys.platform, sys.platform)
    return f"{architecture}-{system}"


def named_platforms(names: "Iterable[str]") -> "tuple[str, ...]":
    """Return the platforms of names, each once: FMI 3.0's, `host` or `all`, singly or several with commas between.

    Raises:
        UnknownPlatform: a name is none of them, or this machine is.
    """
    given = [part.strip() for name in names for part in name.split(",")]
    wanted = {host_platform() if name == "host" else name for name in given if name}
    if "all" in wanted:
        wanted = wanted - {"all"} | set(TARGETS)
    unknown = sorted(wanted - set(TARGETS)) or ([""] if not wanted else [])
    if unknown:
        raise UnknownPlatform(unknown)
    return tuple(target for target in TARGETS if target in wanted)


def wanted_platforms() -> "tuple[str, ...]":
    """Return the platforms that HANDOVER_FMI_PLATFORMS names; without it the host's.

    Raises:
        UnknownPlatform: as `named_platforms`.
    """
    return named_platforms([os.environ.get("HANDOVER_FMI_PLATFORMS") or "host"])


def library(target: str, fmi: int) -> Path:
    """Return where the runtime for a platform and a standard lies, or, if it is not compiled, where it should."""
    return (_current(target) or RUNTIME / "bin" / target) / f"fmi{fmi}{TARGETS[target][1]}"


def has_compiler() -> bool:
    """Tell whether this Python has ziglang."""
    return importlib.util.find_spec("ziglang") is not None


def compile_runtime(targets: "Iterable[str] | None" = None) -> None:
    """Compile whatever is missing or older than its sources; safe when two processes do it at once.

    The libraries go beside the sources, as in a checkout, or into the cache where that place cannot be written.

    Raises:
        UnknownPlatform: a platform is not known.
        CompilationError: the compiler refused or is missing, or there is no place for the libraries.
    """
    for target in wanted_platforms() if targets is None else named_platforms(targets):
        if not is_current(target):
            _compile(target)


def is_current(target: str) -> bool:
    """Tell whether the compiled runtime for a platform is there and made from the sources as they are."""
    return target in TARGETS and _current(target) is not None


def _current(target: str) -> "Path | None":
    fingerprint = _fingerprint()
    for place in _places(target, fingerprint):
        made = all((place / f"fmi{fmi}{TARGETS[target][1]}").is_file() for fmi in SOURCES)
        if made and (place / STAMP).is_file() and (place / STAMP).read_text() == fingerprint:
            return place
    return None


def _places(target: str, fingerprint: str) -> "tuple[Path, Path]":
    """Return a platform's folder beside the sources, and in the cache, where versions of the sources are kept apart."""
    return RUNTIME / "bin" / target, cache_folder() / "runtime" / fingerprint[:16] / target


def _place_to_write(target: str, fingerprint: str) -> Path:
    why = ""
    for place in _places(target, fingerprint):
        try:
            place.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=place):
                return place
        except OSError as e:
            why += f"{e}\n"
    raise CompilationError(target, f"{why}HANDOVER_CACHE must be a folder that can be written")


def _fingerprint() -> str:
    digest = hashlib.sha256(repr((SHARED_SOURCES, SOURCES, TARGETS, FLAGS)).encode())
    for source in sorted(RUNTIME.glob("*.[ch]")):
        digest.update(source.name.encode() + b"\0" + source.read_bytes())
    return digest.hexdigest()


def _compile(target: str) -> None:
    fingerprint = _fingerprint()
    folder = _place_to_write(target, fingerprint)
    with tempfile.TemporaryDirectory(dir=folder, prefix="compiling-") as scratch:
        for fmi, own in SOURCES.items():
            part = Path(scratch) / f"fmi{fmi}{TARGETS[target][1]}"
            done = zig_cc([*_arguments(target, part), *(str(RUNTIME / name) for name in own + SHARED_SOURCES)])
            if done.returncode:
                raise CompilationError(target, done.stdout)
        (Path(scratch) / STAMP).write_text(fingerprint)
        for fmi in SOURCES:
            name = f"fmi{fmi}{TARGETS[target][1]}"
            os.replace(Path(scratch) / name, folder / name)
        os.replace(Path(scratch) / STAMP, folder / STAMP)


def _arguments(target: str, made: Path) -> "list[str]":
    arguments = [*FLAGS, "-target", TARGETS[target][0], "-o", str(made)]
    if target.endswith("linux"):
        arguments.append("-ldl")
    if target.endswith("darwin"):
        arguments.append(f"-Wl,-install_name,@rpath/{made.name}")  # else the scratch folder's name stays in it
    return arguments


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


def main() -> None:
    """Compile for the platforms that the command line names."""
    parser = argparse.ArgumentParser(description="Compile the FMI runtime for platforms, with zig.")
    parser.add_argument(
        "platform",
        nargs="*",
        help=f"{', '.join(TARGETS)}, host, or all [default: those of HANDOVER_FMI_PLATFORMS, or host]",
    )
    try:
        compile_runtime(parser.parse_args().platform or None)
    except (UnknownPlatform, CompilationError) as e:
        parser.exit(2, f"{parser.prog}: {e}\n")


if __name__ == "__main__":
    main()
