"""The icon in an FMU of either standard; what is no picture is passed over."""

from pathlib import Path

import pytest
from native_units import native_fmu

from handover.cosim.fmu.file.archive import FmuArchive, write_archive
from handover.cosim.fmu.file.icon import Icon, read_icon

BEGIN, END = b"\x89PNG\r\n\x1a\n", b"IEND\xaeB`\x82"
PNG, OTHER = BEGIN + b" and pixels" + END, BEGIN + b" and others" + END
SVG = b'<svg xmlns="http://www.w3.org/2000/svg"/>'
FMI2, FMI3, DRAWING = "model.png", "terminalsAndIcons/icon.png", "terminalsAndIcons/icon.svg"


@pytest.mark.parametrize(
    ("files", "icon", "best"),
    [
        ({}, Icon(), ("", b"")),
        ({FMI2: PNG}, Icon(PNG), ("image/png", PNG)),
        ({FMI2: PNG, FMI3: OTHER}, Icon(OTHER), ("image/png", OTHER)),
        ({FMI3: PNG, DRAWING: SVG}, Icon(PNG, SVG), ("image/svg+xml", SVG)),
        ({FMI3: PNG, DRAWING: b"<svg"}, Icon(PNG), ("image/png", PNG)),
        ({FMI3: PNG, DRAWING: b"<svg/>"}, Icon(PNG), ("image/png", PNG)),
        ({FMI3: b"GIF89a", FMI2: PNG}, Icon(PNG), ("image/png", PNG)),
        ({FMI3: PNG[:-3], FMI2: OTHER}, Icon(OTHER), ("image/png", OTHER)),
        ({FMI3: b"", DRAWING: b""}, Icon(), ("", b"")),
    ],
)
def test_an_icon_is_read(tmp_path: Path, files: dict[str, bytes], icon: Icon, best: tuple[str, bytes]):
    unit = FmuArchive(native_fmu("mass", 2))
    others = {name: unit.read(name) for name in unit.names if not name.endswith("/")}
    found = read_icon(FmuArchive(write_archive(tmp_path / "mass.fmu", {**others, **files})))
    assert found == icon
    assert found.best == best
