"""Compiles the FMI runtime: `fmus/runtime/*.c` to one shared library per standard and platform, with `zig cc`.

Used by `setup.py` while the package is built, where nothing but the standard library and ziglang is installed, and by
`fmus.build` in a checkout. `python fmus/compile.py [PLATFORM...]` compiles by hand.
"""

import hashlib
import os
import platform
import subprocess
import sys
import tempfile
from pathlib import Path

RUNTIME = Path(__file__).with_name("runtime")

SHARED_SOURCES = (
    "embedded.c",
    "instance.c",
    "log.c",
    "platform.c",
    "process_lock.c",
    "process_posix.c",
    "process_windows.c",
    "python_api.c",
    "remote.c",
    "shared_memory.c",
    "slave.c",
    "state.c",
    "text.c",
    "variables.c",
)
SOURCES = {2: ("fmi2.c",), 3: ("fmi3.c", "fmi3_unsupported.c", "fmi3_values.c")}

# by FMI 3.0's name of the platform: zig's name, the suffix of a shared library
TARGETS = {
    "x86_64-linux": ("x86_64-linux-gnu.2.17", ".so"),
    "aarch64-linux": ("aarch64-linux-gnu.2.17", ".so"),
    "x86_64-windows": ("x86_64-windows-gnu", ".dll"),
    "x86_64-darwin": ("x86_64-macos", ".dylib"),
    "aarch64-darwin": ("aarch64-macos", ".dylib"),
}

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


def wanted_platforms() -> tuple[str, ...]:
    """Return the platforms to compile for: the host's, or all if HANDOVER_FMI_PLATFORMS is `all`, or those it names."""
    wanted = os.environ.get("HANDOVER_FMI_PLATFORMS", "")
    if wanted == "all":
        return tuple(TARGETS)
    return tuple(wanted.split(",")) if wanted else (host_platform(),)


def library(target: str, fmi: int) -> Path:
    """Return where the runtime for a platform and a standard lies once it is compiled."""
    return RUNTIME / "bin" / target / f"fmi{fmi}{TARGETS[target][1]}"


def compile_runtime(targets: "tuple[str, ...] | None" = None) -> None:
    """Compile whatever is missing or older than its sources; safe when two processes do it at once.

    Raises:
        CompilationError: the compiler refused, is missing, or does not know the platform.
    """
    for target in targets or wanted_platforms():
        if target not in TARGETS:
            raise CompilationError(target, f"unknown platform; known: {', '.join(TARGETS)}")
        if not is_current(target):
            _compile(target)


def is_current(target: str) -> bool:
    """Tell whether the compiled runtime for a platform is there and made from the sources as they are."""
    if target not in TARGETS:
        return False
    stamp = _stamp(target)
    made = stamp.is_file() and all(library(target, fmi).is_file() for fmi in SOURCES)
    return made and stamp.read_text() == _fingerprint()


def _stamp(target: str) -> Path:
    return RUNTIME / "bin" / target / "sources.sha256"


def _fingerprint() -> str:
    digest = hashlib.sha256(repr((SHARED_SOURCES, SOURCES, TARGETS, FLAGS)).encode())
    for source in sorted(RUNTIME.glob("*.[ch]")):
        digest.update(source.name.encode() + b"\0" + source.read_bytes())
    return digest.hexdigest()


def _compile(target: str) -> None:
    folder = library(target, 2).parent
    folder.mkdir(parents=True, exist_ok=True)
    fingerprint = _fingerprint()
    for fmi, own in SOURCES.items():
        made = library(target, fmi)
        with tempfile.TemporaryDirectory(dir=folder, prefix="compiling-") as scratch:
            part = Path(scratch) / made.name
            arguments = [*FLAGS, "-target", TARGETS[target][0], "-o", str(part)]
            arguments += [str(RUNTIME / name) for name in own + SHARED_SOURCES]
            if target.endswith("linux"):
                arguments.append("-ldl")
            if target.endswith("darwin"):
                arguments.append(f"-Wl,-install_name,@rpath/{made.name}")  # else the scratch folder's name stays in it
            done = zig_cc(arguments)
            if done.returncode:
                raise CompilationError(target, done.stdout)
            os.replace(part, made)
    part = folder / f"sources-{os.getpid()}"
    part.write_text(fingerprint)
    os.replace(part, _stamp(target))


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


if __name__ == "__main__":
    compile_runtime(tuple(sys.argv[1:]) or None)
