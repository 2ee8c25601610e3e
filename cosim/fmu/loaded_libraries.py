"""Where units' libraries lie in memory, so that a crash in a thread of their own is attributed to the unit.

The process that loads units notes this for the one that survives it (`note_libraries`); that asks by the address of the
instruction which crashed (`units_at`).
"""

import contextlib
import threading
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from handover.cosim.fmu.heartbeat import Heartbeat

_MAPS = Path("/proc/self/maps")
_MAX_LIBRARIES, _MAX_NAMES = 500, 3
"""What is noted at most: facts in a heartbeat have limited room."""


def note_libraries(heartbeat: Heartbeat, units: Mapping[Path, Sequence[str]]) -> None:
    """Note the host's threads and the addresses of units' libraries in a heartbeat.

    Args:
        heartbeat: of this process.
        units: by the folder of an unpacked FMU, the names of its instances.
    """
    libraries: list[tuple[int, int, list[str]]] = []
    folders = {f"{folder}/": [*names[:_MAX_NAMES]] for folder, names in list(units.items())[:_MAX_LIBRARIES]}
    with contextlib.suppress(OSError):  # Linux has the file
        for line in _MAPS.read_text(encoding="utf-8", errors="replace").splitlines():
            place, _, path = line.partition("/")
            span, rights, *_ = place.split()
            if "x" not in rights:
                continue
            names = next((names for folder, names in folders.items() if f"/{path}".startswith(folder)), None)
            if names is not None:
                low, high = (int(number, 16) for number in span.split("-"))
                libraries.append((low, high, names))
    threads = {threading.main_thread().native_id, threading.get_native_id()}
    heartbeat.record_facts(threads=sorted(t for t in threads if t is not None), libraries=libraries)


def units_at(address: int, facts: Mapping[str, Any]) -> Sequence[str]:
    """Return the instances of the library that has code at an address, by a heartbeat's facts; none if unknown."""
    return next((names for low, high, names in facts.get("libraries", ()) if low <= address < high), ())


def is_own_thread(thread: int, facts: Mapping[str, Any]) -> bool:
    """Return whether a thread is none of those that the host has noted, and so one that a library has started."""
    return "threads" in facts and thread not in facts["threads"]
