"""Ecos' command line: a unit in an SSP with its parameters, inputs as a scenario, the outputs out of the CSV file.

Ecos' CSV file has six decimals. So a unit's real outputs are wired to a notary, which writes them down as text; Ecos
records texts as they are. What the notary writes in step k + 1 is what the unit gave in step k.
"""

import importlib.util
import shutil
import stat
import subprocess
import sys
import xml.etree.ElementTree as ET
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from handover.cosim.blocks.variable import Kind, element_names
from handover.fmus.catalog import UNITS
from support.exchange.drive import STEPS, inputs, parameters, scalars
from support.exchange.notary import ENTRIES
from support.exchange.reference import ARITHMETIC, description, variables

SSD, SSV, SSC = (
    f"http://ssp-standard.org/SSP1/{n}" for n in ("SystemStructureDescription", "ParameterValues", "Common")
)
SCENARIO = "http://github.com/Ecos-platform/libecos/resources/schema/Scenario"
TYPES = {bool: "Boolean", int: "Integer", float: "Real"}

Table = list[dict[str, str]]
"""Rows of a CSV file."""


class Ecos:
    """The program out of the wheel; there it is not executable, and the library that it needs is in another wheel."""

    def __init__(self, folder: Path) -> None:
        spec = importlib.util.find_spec("ecospy")
        assert spec is not None
        assert spec.origin is not None
        libraries = Path(spec.origin).parents[4] / "lib"  # of the environment that it is installed in
        self.program = folder / "ecos"
        shutil.copy(Path(spec.origin).parent / "binaries" / "ecos", self.program)
        self.program.chmod(self.program.stat().st_mode | stat.S_IXUSR)
        unzip = folder / "unzip"  # Ecos calls `unzip -o FILE -d FOLDER`, which not every system has
        unzip.write_text(
            f"#!{sys.executable}\nimport sys, zipfile\nzipfile.ZipFile(sys.argv[2]).extractall(sys.argv[4])\n"
        )
        unzip.chmod(0o755)
        self.environment = {"LD_LIBRARY_PATH": str(libraries), "PATH": str(folder)}

    def simulate(self, folder: Path, path: Path, step: float, stop: float, *more: str) -> Table:
        """Simulate an FMU or an SSP; return the rows of the CSV file, each by the names in its header."""
        sizes = ["--stepSize", repr(step), "--stopTime", repr(stop)]
        done = subprocess.run(
            [self.program, "simulate", "--path", path, *sizes, *more],
            cwd=folder,
            env={**ARITHMETIC, **self.environment, "TMPDIR": str(folder)},
            capture_output=True,
            text=True,
            timeout=300,
            check=False,
        )
        assert done.returncode == 0, done.stdout + done.stderr
        header, *rows = (folder / f"{path.stem}.csv").read_text().splitlines()
        names = header.split(", ")
        return [dict(zip(names, row.split(", "), strict=True)) for row in rows]

    def outputs(self, folder: Path, unit: str, fmu: Path, notary: Path) -> list[dict[str, float]]:
        """Return a unit's outputs at every communication point; enumerations only if Ecos has them."""
        write_ssp(folder / "alone.ssp", unit, fmu, notary)
        write_scenario(folder / "scenario.xml", unit)
        step = float(UNITS[unit].step)
        more = ["--parameterSet", "driven", "--scenarioConfig", str(folder / "scenario.xml")]
        table = self.simulate(folder, folder / "alone.ssp", step, (STEPS + 1.5) * step, *more)
        return [_row(unit, table[k], table[k + 1]["notary::text[STR]"]) for k in range(STEPS + 1)]


