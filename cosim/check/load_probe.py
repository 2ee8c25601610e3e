"""Loads an FMU's library and looks up every function; runs in an isolated process, see `isolated_process`."""

import ctypes
import os
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from handover.cosim.probe.finding import Finding, fault
from handover.cosim.probe.isolated_process import Journal

_MISSING_LIBRARY = re.compile(r"(?:^|: |Library not loaded: )([^:\s]*?([^/:\s]+)): cannot open shared object file")
_MISSING_ON_DARWIN = re.compile(r"Library not loaded: (\S+)")
_GLIBC = re.compile(r"version [`'](\w+_[\d.]+)' not found")


def main(task: Mapping[str, Any]) -> None:
    """Load `task["library"]` and look up `task["functions"]`; report what fails and what is missing."""
    journal = Journal(Path(task["journal"]))
    library = Path(task["library"])
    os.chdir(library.parent)  # as FMPy does: some libraries look there for others
    journal.begins("loading the library")
    try:
        loaded = ctypes.CDLL(str(library))
    except OSError as e:
        journal.found(load_fault(str(e), library.name))
    else:
        missing = [name for name in task["functions"] if not hasattr(loaded, name)]
        for finding in _missing_findings(missing, len(task["functions"])):
            journal.found(finding)
        journal.record(loaded=True)
    journal.begins("unloading the library")
    journal.ends()


def load_fault(message: str, library: str) -> Finding:
    """Return what the dynamic linker's message means."""
    missing = _MISSING_LIBRARY.search(message) or _MISSING_ON_DARWIN.search(message)
    name = missing[1].rpartition("/")[2] if missing else ""
    if name and name != library:
        what = f"it needs the shared library {name}, which is not on this machine"
        cure = "install it, or have the exporting tool put it beside the FMU's library"
    elif version := _GLIBC.search(message):
        what = f"it needs {version[1]}, which this machine's system libraries are too old for"
        cure = "build it on an older system, or run it on a newer one"
    elif "wrong ELF class" in message or "incompatible architecture" in message or "WinError 193" in message:
        what, cure = "it is made for another processor", "export it for this one"
    elif "WinError 126" in message:
        what = "a shared library that it needs is not on this machine"
        cure = "install it, for instance the runtime of the compiler that it was built with"
    elif symbol := re.search(r"undefined symbol: (\w+)", message):
        what = f"it uses the function {symbol[1]}, which is neither in it nor in a library that it names"
        cure = "link it with the library that has the function"
    else:
        what, cure = "the system does not load it", ""
    return fault(what, cure=cure, log=(message,))


def _missing_findings(missing: list[str], wanted: int) -> Iterator[Finding]:
    if len(missing) == wanted:
        prefix = missing[0][:4]
        what = f"it exports none of the {wanted} functions of {prefix}..."
        yield fault(what, cure='they must be exported under their plain names (extern "C", dllexport, no prefix)')
    elif missing:
        what = f"it lacks {len(missing)} of {wanted} functions: {', '.join(missing)}"
        cure = "hosts that look them up reject it or crash: the standard requires all, used or not"
        yield fault(what, cure=cure)
