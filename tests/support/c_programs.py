"""Programs and libraries in C that tests need, compiled once for all tests and kept as long as their sources are."""

import hashlib
import os
import tempfile
from pathlib import Path

from handover.fmus.compile import RUNTIME, cache_folder, host_platform, zig_cc


def compiled(*sources: Path, flags: "tuple[str, ...]" = ()) -> Path:
    """Return a program of this machine, named as the first source; `-shared` among the flags makes it a library."""
    digest = hashlib.sha256(repr((flags, host_platform())).encode())
    for file in (*sources, *sorted(RUNTIME.glob("*.h"))):
        digest.update(f"\0{file.name}\0".encode() + file.read_bytes())
    made = cache_folder() / "test-programs" / digest.hexdigest()[:16] / sources[0].stem
    if not made.is_file():
        made.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=made.parent) as scratch:
            new = Path(scratch) / made.name
            given = ["-O1", "-std=gnu11", "-I", str(RUNTIME), *map(str, sources), "-o", str(new), "-ldl", "-lm", *flags]
            done = zig_cc(given)
            assert done.returncode == 0, done.stdout
            os.replace(new, made)
    return made
