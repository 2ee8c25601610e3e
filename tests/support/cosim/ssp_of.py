"""Makes SSPs out of XML as the tests write it."""

import zipfile
from collections.abc import Mapping
from pathlib import Path

NAMESPACES = " ".join(
    f'xmlns:{prefix}="http://ssp-standard.org/SSP1/{name}"'
    for prefix, name in {
        "ssd": "SystemStructureDescription",
        "ssc": "SystemStructureCommon",
        "ssv": "SystemStructureParameterValues",
        "ssm": "SystemStructureParameterMapping",
    }.items()
)
MM = '<ssd:Units><ssc:Unit name="mm"><ssc:BaseUnit m="1" factor="0.001"/></ssc:Unit></ssd:Units>'

_MORE = """
    <ScalarVariable name="p[1]" valueReference="20" causality="parameter" variability="fixed"><Real start="1" unit="m"/>
    </ScalarVariable>
    <ScalarVariable name="p[2]" valueReference="21" causality="parameter" variability="fixed"><Real start="2" unit="m"/>
    </ScalarVariable>
    <ScalarVariable name="on" valueReference="22" causality="parameter" variability="fixed"><Boolean start="false"/>
    </ScalarVariable>
    <ScalarVariable name="called" valueReference="23" causality="parameter" variability="fixed"><String start=""/>
    </ScalarVariable>
    <ScalarVariable name="light" valueReference="24" causality="parameter" variability="fixed">
      <Enumeration declaredType="Light" start="1"/></ScalarVariable>
"""
_TYPES = """<TypeDefinitions><SimpleType name="Light"><Enumeration>
<Item name="RED" value="1"/><Item name="GREEN" value="2"/>
</Enumeration></SimpleType></TypeDefinitions>"""
MORE_PARAMETERS = (
    ("</ModelVariables>", _MORE + "</ModelVariables>"),
    ("</UnitDefinitions>", "</UnitDefinitions>" + _TYPES),
)
"""Edits of decay.c's description: parameters of all types."""


def connectors(**kinds: str) -> str:
    """Return connectors of reals by name and kind; `x="output mm"` has a unit."""
    listed: list[str] = []
    for name, found in kinds.items():
        kind, _, unit = found.partition(" ")
        typed = f'<ssc:Real unit="{unit}"/>' if unit else "<ssc:Real/>"
        listed.append(f'<ssd:Connector name="{name}" kind="{kind}">{typed}</ssd:Connector>')
    return f"<ssd:Connectors>{''.join(listed)}</ssd:Connectors>"


def component(name: str, inside: str = "", source: str = "resources/unit.fmu", more: str = "") -> str:
    return f'<ssd:Component name="{name}" source="{source}" {more}>{inside}</ssd:Component>'


def connection(start: str, end: str, inside: str = "", more: str = "") -> str:
    """Return a connection between ends such as `a.x`, or `x` of the system itself."""
    ends: list[str] = []
    for which, found in (("start", start), ("end", end)):
        element, dot, name = found.partition(".")
        ends.append(f'{which}Element="{element}" {which}Connector="{name}"' if dot else f'{which}Connector="{found}"')
    return f"<ssd:Connection {' '.join(ends)} {more}>{inside}</ssd:Connection>"


def system(elements: str, connections: str = "", name: str = "whole", before: str = "") -> str:
    connected = f"<ssd:Connections>{connections}</ssd:Connections>" if connections else ""
    return f'<ssd:System name="{name}">{before}<ssd:Elements>{elements}</ssd:Elements>{connected}</ssd:System>'


def described(inside: str, more: str = "", version: str = "1.0") -> str:
    return (
        f'<?xml version="1.0" encoding="UTF-8"?>\n'
        f'<ssd:SystemStructureDescription {NAMESPACES} version="{version}" name="test">\n'
        f"{inside}\n{more}</ssd:SystemStructureDescription>"
    )


def parameters(*values: str, more: str = "", name: str = "set") -> str:
    """Return a parameter set of `name type value` or `name type value unit`."""
    listed: list[str] = []
    for found in values:
        parameter, type_name, value, *unit = found.split("|")
        with_unit = f' unit="{unit[0]}"' if unit else ""
        typed = f'<ssv:{type_name} value="{value}"{with_unit}/>'
        listed.append(f'<ssv:Parameter name="{parameter}">{typed}</ssv:Parameter>')
    inside = f"<ssv:Parameters>{''.join(listed)}</ssv:Parameters>{more}"
    return f'<ssv:ParameterSet {NAMESPACES} version="1.0" name="{name}">{inside}</ssv:ParameterSet>'


def bindings(*inside: str, more: str = "") -> str:
    """Return bindings of parameter sets inside the description."""
    made = "".join(
        f"<ssd:ParameterBinding {more}><ssd:ParameterValues>{i}</ssd:ParameterValues></ssd:ParameterBinding>"
        for i in inside
    )
    return f"<ssd:ParameterBindings>{made}</ssd:ParameterBindings>"


def pack_ssp(path: Path, description: str | None, files: Mapping[str, Path | str | bytes]) -> Path:
    """Write an SSP."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        if description is not None:
            archive.writestr("SystemStructure.ssd", description)
        for name, content in files.items():
            archive.writestr(name, content.read_bytes() if isinstance(content, Path) else content)
    return path
