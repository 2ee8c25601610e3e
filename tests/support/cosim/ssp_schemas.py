"""The standard's schemas, against which SSPs that we write are tried: of 1.0 in FMPy, of 2.0 in pyssp_standard."""

import importlib
import importlib.util
import zipfile
from pathlib import Path
from typing import Any

import fmpy
import pytest

_etree: Any = importlib.import_module("lxml.etree")
_NAMES = {".ssd": "SystemStructureDescription.xsd", ".ssv": "SystemStructureParameterValues.xsd"}


def expect_valid(ssp: Path, version: str) -> list[str]:
    """Assert that the XML files of an SSP keep to the schemas of a version; return their names."""
    checked: list[str] = []
    with zipfile.ZipFile(ssp) as archive:
        for name in archive.namelist():
            if Path(name).suffix in _NAMES:
                schema = _etree.XMLSchema(file=str(_folder(version) / _NAMES[Path(name).suffix]))
                root = _etree.fromstring(archive.read(name))
                assert root.get("version") == version
                assert schema.validate(root), f"{name}: {schema.error_log}"
                checked.append(name)
    return checked


def _folder(version: str) -> Path:
    if version == "1.0":
        return Path(fmpy.__file__).parent / "ssp" / "schema"
    spec = importlib.util.find_spec("pyssp_standard")
    if spec is None or spec.origin is None:
        pytest.skip("pyssp_standard, which has the schemas of 2.0, is not installed")
    return Path(spec.origin).parent / "resources" / "ssp2"
