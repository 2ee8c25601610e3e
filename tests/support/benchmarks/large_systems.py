"""Large systems and large FMUs, written as files: SSPs of many components, and an FMU of many variables."""

import random
import re
import zipfile
from collections.abc import Sequence
from pathlib import Path

from support.cosim.native_units import native_fmu

_NAMESPACES = (
    'xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription" '
    'xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon"'
)
_UNITS = (("late_blend", 2), ("blend", 3))
_INPUTS = ("u1", "u2", "u3")
CAUSALITIES = ("local", "parameter", "local", "output", "local", "input")


def write_large_ssp(path: Path, n: int, *, seed: int = 1) -> Path:
    """Write an SSP of n components with 3 n connections, of FMI 2 and 3 in turn, each fed by three others at random.

    Outputs of FMI 2 units follow their inputs a step later, those of FMI 3 units at once: these are fed by such as come
    before them, so there are chains and cycles but no algebraic loops.
    """
    draw = random.Random(seed)
    connectors = "".join(
        f'<ssd:Connector name="{name}" kind="{kind}"><ssc:Real/></ssd:Connector>'
        for name, kind in (*((u, "input") for u in _INPUTS), ("y", "output"))
    )
    components = (
        f'<ssd:Component name="unit{i}" source="resources/{_UNITS[i % 2][0]}.fmu">'
        f"<ssd:Connectors>{connectors}</ssd:Connectors></ssd:Component>\n"
        for i in range(n)
    )
    connections = (
        f'<ssd:Connection startElement="unit{draw.randrange(i if i % 2 else n)}" startConnector="y" '
        f'endElement="unit{i}" endConnector="{u}"/>\n'
        for i in range(n)
        for u in _INPUTS
    )
    description = (
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        f'<ssd:SystemStructureDescription {_NAMESPACES} version="1.0" name="large">\n'
        f'<ssd:System name="large"><ssd:Elements>\n{"".join(components)}</ssd:Elements>\n'
        f"<ssd:Connections>\n{''.join(connections)}</ssd:Connections></ssd:System>\n"
        '<ssd:DefaultExperiment startTime="0" stopTime="1"/>\n</ssd:SystemStructureDescription>\n'
    )
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("SystemStructure.ssd", description)
        for name, fmi in _UNITS:
            archive.write(native_fmu(name, fmi), f"resources/{name}.fmu")
    return path


def write_large_fmu(path: Path, n: int, fmi: int, *, causalities: Sequence[str] = CAUSALITIES) -> Path:
    """Write a unit whose description has n variables more, of these causalities in turn."""
    with zipfile.ZipFile(native_fmu("blend", fmi)) as unit:
        members = {name: unit.read(name) for name in unit.namelist()}
    description = members["modelDescription.xml"].decode()
    first = len(re.findall("<ScalarVariable ", description)) + 1 if fmi == 2 else 1000
    variables = "\n".join(_variable(i, first + i, fmi, causalities[i % len(causalities)]) for i in range(n))
    description = description.replace("</ModelVariables>", f"{variables}\n</ModelVariables>")
    numbers = [first + i for i in range(n) if causalities[i % len(causalities)] == "output"]
    if fmi == 2:
        rows = "\n".join(f'<Unknown index="{number}" dependencies=""/>' for number in numbers)
        description = re.sub("(</Outputs>|</InitialUnknowns>)", rf"{rows}\n\1", description)
    else:
        for kind in ("Output", "InitialUnknown"):
            rows = "\n".join(f'<{kind} valueReference="{number}" dependencies=""/>' for number in numbers)
            description = description.replace(f"<{kind} ", f"{rows}\n<{kind} ", 1)
    members["modelDescription.xml"] = description.encode()
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return path


def _variable(i: int, number: int, fmi: int, causality: str) -> str:
    variability = "fixed" if causality == "parameter" else "continuous"
    about = f'name="part{i // 100}.x{i % 100}" valueReference="{number}" description="Variable {i} of a large unit"'
    about += f' causality="{causality}" variability="{variability}"'
    start = ' start="0.5"' if causality in ("parameter", "input") else ""
    return f"<ScalarVariable {about}><Real{start}/></ScalarVariable>" if fmi == 2 else f"<Float64 {about}{start}/>"
