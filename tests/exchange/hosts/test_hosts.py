"""docs/hosts.md: every unit in every form and host. `make hosts` makes it; a unit that came later is not in it yet."""

import hashlib
import json
import os
import re
import subprocess
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from math import inf, nan
from pathlib import Path
from typing import Any

import pytest
from support.exchange.cells import Cell, difference
from support.exchange.host_runs import HOSTS, Form
from support.exchange.libcosim_job import needs_libcosim
from support.exchange.page import PAGE, Cells, Notes, is_sound, page, written
from support.exchange.reference import Record
from support.processes import SUPPORT, program, with_path

from handover.fmus.build import cached
from handover.fmus.catalog import UNITS
from handover.fmus.compile import cache_folder

LATER = "A unit of the catalog that is in no table was added later and has not been tried in these hosts yet."
LIMIT = 1800.0
"""Seconds after which a unit in a form is given up."""
WORKERS = os.cpu_count() or 1
"""Units that are run at a time."""


def faults_of(text: str) -> list[str]:
    """Return in what a page's tables are not of all forms and hosts, or not of the catalog's units."""
    faults, seen = (
        [f"no table of {form.value}" for form in Form if f"\n## {form.value}\n" not in text],
        list[set[str]](),
    )
    for section in re.split(r"^## ", text, flags=re.MULTILINE)[1:]:
        form, *lines = section.splitlines()
        if form in {f.value for f in Form}:
            rows = {line.split("`")[1]: line.count("|") - 2 for line in lines if line.startswith("| `")}
            if f"| unit | {' | '.join(HOSTS)} |" not in lines:
                faults.append(f"{form}: other hosts than {', '.join(HOSTS)}")
            faults += [f"{form}: {unit} is not a unit of the catalog" for unit in rows if unit not in UNITS]
            faults += [f"{form}: {unit} has {n} cells" for unit, n in rows.items() if n != len(HOSTS)]
            seen.append(set(rows))
    return faults + [
        f"{unit} is not in every table" for unit in sorted(set().union(*seen)) if not all(unit in s for s in seen)
    ]


def test_a_page_has_each_of_its_units_in_every_form_and_host():
    """A unit that was added since `make hosts` made docs/hosts.md is not in it."""
    text = PAGE.read_text(encoding="utf-8")
    assert not faults_of(text), f"run `make hosts`, and commit docs/{PAGE.name}"
    whole = page({(u, f, h): Cell(0.0, 12.3) for u in UNITS for f in Form for h in HOSTS}, 1)
    assert not faults_of(whole)
    assert not faults_of(re.sub(r"^\| `Push` .*\n", "", whole, flags=re.MULTILINE))  # as where Push came later
    assert len(faults_of(whole.replace("`Push`", "`Pushes`"))) == len(Form)
    assert LATER in text
    assert LATER in whole


@pytest.mark.parametrize(
    ("found", "pictures", "off", "named"),
    [
        ([{"a": 1.0, "b": 2.0}], [{"left": b"12"}], 0.0, []),
        ([{"a": 1.0, "b": 2.0}], [{"left": b"13"}], inf, []),
        ([{"a": 1.0, "b": 2.0}], [], 0.0, ["left"]),
        ([{"a": 1.0}], [], 0.0, ["b", "left"]),
        ([{"a": 1.0, "b": 2.5}], [], 0.25, ["left"]),
        ([{"a": 1.0, "b": nan}], [], inf, ["left"]),
        ([{"a": 1.0, "b": 2.0}] * 2, [], inf, []),
        ([{"a": 1.0, "c": 2.0}], [], inf, ["c"]),
    ],
)
def test_what_differs_is_reported(
    found: list[dict[str, float]], pictures: list[dict[str, bytes]], off: float, named: list[str]
):
    wanted = Record([{"a": 1.0, "b": 2.0}], [{"left": b"12"}])
    assert difference(Record(found, pictures), wanted, 0) == (off, named)


@pytest.mark.parametrize(
    ("cell", "sound"),
    [
        (Cell(1e-13, 12.3), True),
        (Cell(1e-11, 12.3), False),
        (Cell(inf, 12.3), False),
        (Cell(failure="AssertionError: Unsupported FMI version for FMU"), True),
        (Cell(failure="AssertionError: it ended with -11"), False),
    ],
)
def test_a_cell_that_is_not_sound_is_bold(cell: Cell, sound: bool):
    assert is_sound(cell, "Push", Form.FMI3, "libcosim") is sound
    assert ("**" in written(cell, "Push", Form.FMI3, "libcosim", Notes())) is not sound


@pytest.mark.hosts
@needs_libcosim
def test_every_unit_in_every_form_and_host():
    """Makes the page. Interrupted, it goes on where it was; a cell that failed is tried again."""
    folder = cache_folder() / "hosts" / _sources()
    folder.mkdir(parents=True, exist_ok=True)
    cases = [(unit, form) for form in Form for unit in UNITS]
    with ThreadPoolExecutor(WORKERS) as pool:
        found = list(pool.map(partial(_cells, folder), *zip(*cases, strict=True)))
    cells: Cells = {(*case, host): cell for case, made in zip(cases, found, strict=True) for host, cell in made.items()}
    PAGE.write_text(page(cells, WORKERS), encoding="utf-8")
    bad = [f"{' '.join((u, f.value, h))}: {c}" for (u, f, h), c in cells.items() if not is_sound(c, u, f, h)]
    if not bad:
        for file in folder.iterdir():
            file.unlink()
    assert not bad, "\n".join(bad)


def _cells(folder: Path, unit: str, form: Form) -> dict[str, Cell]:
    """Return what the hosts make of a unit in a form, in processes of their own."""
    file = folder / f"{unit}.{form.name}.{cached(unit, 3).parent.name[:16]}.json"
    done = _sound(file, unit, form)
    while len(done) < len(HOSTS):
        file.write_text(json.dumps({host: vars(cell) for host, cell in done.items()}))
        environment = with_path() | {"OPENBLAS_NUM_THREADS": "1"}
        command = program("exchange/cells.py", unit, form.value, file)
        ended = subprocess.run(command, env=environment, capture_output=True, text=True, check=False, timeout=LIMIT)
        found = json.loads(file.read_text())
        running = found.pop("running", "")
        done = {host: Cell(**cell) for host, cell in found.items()}
        if ended.returncode and not running:
            raise AssertionError(f"{unit}, {form.value}: {ended.stderr}")
        if running and running not in done:
            done[running] = Cell(failure=f"the process ended with {ended.returncode}: {ended.stderr[-300:]}")
    print(f"{unit}, {form.value}: " + ", ".join(f"{host} {_short(done[host])}" for host in HOSTS), flush=True)
    return {host: done[host] for host in HOSTS}


def _sound(file: Path, unit: str, form: Form) -> dict[str, Cell]:
    """Return the sound cells of a run that was interrupted."""
    kept: Any = json.loads(file.read_text()) if file.is_file() else {}
    cells = {host: Cell(**cell) for host, cell in kept.items() if host != "running"}
    return {host: cell for host, cell in cells.items() if is_sound(cell, unit, form, host)}


def _short(cell: Cell) -> str:
    return "-" if cell.failure else f"{cell.difference:.0e} {cell.us:.0f} us"


def _sources() -> str:
    """Return a hash of the drivers: what another version of them found is not gone on with."""
    digest = hashlib.sha256()
    for file in sorted((SUPPORT / "exchange").iterdir()):
        if file.suffix in (".py", ".c") and file.name != "page.py":
            digest.update(file.read_bytes())
    return digest.hexdigest()[:16]
