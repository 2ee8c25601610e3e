"""FMUs that are a description alone, with terminals as any tool might write them: systems read them, nothing runs."""

import zipfile
from collections.abc import Mapping
from pathlib import Path

from handover.cosim.fmu.file.archive import TERMINALS

_UNITS = {
    "1": "<BaseUnit/>",
    "m": '<BaseUnit m="1"/>',
    "mm": '<BaseUnit m="1" factor="0.001"/>',
    "N": '<BaseUnit kg="1" m="1" s="-2"/>',
}


def described_unit(
    file: Path, inputs: Mapping[str, str], outputs: Mapping[str, str], terminals: str = "", *, scalar: bool = False
) -> Path:
    """Write an FMU of FMI 3 whose ports are real, by name each with unit and extent, as in `m 3` or `N`.

    `terminals` are the elements in <Terminals>, or, if it begins with "<?xml", the whole file. Where it is `scalar`,
    each entry of an array is a variable.
    """
    variables, structure = ['<Float64 name="time" valueReference="0" causality="independent"/>'], list[str]()
    for causality, ports in (("input", inputs), ("output", outputs)):
        for name, text in ports.items():
            unit, _, extent = text.partition(" ")
            entries = [f"{name}[{i + 1}]" for i in range(int(extent))] if scalar and extent else [name]
            dimension = f'<Dimension start="{extent}"/>' if extent and not scalar else ""
            start = 'start="0"' if causality == "input" else ""
            for entry in entries:
                reference = len(variables)
                head = f'name="{entry}" valueReference="{reference}" causality="{causality}" unit="{unit}" {start}'
                variables.append(f"<Float64 {head}>{dimension}</Float64>")
                if causality == "output":
                    structure.append(f'<Output valueReference="{reference}"/>')
                    structure.append(f'<InitialUnknown valueReference="{reference}"/>')
    structure.sort(key=lambda line: line.startswith("<InitialUnknown"))
    units = "".join(f'<Unit name="{name}">{base}</Unit>' for name, base in _UNITS.items())
    description = (
        '<fmiModelDescription fmiVersion="3.0" modelName="Unit" instantiationToken="unit" '
        'variableNamingConvention="structured"><CoSimulation modelIdentifier="Unit"/>'
        f'<UnitDefinitions>{units}</UnitDefinitions><DefaultExperiment stepSize="0.1"/>'
        f"<ModelVariables>{''.join(variables)}</ModelVariables>"
        f"<ModelStructure>{''.join(structure)}</ModelStructure></fmiModelDescription>"
    )
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("modelDescription.xml", description)
        if terminals:
            listed = f'<fmiTerminalsAndIcons fmiVersion="3.0"><Terminals>{terminals}</Terminals></fmiTerminalsAndIcons>'
            archive.writestr(TERMINALS, terminals if terminals.startswith("<?xml") else listed)
    return file


def terminal_xml(name: str, rule: str, kind: str = "", *, within: str = "", **members: str) -> str:
    """Return an element <Terminal> of members by name; a variable may be followed by its kind, as in `f inflow`."""
    lines: list[str] = []
    for member, text in members.items():
        variable, _, variable_kind = text.partition(" ")
        named = "" if rule == "sequence" else f'memberName="{member}"'
        lines.append(
            f'<TerminalMemberVariable variableName="{variable}" {named} variableKind="{variable_kind or "signal"}"/>'
        )
    kind = f'terminalKind="{kind}"' if kind else ""
    return f'<Terminal name="{name}" matchingRule="{rule}" {kind}>{"".join(lines)}{within}</Terminal>'
