"""The icons of units: the pictures by which other tools, reports and lists show them.

The catalog's are in the folder `icons/`, by robot: NAME.svg, drawn by hand, and NAME.png, rendered from it (`make
icons`), so that building an FMU needs no renderer. A unit of one's own has the picture that its block's attribute
`icon` names, else `icons/block.svg`, a block in a diagram.
"""

import inspect
import xml.etree.ElementTree as ET
from pathlib import Path

from handover.cosim.fmu.file.icon import Icon, png_fault, svg_fault
from handover.fmus.catalog import UNITS, Entry, import_class
from handover.fmus.contents.model_description import number

_FOLDER = Path(__file__).parents[1] / "icons"
_OF_ANY_BLOCK = _FOLDER / "block.svg"

_CORNER = 100.0
"""Half the side of an icon, in the units of its coordinate system."""
_MILLIMETRES = 0.1
"""Of a unit of that coordinate system, in a diagram: an icon is 20 mm wide."""


class InvalidIcon(ValueError):
    """A block's attribute `icon` does not name a picture."""

    def __init__(self, block: str, icon: object, fault: str) -> None:
        super().__init__(
            f"icon = {icon!r} of {block}: {fault}; expected the name of a PNG beside the block's module, such as "
            "'spring.png', and a drawing spring.svg beside that goes with it"
        )
        self.block, self.icon, self.fault = block, icon, fault


def catalog_icon(name: str) -> Path:
    """Return the SVG of a unit of the catalog, and the one of any block for every other name."""
    own = _FOLDER.glob(f"*/{name}.svg") if name in UNITS else ()
    return next(iter(own), _OF_ANY_BLOCK)


def block_icon(entry: Entry) -> Icon:
    """Return the icon of a unit of the catalog, or of one's own.

    Raises:
        InvalidIcon: the block's attribute `icon` names no picture.
        UnknownBlock: the block does not exist.
    """
    names = {unit.block: name for name, unit in UNITS.items()}
    if entry.block in names:
        return _read(catalog_icon(names[entry.block]))
    block = import_class(entry.block)
    owner = next((c for c in block.__mro__ if "icon" in vars(c)), None)
    if owner is None:
        return _read(_OF_ANY_BLOCK)
    icon = vars(owner)["icon"]
    if not isinstance(icon, str):
        raise InvalidIcon(entry.block, icon, "that is not a text")
    folder = Path(inspect.getfile(owner)).resolve().parent
    file = (folder / icon).resolve()
    if not file.is_relative_to(folder) or not file.is_file():
        raise InvalidIcon(entry.block, icon, f"there is no such file in {folder}")
    return _checked(entry.block, icon, _read(file.with_suffix(".svg"), file))


def _read(svg: Path, png: Path | None = None) -> Icon:
    return Icon((png or svg.with_suffix(".png")).read_bytes(), svg.read_bytes() if svg.is_file() else b"")


def _checked(block: str, name: str, icon: Icon) -> Icon:
    if fault := png_fault(icon.png):
        raise InvalidIcon(block, name, fault)
    if icon.svg and (fault := svg_fault(icon.svg)):
        raise InvalidIcon(block, name, f"the SVG of that name {fault}")
    return icon


def graphical_representation() -> ET.Element:
    """Return the element of FMI 3.0's terminalsAndIcons.xml that says where the icon is drawn: in all of a square."""
    corners = {"x1": number(-_CORNER), "y1": number(-_CORNER), "x2": number(_CORNER), "y2": number(_CORNER)}
    root = ET.Element("GraphicalRepresentation")
    ET.SubElement(root, "CoordinateSystem", corners, suggestedScalingFactorTo_mm=number(_MILLIMETRES))
    ET.SubElement(root, "Icon", corners)
    return root
