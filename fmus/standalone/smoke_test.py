"""Smoke test: starts a unit in its frozen interpreter, and lets it step once, before its FMU is written."""

import json
import os
import subprocess
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from handover.cosim.files import scratch_folder
from handover.fmus.compile import host_platform
from handover.fmus.standalone.freezer import PROGRAM, CannotFreeze

LIMIT = 300.0
"""Seconds that a unit may take to start and to step once: as long as a host waits for a call, `TIMEOUT` in
runtime/remote.c."""


def try_unit(name: str, files: Mapping[str, bytes], token: str, step: float) -> None:
    """Start a unit in its frozen interpreter and let it step once, with its start values.

    Args:
        name: of the unit.
        files: of its FMU, by their paths.
        token: of its model description.
        step: communication step, s.

    Raises:
        CannotFreeze: a package or a data file is missing, it opens files that only this machine has, or it takes more
            than `LIMIT`.
    """
    with scratch_folder("frozen") as scratch:
        for path, content in files.items():
            if path.startswith("resources/"):
                file = Path(scratch, path)
                file.parent.mkdir(parents=True, exist_ok=True)
                file.write_bytes(content)
        resources = Path(scratch, "resources")
        program = resources / "standalone" / host_platform() / PROGRAM
        program.chmod(0o755)
        result = Path(scratch, "result.json")
        command = [program, "--try", str(resources), token, repr(step), str(result)]
        environment = _environment(program, scratch)
        try:
            done = subprocess.run(
                command,
                capture_output=True,
                text=True,
                errors="replace",
                check=False,
                env=environment,
                cwd=scratch,
                timeout=LIMIT,
            )
        except subprocess.TimeoutExpired:
            cure = "let its constructor, its outputs and its step take less"
            message = f"{name}: it has not started and stepped once in {LIMIT:g} s in its frozen interpreter; {cure}"
            raise CannotFreeze(message) from None
        if done.returncode != 0 or not result.is_file():
            why = done.stderr.strip() or f"it ends with exit status {done.returncode}"
            raise CannotFreeze(f"{name}: its frozen interpreter does not run: {why}")
        _judge(name, json.loads(result.read_text(encoding="utf-8")), resources)


def _environment(program: Path, scratch: Path) -> dict[str, str]:
    """Return the environment that the runtime gives the program, but for where it may write (runtime/process_*.c)."""
    if os.name == "nt":
        writable = dict.fromkeys(("LOCALAPPDATA", "TEMP", "TMP", "USERPROFILE"), str(scratch))
        return {"SYSTEMROOT": os.environ["SYSTEMROOT"], **writable}
    return {"LD_LIBRARY_PATH": str(program.parent / "_internal"), "HOME": str(scratch), "TMPDIR": str(scratch)}


def _judge(name: str, found: Mapping[str, Any], resources: Path) -> None:
    fault = found["fault"]
    if fault and fault["package"]:
        raise CannotFreeze(f"{name}: package {fault['package']} cannot be frozen: {fault['error']}")
    if fault and fault["lacks"]:
        place = Path(fault["lacks"])
        sources = resources / "sources"
        lacks = place.relative_to(sources) if place.is_relative_to(sources) else place
        remedy = "open it beside the module, by its __file__, and list it with --include"
        raise CannotFreeze(f"{name}: it opens {lacks}, which the FMU does not have there; {remedy}")
    if fault:
        raise CannotFreeze(f"{name}: it fails in its frozen interpreter: {fault['error']}")
    if found["opened"]:
        listed = ", ".join(found["opened"][:5])
        remedy = "open them beside the module, by its __file__, and list them with --include"
        raise CannotFreeze(f"{name}: it opens files that only this machine has: {listed}; {remedy}")
