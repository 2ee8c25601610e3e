"""terminalsAndIcons/terminalsAndIcons.xml of an FMU: the block's terminals, as FMI 3.0 has them.

FMI 2 does not define the file. FMI 3.0 puts it beside the model description so that FMUs of older versions can have it,
too; its `fmiVersion` there is that of the standard which defines it. A tool that does not know it passes over it.
"""

import xml.etree.ElementTree as ET

from handover.cosim.blocks.variable import element_names
from handover.fmus.contents.icons import graphical_representation
from handover.fmus.contents.model_description import Model, to_xml
from handover.fmus.layout import Form

SIGNAL = "signal"
"""The kind of variable whose values are to be equal at both ends; forces in space are signals too, by the standard."""


def terminals_file(model: Model) -> bytes:
    """Return the file as XML: of FMI 3 with how the unit is drawn, and with the terminals that its block has.

    An array's entries are members of their own where the model description has them as variables: `p_WG[1]`.
    """
    root = ET.Element("fmiTerminalsAndIcons", fmiVersion="3.0")
    if model.form is not Form.FMI2:
        root.append(graphical_representation())
    if not model.description.terminals:
        return to_xml(root)
    variables = {v.name: v for v in model.description.variables}
    listed = ET.SubElement(root, "Terminals")
    for t in model.description.terminals:
        element = ET.SubElement(
            listed,
            "Terminal",
            name=t.name,
            matchingRule=t.kind.rule.value,
            terminalKind=t.kind.standard_name,
            description=f"{t.kind.value}: {', '.join(t.members.values())}",
        )
        for member, port in t.members.items():
            names = [port] if model.form.has_arrays else element_names(variables[port])
            for name in names:
                ET.SubElement(
                    element,
                    "TerminalMemberVariable",
                    variableName=name,
                    memberName=member + name.removeprefix(port),
                    variableKind=SIGNAL,
                )
    return to_xml(root)