def _row(unit: str, cells: Mapping[str, str], noted: str) -> dict[str, float]:
    row = {name: float.fromhex(n) for name, n in zip(_reals(unit), noted.split(), strict=False)}
    for name, exact in row.items():
        assert abs(float(cells[f"unit::{name}[REAL]"]) - exact) < 1e-6, name
    for v in description(unit).outputs:
        for name in element_names(v) if v.kind is not Kind.REAL else ():
            cell = cells.get(f"unit::{name}[INT]", cells.get(f"unit::{name}[BOOL]"))
            if cell is not None:
                row[name] = float(cell)
    return row


def _reals(unit: str) -> list[str]:
    names = [name for v in description(unit).outputs if v.kind is Kind.REAL for name in element_names(v)]
    assert len(names) <= ENTRIES
    return names


def write_ssp(path: Path, unit: str, fmu: Path, notary: Path) -> None:
    """Write a system of the unit, with its parameters and first inputs, and the notary of its real outputs."""
    d, names = description(unit), _reals(unit)
    root = ET.Element(
        "ssd:SystemStructureDescription",
        {"xmlns:ssd": SSD, "xmlns:ssv": SSV, "xmlns:ssc": SSC, "version": "1.0", "name": "alone"},
    )
    system = ET.SubElement(root, "ssd:System", name="alone")
    elements = ET.SubElement(system, "ssd:Elements")
    component = _component(elements, "unit", fmu, dict.fromkeys(names, "output"))
    bindings = ET.SubElement(ET.SubElement(component, "ssd:ParameterBindings"), "ssd:ParameterBinding")
    values = ET.SubElement(
        ET.SubElement(bindings, "ssd:ParameterValues"), "ssv:ParameterSet", name="driven", version="1.0"
    )
    listed = ET.SubElement(values, "ssv:Parameters")
    for name, value in scalars(variables(unit), parameters(d) | inputs(d, 0)).items():
        _typed(ET.SubElement(listed, "ssv:Parameter", name=name), "ssv:{}", value)
    _component(elements, "notary", notary, {f"x[{i + 1}]": "input" for i in range(len(names))})
    connections = ET.SubElement(system, "ssd:Connections")
    for i, name in enumerate(names):
        ends = {"startElement": "unit", "startConnector": name, "endElement": "notary", "endConnector": f"x[{i + 1}]"}
        ET.SubElement(connections, "ssd:Connection", ends)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("SystemStructure.ssd", ET.tostring(root, encoding="UTF-8", xml_declaration=True))
        for file in (fmu, notary):
            archive.write(file, f"resources/{file.name}")


def write_scenario(path: Path, unit: str) -> None:
    """Write the inputs of every step."""
    d, step = description(unit), float(UNITS[unit].step)
    root = ET.Element("ecos:Scenario", {"xmlns:ecos": SCENARIO, "name": "inputs"})
    for k in range(STEPS + 1):
        action = ET.SubElement(root, "ecos:action", t=repr(k * step), eps=repr(step / 4))
        for name, value in scalars(variables(unit), inputs(d, k)).items():
            variable = ET.SubElement(action, "ecos:variable", id=f"unit::{name}")
            _typed(variable, "ecos:{}", value, lower=True)
    path.write_bytes(ET.tostring(root, encoding="UTF-8", xml_declaration=True))


def _component(elements: ET.Element, name: str, fmu: Path, connectors: Mapping[str, str]) -> ET.Element:
    source = {"source": f"resources/{fmu.name}", "type": "application/x-fmu-sharedlibrary"}
    component = ET.SubElement(elements, "ssd:Component", {"name": name, **source})
    listed = ET.SubElement(component, "ssd:Connectors")
    for connector, kind in connectors.items():
        ET.SubElement(ET.SubElement(listed, "ssd:Connector", name=connector, kind=kind), "ssc:Real")
    return component


def _typed(parent: ET.Element, tag: str, value: Any, *, lower: bool = False) -> None:
    kind = TYPES[type(value)]
    text = str(value).lower() if isinstance(value, bool) else repr(value)
    ET.SubElement(parent, tag.format(kind.lower() if lower else kind), value=text)
