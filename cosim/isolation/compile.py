"""Compiles the process of an isolated unit and the library through which the master calls it, `cosim/isolation/*.c`.

By hand: `python -m handover.cosim.isolation.compile`. `setup.py` imports this while the package is built, where nothing
but the standard library and ziglang is installed.
"""

import functools
from pathlib import Path

from handover.cosim.native_libraries import TARGETS, NativeLibraries, has_compiler, host_platform, zig_cc

FOLDER = Path(__file__).parent
PROXY = (
    "channel.c",
    "proxy_process.c",
    "proxy_batch.c",
    "proxy_values.c",
    "proxy_calls.c",
    "proxy_fmi2.c",
    "proxy_fmi3.c",
)
PROCESS = ("channel.c", "unit_process.c", "unit_calls.c", "unit_forks.c")


def is_supported(platform: "str | None" = None) -> bool:
    """Return whether units can have processes of their own on a platform, by default this machine's: not on Windows."""
    target = platform or host_platform()
    return target in TARGETS and not target.endswith("windows")


def compile_isolation(platform: "str | None" = None) -> None:
    """Compile what is missing or older than its sources, likewise; do nothing where it is not supported.

    Raises:
        CompilationError: the compiler failed or is missing, or the files cannot be written.
    """
    if is_supported(platform):
        _libraries().compile(platform or host_platform())


@functools.cache
def isolation_files() -> "tuple[Path, Path] | None":
    """Return the library and the program, compiled first if necessary and possible; None if there are none.

    Raises:
        CompilationError: the compiler failed, or the files cannot be written.
    """
    host = host_platform()
    if not is_supported():
        return None
    if not _libraries().is_current(host) and has_compiler():
        compile_isolation()
    if not _libraries().is_current(host):
        return None
    return _libraries().library(host, "proxy"), _libraries().program(host, "unit_process")


def _libraries() -> NativeLibraries:
    what = "process of isolated units"
    return NativeLibraries(what, "isolation", FOLDER, {"proxy": PROXY}, zig_cc, {"unit_process": PROCESS})


if __name__ == "__main__":
    compile_isolation()
