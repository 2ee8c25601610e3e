"""The compiled FMI runtime as an FMU has it: `binaries/<platform>/<unit>.so`.

Joins libraries for both kinds of Mac into one file, as FMI 2 has a single folder for them.
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

MAGIC = 0xCAFEBABE
ALIGNMENT = 14
"""Slices begin at multiples of 2**14 bytes, the page size of the larger kind."""


def universal(libraries: list[bytes]) -> bytes:
    """Return a universal binary of Mach-O files, each of its own processor."""
    whole = struct.pack(">2I", MAGIC, len(libraries))
    offset = _aligned(len(whole) + 20 * len(libraries))
    body = b""
    for content in libraries:
        processor = struct.unpack_from("<2I", content, 4)  # type and subtype
        whole += struct.pack(">5I", *processor, offset + len(body), len(content), ALIGNMENT)
        body += content.ljust(_aligned(len(content)), b"\0")
    return whole.ljust(offset, b"\0") + body


def _aligned(n: int) -> int:
    return (n + (1 << ALIGNMENT) - 1) >> ALIGNMENT << ALIGNMENT


FMI2_FOLDERS = {
    "x86_64-linux": "linux64",
    "x86_64-windows": "win64",
    "x86_64-darwin": "darwin64",
    "aarch64-linux": "aarch64-linux",
    "aarch64-darwin": "aarch64-darwin",
}
"""The folders of FMI 2.0.5, whose own names mean x86-64; any other platform has its name of FMI 3."""

FMI2_CUSTOMARY_FOLDERS = {"aarch64-linux": "linux64", "aarch64-darwin": "darwin64"}
"""Where importers on AArch64 look besides, or only (FMPy 0.3), as the names of FMI 2 are older than those machines.

`darwin64` holds both kinds of Mac in one file; `linux64` holds the library for AArch64 where there is none for x86-64.
"""


class NotCompiled(RuntimeError):
    """The FMI runtime is missing for platforms that it is wanted for, and there is no compiler."""

    def __init__(self, platforms: Sequence[str]) -> None:
        super().__init__(
            f"the FMI runtime is not compiled for {', '.join(platforms)}, and there is no compiler for it. "
            'Cure: pip install "handover-cosim[cross]"'
        )
        self.platforms = tuple(platforms)


def binaries(name: str, fmi: int, platforms: Sequence[str] | None = None) -> dict[str, bytes]:
    """Return the runtime, by its path in the FMU of that name.

    What is missing or older than its sources is compiled first, if there is a compiler.

    Args:
        name: the FMU's name.
        fmi: 2 or 3.
        platforms: those to have, as `handover.fmus.compile.named_platforms` takes them; without it all that are
            compiled.

    Raises:
        UnknownPlatform: a platform is not known.
        NotCompiled: a platform is missing, or all are, and there is no compiler.
        CompilationError: the compiler refused.
    """
    wanted = wanted_platforms() if platforms is None else named_platforms(platforms)
    missing = [target for target in wanted if not is_current(target)]
    if missing and has_compiler():
        compile_runtime(missing)
    chosen = [target for target in TARGETS if is_current(target) and (platforms is None or target in wanted)]
    if not chosen or (platforms is not None and len(chosen) < len(wanted)):
        raise NotCompiled([target for target in wanted if target not in chosen])
    made: dict[str, list[bytes]] = {}
    for target in chosen:
        file = library(target, fmi)
        for folder in _folders(target, fmi):
            made.setdefault(f"binaries/{folder}/{name}{file.suffix}", []).append(file.read_bytes())
    return {path: _one_file(path, parts) for path, parts in made.items()}


def _folders(target: str, fmi: int) -> set[str]:
    return {FMI2_FOLDERS[target], FMI2_CUSTOMARY_FOLDERS.get(target, FMI2_FOLDERS[target])} if fmi == 2 else {target}


def _one_file(path: str, parts: list[bytes]) -> bytes:
    return universal(parts) if len(parts) > 1 and path.endswith(".dylib") else parts[0]
