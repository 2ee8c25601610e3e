"""The page docs/hosts.md: tables of cells, what is left out and why. Its words are in hosts.md.txt."""

import datetime
import math
import os
import platform
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path

from jinja2 import Environment, StrictUndefined

from handover.cosim.blocks.variable import Kind
from handover.fmus.catalog import UNITS, Entry
from support.exchange.cells import Cell
from support.exchange.host_runs import HOSTS, Form
from support.exchange.reference import TOLERANCE, variables

PAGE = Path(__file__).parents[3] / "docs" / "hosts.md"

ROBOTS = {"helix": "Helix", "vsl": "VSL arm", "free_flyer": "Free-flyer", "ir_grasp": "IR grasp"}
"""Titles by the folders of `plants` and `controllers`."""
REFERENCE = ("our master", Form.FMI3)

Cells = Mapping[tuple[str, Form, str], Cell]
"""By unit, form and host."""


@dataclass(frozen=True)
class Limit:
    """What a host is known not to do.

    Attributes:
        host: its name; empty of any.
        failure: what a failure that it explains looks like, a regular expression.
        why: the note.
        of_arrays: it explains failures of units with arrays in FMI 3 alone.
    """

    host: str
    failure: str
    why: str
    of_arrays: bool = False

    def explains(self, cell: Cell, unit: str, form: Form, host: str) -> bool:
        """Return whether it is why there is no run."""
        has_arrays = form is Form.FMI3 and any(v.shape for v in variables(unit).values() if v.kind is not Kind.BINARY)
        applies = self.host in ("", host) and (has_arrays or not self.of_arrays)
        return applies and re.search(self.failure, cell.failure) is not None


LIMITS = (
    Limit("", "NoFmi2Form", "FMI 2 has no pictures, so there is no such file"),
    Limit("Ecos", "^it gives none", "all outputs of this unit are pictures, which Ecos does not give"),
    Limit("Ecos", "^CannotGive: pictures", "Ecos cannot give a unit pictures"),
    Limit("libcosim", "Unsupported FMI version", "libcosim refuses FMI 3"),
    Limit("Ecos", "", "Ecos has no arrays: it knows no entries of one, or crashes", of_arrays=True),
)


def is_reference(form: Form, host: str) -> bool:
    """Return whether a cell is the reference itself."""
    return (host, form) == REFERENCE


class Notes:
    """Notes below the tables, each with a letter, in the order in which they are first used."""

    def __init__(self) -> None:
        self._texts: list[str] = []

    def mark(self, text: str) -> str:
        """Return the mark of a note."""
        if text not in self._texts:
            self._texts.append(text)
        return f"<sup>{_letters(self._texts.index(text))}</sup>"

    def listed(self) -> Sequence[tuple[str, str]]:
        """Return all, with their letters."""
        return [(_letters(i), text) for i, text in enumerate(self._texts)]


