"""The compiled FMI runtime as files of an FMU: `binaries/<platform>/<unit>.so`.

FMI 2 has a single folder for Macs with Intel and with Apple processors, so the libraries for both are joined into one
universal binary.
"""

import struct
from collections.abc import Sequence

from handover.fmus.compile import (
    TARGETS,
    compile_runtime,
    has_compiler,
    is_current,
    library,
    named_platforms,
    wanted_platforms,
)

FMI2_FOLDERS = {
    "x86_64-linux": "linux64",
    "x86_64-windows": "win64",
    "x86_64-darwin": "darwin64",
    "aarch64-linux": "aarch64-linux",
    "aarch64-darwin": "aarch64-darwin",
}
"""The folders of FMI 2.0.5, whose names stand for x86-64; any other platform has its FMI 3 name."""

FMI2_CUSTOMARY_FOLDERS = {"aarch64-linux": "linux64", "aarch64-darwin": "darwin64"}
"""Where importers on AArch64 look as well, or only there (FMPy 0.3): FMI 2's names are older than those machines.

`darwin64` holds both kinds of Mac in one file; `linux64` holds the library for AArch64 if there is none for x86-64.
"""


class NotCompiled(RuntimeError):
    """The FMI runtime is missing for requested platforms, and there is no compiler."""

    def __init__(self, platforms: Sequence[str]) -> None:
        super().__init__(
            f"the FMI runtime is not compiled for {', '.join(platforms)}, and there is no compiler for it. "
            'Cure: pip install "handover-cosim[cross]"'
        )
        self.platforms = tuple(platforms)


def binaries(name: str, fmi: int, platforms: Sequence[str] | None = None) -> dict[str, bytes]:
    """Return the runtime's libraries as bytes, by their paths in the FMU.

    What is missing or older than its sources is compiled first, if there is a compiler.

    Args:
        name: the FMU's name.
        fmi: 2 or 3.
        platforms: names as `handover.fmus.compile.named_platforms` takes them; without it all platforms that are
            compiled.

    Raises:
        UnknownPlatform: a platform is not known.
        NotCompiled: a platform is missing, or all are, and there is no compiler.
        CompilationError: the compiler failed.
    """
    wanted = wanted_platforms() if platforms is None else named_platforms(platforms)
    missing = [target for target in wanted if not is_current(target)]
    if missing and has_compiler():
        compile_runtime(missing)
    available = [target for target in TARGETS if is_current(target) and (platforms is None or target in wanted)]
    if not available or (platforms is not None and len(available) < len(wanted)):
        raise NotCompiled([target for target in wanted if target not in available])
    libraries: dict[str, list[bytes]] = {}
    for target in available:
        file = library(target, fmi)
        for folder in _folders(target, fmi):
            libraries.setdefault(f"binaries/{folder}/{name}{file.suffix}", []).append(file.read_bytes())
    return {path: _one_file(path, parts) for path, parts in libraries.items()}


def _folders(target: str, fmi: int) -> set[str]:
    return {FMI2_FOLDERS[target], FMI2_CUSTOMARY_FOLDERS.get(target, FMI2_FOLDERS[target])} if fmi == 2 else {target}


def _one_file(path: str, parts: list[bytes]) -> bytes:
    return universal(parts) if len(parts) > 1 and path.endswith(".dylib") else parts[0]


MAGIC = 0xCAFEBABE
ALIGNMENT = 14
"""Slices begin at multiples of 2**14 bytes, the page size of Apple silicon, the larger of the two."""


def universal(libraries: list[bytes]) -> bytes:
    """Join Mach-O libraries, each for another processor, into one universal ("fat") binary."""
    header = struct.pack(">2I", MAGIC, len(libraries))
    offset = _aligned(len(header) + 20 * len(libraries))
    body = b""
    for content in libraries:
        processor = struct.unpack_from("<2I", content, 4)  # type and subtype
        header += struct.pack(">5I", *processor, offset + len(body), len(content), ALIGNMENT)
        body += content.ljust(_aligned(len(content)), b"\0")
    return header.ljust(offset, b"\0") + body


def _aligned(n: int) -> int:
    return (n + (1 << ALIGNMENT) - 1) >> ALIGNMENT << ALIGNMENT
