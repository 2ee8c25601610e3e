"""What a run tells of model descriptions: tools that are needed, and faults by `description_checks`, without a library.

A check also knows FMPy's rules for the names of variables and for the lists of states' derivatives and of initial
unknowns: names take minutes where there are many, and those lists are wrong in many FMUs and read by few.
"""

import functools
import re
from collections.abc import Iterable, Mapping
from pathlib import Path

from handover.cosim.check.description_checks import description_findings, interface_findings
from handover.cosim.fmu.file.archive import FmuArchive, description_state, is_of_this_project
from handover.cosim.fmu.file.described_variable import variables_of
from handover.cosim.fmu.file.description import FmuDescription
from handover.cosim.fmu.file.fmpy_edge import checked_xml, in_one_line
from handover.cosim.fmu.file.xml import collection_paused
from handover.cosim.probe.finding import Level

_LINE = re.compile(r"\(line \d+")


def run_faults(descriptions: Iterable[FmuDescription]) -> dict[Path, str]:
    """Return how model descriptions break the standard, beyond what was found as they were read, in a line an FMU.

    Of a variable that was found to be at fault then, no more is said.

    Raises:
        InvalidFmu: a file is not what it was when it was described.
    """
    found: dict[Path, str] = {}
    for d in {d.path: d for d in descriptions}.values():
        known = f"{d.untouched_fault}; {d.experiment.step_fault}"
        places = set(_LINE.findall(known))
        faults = _faults(d.path, d.fmi, *description_state(d.path))
        if lines := [line for line in faults if places.isdisjoint(_LINE.findall(line))]:
            found[d.path] = in_one_line(lines)
    return found


def execution_tools(descriptions: Mapping[str, FmuDescription]) -> list[str]:
    """Return, a line each, the units that need other software; not those of this project, whose Python is there."""
    needing = {name: d.path for name, d in descriptions.items() if d.capabilities.needs_tool}
    foreign = {path for path in set(needing.values()) if not is_of_this_project(path)}
    return [
        f"{name} needs other software to run, as its FMU says: the tool that exported it, or an interpreter"
        for name, path in needing.items()
        if path in foreign
    ]


@functools.lru_cache(maxsize=256)
def _faults(path: Path, fmi: int, _changed: int, _size: int) -> tuple[str, ...]:
    with collection_paused():
        root = checked_xml(FmuArchive(path))
        findings = [*interface_findings(root, fmi), *description_findings(root, fmi, variables_of(root, fmi))]
    return tuple(f.line for f in findings if f.level is Level.FAULT)
