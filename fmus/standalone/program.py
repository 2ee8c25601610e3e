"""What a frozen interpreter runs: the script that it is given, or with `--try RESOURCES TOKEN STEP RESULT` one step.

Standard library only.
"""

import json
import os
import runpy
import sys
from typing import Any

_OF_THE_SYSTEM = ("/proc/", "/sys/", "/dev/", "/etc/", "/usr/share/", "/System/", "/Library/")
"""Folders whose files every machine has."""


def try_unit(resources: str, token: str, step: str, result: str) -> None:
    """Let a unit start and step once; write as JSON its fault and which files it opened that only this machine has.

    The result is a file, as a package may print at any time.

    A fault has `package`, the name of a missing one, `lacks`, the path of a missing file, and `error`; it is {}
    where there is none, as of a unit that rejects its own start values.
    """
    loader = runpy.run_path(os.path.join(resources, "sources", "handover", "fmus", "loader.py"), run_name="fmu_loader")
    opened = _note_what_is_read(os.path.dirname(resources))
    fault: dict[str, Any] = {}
    slave: Any = None
    try:
        slave = loader["start"](resources, token)
        slave.initialise()
        slave._clock[:] = 0.0, float(step)  # type: ignore
        slave.step()
    except BaseException as e:
        rejects_start_values = slave is not None and getattr(e, "is_refusal", False)
        cause = e.__cause__ or e
        package = (cause.name or "").partition(".")[0] if isinstance(cause, ImportError) else ""
        lacks = cause.filename if isinstance(cause, FileNotFoundError) else None
        if missing := getattr(e, "missing", ()):
            fault = {"package": ", ".join(missing), "lacks": None, "error": "PyInstaller has left it out"}
        elif package or lacks or not rejects_start_values:
            fault = {"package": package, "lacks": lacks, "error": loader["explain"](e)}
    found = json.dumps({"fault": fault, "opened": sorted(opened)})
    with open(result, "w", encoding="utf-8") as file:
        file.write(found)


def _note_what_is_read(scratch: str) -> set[str]:
    """Return the set of files, which grows as they are read: those neither of the unit's folder nor of any system."""
    opened: set[str] = set()
    folders = (scratch, sys.prefix, getattr(sys, "_MEIPASS", sys.prefix))
    own = tuple(os.path.realpath(folder) + os.sep for folder in folders)

    def note(event: str, arguments: tuple[Any, ...]) -> None:
        if event == "open" and isinstance(arguments[0], str) and not arguments[2] & (os.O_WRONLY | os.O_RDWR):
            path = os.path.realpath(arguments[0])
            if os.path.isfile(path) and not path.startswith(own + _OF_THE_SYSTEM):
                opened.add(path)

    sys.addaudithook(note)
    return opened


if __name__ == "__main__":
    if sys.argv[1] == "--try":
        try_unit(*sys.argv[2:])
    else:
        runpy.run_path(sys.argv[1], run_name="__main__")
