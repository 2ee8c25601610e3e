"""The compiled FMI runtime as an FMU has it: `binaries/<platform>/<unit>.so`."""

import importlib.util

from fmus.compile import TARGETS, compile_runtime, is_current, library, wanted_platforms
from fmus.universal import universal

FMI2_FOLDERS = {
    "x86_64-linux": "linux64",
    "x86_64-windows": "win64",
    "x86_64-darwin": "darwin64",
    "aarch64-darwin": "darwin64",
    "aarch64-linux": "aarch64-linux",
}
"""FMI 2 has one name for both kinds of Mac, and none for Linux on ARM; FMI 3's names of the platforms are ours."""


class NotCompiled(RuntimeError):
    """The FMI runtime is missing for every platform."""

    def __init__(self) -> None:
        super().__init__(
            "the FMI runtime is not compiled for this machine. Cure: install the package anew, or, in a checkout, "
            "`python -m pip install ziglang` and `python fmus/compile.py`"
        )


def binaries(name: str, fmi: int) -> dict[str, bytes]:
    """Return the runtime for all platforms that it is compiled for, by its path in the FMU of that name.

    In a checkout with a compiler, what is older than its sources is compiled first.

    Raises:
        NotCompiled: there is none, and no compiler.
        CompilationError: the compiler refused.
    """
    if not all(is_current(target) for target in wanted_platforms()) and importlib.util.find_spec("ziglang"):
        compile_runtime()
    made: dict[str, list[bytes]] = {}
    for target in filter(is_current, TARGETS):
        file = library(target, fmi)
        folder = FMI2_FOLDERS[target] if fmi == 2 else target
        made.setdefault(f"binaries/{folder}/{name}{file.suffix}", []).append(file.read_bytes())
    if not made:
        raise NotCompiled
    return {path: parts[0] if len(parts) == 1 else universal(parts) for path, parts in made.items()}
