"""What the hosts make of one unit in one form: `python cells.py UNIT FORM FILE`, a process of its own.

The file, in JSON, has a cell for each host that is done. It is written after each host; one that ends the process is
found in it as `running`, and a second call goes on with the hosts that are left.
"""

import json
import math
import sys
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path

from handover.fmus.build import cached
from handover.fmus.catalog import UNITS
from support.exchange import drive
from support.exchange.host_runs import HOSTS, Case, Form, HostRun, fmu_of, in_our_master
from support.exchange.reference import Record, References

MEASUREMENTS = 5
"""As often the steps are made again; the fastest counts."""
ENOUGH = 0.1
"""Seconds of CPU in our own master that a measurement should take."""
MOST_TIMES = 100
"""As often the STEPS steps are made again at most, for one measurement."""


@dataclass(frozen=True)
class Cell:
    """What a host made of a unit in a form.

    Attributes:
        difference: greatest one of an output to the reference, relative to values above 1; None where nothing ran.
        us: CPU time of a step, in microseconds.
        missing: scalar outputs that the host does not give.
        held: whether only the inputs of step 0 were given.
        failure: why there is no run; empty if there is.
    """

    difference: float | None = None
    us: float | None = None
    missing: list[str] = field(default_factory=list[str])
    held: bool = False
    failure: str = ""


def difference(found: Record, wanted: Record, first: int) -> tuple[float, list[str]]:
    """Return the greatest difference of an output, infinite of a picture or a row, and the names of what is missing."""
    if len(found.rows) != len(wanted.rows) - first:
        return math.inf, []
    greatest, missing = 0.0, dict[str, None]()
    for row, right in zip(found.rows, wanted.rows[first:], strict=True):
        if not row.keys() <= right.keys():
            return math.inf, sorted(row.keys() - right.keys())
        missing |= dict.fromkeys(name for name in right if name not in row)
        for name, x in row.items():
            y = right[name]
            if x != y and not (math.isnan(x) and math.isnan(y)):
                off = abs(x - y) / max(1.0, abs(y))
                greatest = max(greatest, math.inf if math.isnan(off) else off)
    if any(found.pictures):
        if list(found.pictures) != list(wanted.pictures[first:]):
            return math.inf, list(missing)
    elif any(wanted.pictures):
        missing |= dict.fromkeys(wanted.pictures[0])
    return greatest, list(missing)


def cell(case: Case, host: str) -> Cell:
    """Return what a host makes of a case; whatever goes wrong in the host is reported."""
    with tempfile.TemporaryDirectory(prefix="handover-hosts-") as folder:
        try:
            run = HOSTS[host](case, Path(folder))
        except (Exception, SystemExit) as e:
            return Cell(failure=_told(e))
    wanted = case.references.held(case.unit, 3) if run.held else case.references.varying(case.unit, 3)
    off, missing = difference(run.found, wanted, run.first)
    if not any(run.found.rows) and not any(run.found.pictures):
        return Cell(failure="it gives none of the unit's outputs", missing=missing)
    return Cell(off, 1e6 * _fastest(case, run), missing, run.held)


def _fastest(case: Case, run: HostRun) -> float:
    """Return the seconds of CPU of a step."""
    return min(spent / (times * drive.STEPS) for times, spent in zip(case.repeats, run.spent, strict=True))


def _told(e: BaseException) -> str:
    lines = [line.strip() for line in str(e).splitlines() if line.strip()]
    return f"{type(e).__name__}: {' / '.join(lines[-4:])}"[:600]


def _case(unit: str, form: Form, folder: Path) -> Case:
    """Return a case with as many repetitions as make a measurement long enough."""
    references = References(folder)
    plain = Case(unit, Form.FMI3, lambda _: cached(unit, 3), references, [1, 1, 1])
    once = _fastest(plain, in_our_master(plain, folder)) * drive.STEPS
    times = min(max(round(ENOUGH / once), 1), MOST_TIMES)
    return Case(unit, form, lambda fmi: fmu_of(unit, form, fmi, folder), references, [times] * MEASUREMENTS)


def _left(done: Mapping[str, object]) -> Iterator[str]:
    for host in list(HOSTS)[::-1]:  # those that run in this process come last
        if host not in done:
            yield host


def main(unit: str, form: str, file: str) -> None:
    """Try the hosts that are left."""
    assert unit in UNITS
    path = Path(file)
    done: dict[str, object] = json.loads(path.read_text()) if path.is_file() else {}
    with tempfile.TemporaryDirectory(prefix="handover-hosts-") as folder:
        case = _case(unit, Form(form), Path(folder))
        for host in _left(done):
            path.write_text(json.dumps(done | {"running": host}))
            done[host] = asdict(cell(case, host))
            path.write_text(json.dumps(done))


if __name__ == "__main__":
    main(*sys.argv[1:])
