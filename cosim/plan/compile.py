"""Compiles the plan's loop, `cosim/plan/*.c`, for this machine; by hand: `python -m handover.cosim.plan.compile`.

`setup.py` imports this while the package is built, where nothing but the standard library and ziglang is installed.
"""

from pathlib import Path

from handover.cosim.native_libraries import TARGETS, NativeLibraries, has_compiler, host_platform, zig_cc

FOLDER = Path(__file__).parent
SOURCES = ("carry_out.c", "cpu_clock.c", "crash_note.c", "exact_time.c", "plan.c")


def compile_plan(platform: "str | None" = None) -> None:
    """Compile the library for a platform, by default this machine's, if it is missing or older than its sources.

    On a platform that is not a target nothing is done.

    Raises:
        CompilationError: the compiler failed or is missing, or the library cannot be written.
    """
    target = platform or host_platform()
    if target in TARGETS:
        _libraries().compile(target)


def plan_library() -> "Path | None":
    """Return the library for this machine, compiled first if necessary and possible; None if there is none.

    Raises:
        CompilationError: the compiler failed, or the library cannot be written.
    """
    host = host_platform()
    if host in TARGETS and not _libraries().is_current(host) and has_compiler():
        compile_plan()
    return _libraries().library(host, "plan") if _libraries().is_current(host) else None


def _libraries() -> NativeLibraries:
    return NativeLibraries("master's plan", "plan", FOLDER, {"plan": SOURCES}, zig_cc)


if __name__ == "__main__":
    compile_plan()