def _letters(i: int) -> str:
    return chr(ord("a") + i) if i < 26 else _letters(i // 26 - 1) + _letters(i % 26)


def written(cell: Cell, unit: str, form: Form, host: str, notes: Notes) -> str:
    """Return a cell as it stands in the table."""
    if cell.failure:
        known = [limit.why for limit in LIMITS if limit.explains(cell, unit, form, host)]
        if known:
            return f"–{notes.mark(f'Left out: {known[0]}.')}"
        said = re.sub(r"/\S*/", "", " ".join(cell.failure.split()))  # without this machine's folders
        return f"**fails**{notes.mark(f'{unit}: {said}')}"
    marks = ""
    if cell.missing:
        kinds = sorted({_kind(unit, name) for name in cell.missing})
        marks += notes.mark(f"Compared without {' and '.join(kinds)}, which this host does not give.")
    if cell.held:
        why = "A container has no inputs that are arrays"
        marks += notes.mark(f"{why}: all keep the values of the first step, and so the time would be another's.")
    agreement = "ref" if is_reference(form, host) else _agreement(cell.difference)
    time = "" if cell.us is None or cell.held else f" · {_rounded(cell.us)}"
    return f"{agreement}{marks}{time}"


def is_sound(cell: Cell, unit: str, form: Form, host: str) -> bool:
    """Return whether a cell agrees, or is left out by a known limit."""
    if cell.failure:
        return not written(cell, unit, form, host, Notes()).startswith("**")
    return cell.difference is not None and cell.difference <= TOLERANCE


def page(cells: Cells, workers: int) -> str:
    """Return the page.

    Args:
        cells: all of them.
        workers: as many units were run at a time.
    """
    notes = Notes()
    tables = {form.value: _table(cells, form, notes) for form in Form}
    template = Path(__file__).with_name("hosts.md.txt").read_text(encoding="utf-8")
    environment = Environment(
        undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True
    )
    return environment.from_string(template).render(
        tables=tables,
        notes=notes.listed(),
        date=datetime.datetime.now(datetime.timezone.utc).date().isoformat(),
        machine=f"{_processor()}, {platform.machine()}",
        system=platform.freedesktop_os_release().get("PRETTY_NAME", platform.platform()),
        python=platform.python_version(),
        versions=[
            f"{title} {metadata.version(package)}"
            for title, package in (
                ("FMPy", "fmpy"),
                ("libcosim by libcosimpy", "libcosimpy"),
                ("Ecos by ecospy", "ecospy"),
                ("fmu-manipulation-toolbox", "fmu-manipulation-toolbox"),
                ("zig cc", "ziglang"),
            )
        ],
        workers=workers,
        cores=os.cpu_count(),
        summary=_summary(cells),
    )


def _summary(cells: Cells) -> dict[str, int]:
    ran = [cell for key, cell in cells.items() if not cell.failure and not is_reference(*key[1:])]
    return {
        "ran": len(ran),
        "equal": sum(cell.difference == 0.0 for cell in ran),
        "close": sum(0.0 < (cell.difference or 0.0) <= TOLERANCE for cell in ran),
        "off": sum((cell.difference or 0.0) > TOLERANCE for cell in ran),
        "left_out": sum(bool(cell.failure) and is_sound(cell, *key) for key, cell in cells.items()),
        "failed": sum(bool(cell.failure) and not is_sound(cell, *key) for key, cell in cells.items()),
    }


def _table(cells: Cells, form: Form, notes: Notes) -> str:
    lines = [f"| unit | {' | '.join(HOSTS)} |", "|---" * (len(HOSTS) + 1) + "|"]
    for robot, title in ROBOTS.items():
        lines.append(f"| **{title}** |" + " |" * len(HOSTS))
        for unit in (entry.name for entry in UNITS.values() if robot_of(entry) == robot):
            row = [written(cells[unit, form, host], unit, form, host, notes) for host in HOSTS]
            lines.append(f"| `{unit}` | {' | '.join(row)} |")
    return "\n".join(lines)


def robot_of(entry: Entry) -> str:
    """Return the folder of a unit's robot."""
    return entry.block.split(".")[2]


def _agreement(difference: float | None) -> str:
    if difference == 0.0:
        return "="
    if difference is None or math.isinf(difference):
        return "**differs**"
    return "1e-12" if difference <= TOLERANCE else f"**{difference:.0e}**"


def _rounded(us: float) -> str:
    return f"{us:.1f}" if us < 9.95 else f"{float(f'{us:.2g}'):,.0f}"


def _kind(unit: str, scalar: str) -> str:
    kind = variables(unit)[scalar.partition("[")[0]].kind
    return {Kind.ENUMERATION: "enumerations", Kind.BINARY: "pictures"}.get(kind, f"`{scalar}`")


def _processor() -> str:
    for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
        if line.startswith("model name"):
            return line.partition(":")[2].strip()
    return platform.processor() or "an unnamed processor"
