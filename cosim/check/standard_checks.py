"""The standard's own validation: FMPy's, by the standard's schema and rules, in this project's words."""

import re
from collections.abc import Sequence
from pathlib import Path

from handover.cosim.check.finding import Finding, fault
from handover.cosim.fmu.archive import DESCRIPTION
from handover.cosim.fmu.fmpy_edge import problems_of

_SCHEMA = re.compile(
    r"^(?:Fatal )?(?:ERROR|Error|WARNING) \(line (\d+), column \d+\): (.*)$", re.DOTALL | re.IGNORECASE
)
_SETS = re.compile(
    r"(?P<list>\S+) does not contain the expected set of variables\. "
    r"Expected \{(?P<expected>.*)\} but was \{(?P<given>.*)\}\.",
    re.DOTALL,
)
_CURES = {
    "Exactly one independent variable must be defined.": 'one Float64 with causality="independent" is wanted, the time'
}
_MOST_NAMES = 20
_OUTPUTS = "ModelStructure/Outputs must have exactly one entry"  # said by structure_checks, which names them


def standard_findings(path: Path, own: Sequence[Finding]) -> list[Finding]:
    """Return what FMPy's validation finds in an FMU that may be read; `own` is what has been found without it."""
    problems, stopped = problems_of(path)
    told = " ".join(f.line for f in own)
    findings = [
        _finding(p)
        for p in dict.fromkeys(problems)
        if not (p.startswith(_OUTPUTS) and "ModelStructure does not list" in told)
    ]
    if stopped and not findings and not own:
        findings.append(fault(f"the description cannot be understood: {stopped}", where=DESCRIPTION))
    return findings


def _finding(problem: str) -> Finding:
    if sets := _SETS.fullmatch(problem):
        expected, given = (_names(sets[group]) for group in ("expected", "given"))
        parts = [
            f"{verb} {_listed(names)}"
            for verb, names in (("lacks", expected - given), ("should not have", given - expected))
            if names
        ]
        return fault(f"{sets['list']} {' and '.join(parts)}", where=DESCRIPTION)
    match = _SCHEMA.match(problem)
    where = f"{DESCRIPTION}, line {match[1]}" if match else DESCRIPTION
    lines = [line.strip() for line in (match[2] if match else problem).splitlines() if line.strip()]
    what = _shortened(lines[0] if len(lines) > 3 else " ".join(lines))
    return fault(what.rstrip("."), where=where, cure=_CURES.get(problem, ""))


def _names(text: str) -> set[str]:
    return {name for part in text.split(", ") if (name := part.strip())}


def _listed(names: set[str]) -> str:
    """Return names in the order in which people count, y2 before y10."""
    ordered = sorted(names, key=lambda name: [part.zfill(9) for part in re.split(r"(\d+)", name)])
    more = f" and {len(ordered) - _MOST_NAMES} more" if len(ordered) > _MOST_NAMES else ""
    return ", ".join(ordered[:_MOST_NAMES]) + more


def _shortened(text: str) -> str:
    return text if len(text) <= 400 else text[:397] + "..."
