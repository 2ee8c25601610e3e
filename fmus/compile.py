"""Compiles the FMI runtime: `fmus/runtime/*.c` to one shared library per standard and platform, with `zig cc`.

Used by `setup.py` while the package is built, where nothing but the standard library and ziglang is installed, and by
`handover.fmus.binaries` for libraries that are missing or out of date. `python -m handover.fmus.compile [PLATFORM...]`
compiles from the command line.
"""

import argparse
import os
from collections.abc import Iterable
from pathlib import Path

from handover.cosim.native_libraries import (
    STAMP,
    TARGETS,
    CompilationError,
    NativeLibraries,
    cache_folder,
    has_compiler,
    host_platform,
    zig_cc,
)

__all__ = [
    "STAMP",
    "TARGETS",
    "CompilationError",
    "cache_folder",
    "has_compiler",
    "host_platform",
    "zig_cc",
]

RUNTIME = Path(__file__).with_name("runtime")

SHARED_SOURCES = (
    "bundled.c",
    "derivatives.c",
    "embedded.c",
    "lifecycle.c",
    "log.c",
    "platform.c",
    "process_lock.c",
    "process_posix.c",
    "process_shared.c",
    "process_windows.c",
    "python_api.c",
    "remote.c",
    "sampling.c",
    "shared_memory.c",
    "slave.c",
    "state.c",
    "stepping.c",
    "text.c",
    "values.c",
    "variables.c",
)
SOURCES = {
    2: ("fmi2.c",),
    3: ("fmi3.c", "fmi3_clocks.c", "fmi3_derivatives.c", "fmi3_events.c", "fmi3_unsupported.c", "fmi3_values.c"),
}


class UnknownPlatform(ValueError):
    """A name is of no platform for which the runtime can be compiled."""

    def __init__(self, unknown: "list[str]") -> None:
        super().__init__(
            f"no platform {', '.join(map(repr, unknown))}; there are {', '.join(TARGETS)}, and `host` and `all`"
        )
        self.unknown, self.valid = unknown, (*TARGETS, "host", "all")


def named_platforms(names: "Iterable[str]") -> "tuple[str, ...]":
    """Return the platforms that names stand for, each once: FMI 3.0's names, `host` or `all`, also several with commas.

    Raises:
        UnknownPlatform: a name is none of them, or `host` is a machine of another kind.
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
    """Return the path of the runtime for a platform and a version of FMI, whether it is compiled or not."""
    return _libraries().library(target, f"fmi{fmi}")


def compile_runtime(targets: "Iterable[str] | None" = None) -> None:
    """Compile whatever is missing or older than its sources; safe when two processes do it concurrently.

    The libraries go beside the sources, as in a checkout, or into the cache where that place cannot be written.

    Raises:
        UnknownPlatform: a platform is not known.
        CompilationError: the compiler failed or is missing, or the libraries cannot be written anywhere.
    """
    for target in wanted_platforms() if targets is None else named_platforms(targets):
        _libraries().compile(target)


def is_current(target: str) -> bool:
    """Return whether the compiled runtime for a platform is there and made from the sources as they are."""
    return _libraries().is_current(target)


def _libraries() -> NativeLibraries:
    sources = {f"fmi{fmi}": own + SHARED_SOURCES for fmi, own in SOURCES.items()}
    return NativeLibraries("FMI runtime", "runtime", RUNTIME, sources, zig_cc)


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
