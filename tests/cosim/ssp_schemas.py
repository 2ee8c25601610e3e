"""The standard's schemas of SSP 1.0 and 2.0, as pyssp_standard has them, against which SSPs that we write are tried."""

import importlib
import importlib.util
import zipfile
from pathlib import Path
from typing import Any

import pytest

_etree: Any = importlib.import_module("lxml.etree")
_NAMES = {".ssd": "SystemStructureDescription.xsd", ".ssv": "SystemStructureParameterValues.xsd"}


def expect_valid(ssp: Path, version: str) -> list[str]:
    """Assert that the XML files of an SSP keep to the schemas of a version; return their names."""
    spec = importlib.util.find_spec("pyssp_standard")
    if spec is None or spec.origin is None:
        pytest.skip("pyssp_standard, which has the schemas, is not installed")
    folder = Path(spec.origin).parent / "resources"
    checked: list[str] = []
    with zipfile.ZipFile(ssp) as archive:
        for name in archive.namelist():
            if Path(name).suffix in _NAMES:
                schema = _etree.XMLSchema(
                    file=str((folder if version == "1.0" else folder / "ssp2") / _NAMES[Path(name).suffix])
                )
                root = _etree.fromstring(archive.read(name))
                assert root.get("version") == version
                assert schema.validate(root), f"{name}: {schema.error_log}"
                checked.append(name)
    return checked
