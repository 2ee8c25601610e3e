"""The icon in an FMU, by which tools show it: where FMI 2 and FMI 3 have it, written and read.

FMI 2 has a PNG, `model.png`, FMI 3 a PNG and, where there is a drawing, an SVG in `terminalsAndIcons/`. An FMU may have
the files of both. What is there and is not a picture is passed over: an icon keeps no unit from running.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from handover.cosim.fmu.file.archive import FmuArchive
from handover.cosim.fmu.file.xml import UnsafeXml, parse_xml

_FMI2_PNG = "model.png"
_FMI3_PNG, _FMI3_SVG = "terminalsAndIcons/icon.png", "terminalsAndIcons/icon.svg"
_PNG = b"\x89PNG\r\n\x1a\n"
"""With what every PNG begins."""
_PNG_END = b"IEND\xaeB`\x82"
"""With what it ends: the empty chunk IEND and its CRC."""


@dataclass(frozen=True)
class Icon:
    """A unit's icon: the contents of a PNG, and of an SVG; empty where there is none."""

    png: bytes = b""
    svg: bytes = b""

    @property
    def best(self) -> tuple[str, bytes]:
        """MIME type and content of the SVG or, without one, of the PNG; both empty if there is neither."""
        if self.svg:
            return "image/svg+xml", self.svg
        return ("image/png", self.png) if self.png else ("", b"")


def png_fault(content: bytes) -> str:
    """Return why bytes are no PNG; empty if they begin as one and its end is there."""
    if not content.startswith(_PNG):
        return "that is not a PNG"
    return "" if _PNG_END in content else "that is a PNG which is cut off"


def svg_fault(content: bytes) -> str:
    """Return why bytes are no SVG, as a sentence about it; empty if they are one."""
    try:
        is_drawing = parse_xml(content).tag == "{http://www.w3.org/2000/svg}svg"
    except UnsafeXml as e:
        return f"cannot be read: {e}"
    return "" if is_drawing else "does not begin with <svg> of its namespace"


def icon_files(icon: Icon, fmi: int) -> Mapping[str, bytes]:
    """Return an icon's files by their paths in an FMU of FMI 2 or 3, as the standards name them."""
    if fmi == 2:
        return {_FMI2_PNG: icon.png}
    return {_FMI3_PNG: icon.png, **({_FMI3_SVG: icon.svg} if icon.svg else {})}


def read_icon(archive: FmuArchive) -> Icon:
    """Return an FMU's icon, of whatever version.

    Raises:
        InvalidFmu: the archive is damaged.
    """
    pngs = (archive.read(name) for name in (_FMI3_PNG, _FMI2_PNG) if name in archive.names)
    png = next((content for content in pngs if not png_fault(content)), b"")
    svg = archive.read(_FMI3_SVG) if _FMI3_SVG in archive.names else b""
    return Icon(png, b"" if svg and svg_fault(svg) else svg)
