"""The standard's own validation: FMPy's, by the standard's schema and rules, in this project's words."""

import re
from collections.abc import Sequence
from pathlib import Path

from cosim.check.finding import Finding, fault
from cosim.fmpy_edge import problems_of

_SCHEMA = re.compile(
    r"^(?:Fatal )?(?:ERROR|Error|WARNING) \(line (\d+), column \d+\): (.*)$", re.DOTALL | re.IGNORECASE
)
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
        findings.append(fault(f"the description cannot be understood: {stopped}", where="modelDescription.xml"))
    return findings


def _finding(problem: str) -> Finding:
    match = _SCHEMA.match(problem)
    where = f"modelDescription.xml, line {match[1]}" if match else ""
    lines = [line.strip() for line in (match[2] if match else problem).splitlines() if line.strip()]
    return fault(_shortened(lines[0] if len(lines) > 3 else " ".join(lines)), where=where)


def _shortened(text: str) -> str:
    return text if len(text) <= 400 else text[:397] + "..."
