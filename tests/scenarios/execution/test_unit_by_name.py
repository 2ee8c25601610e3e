from pathlib import Path

import pytest

from handover.scenarios.execution.selection import select_fmus
from handover.scenarios.helix.helix_handover import HelixHandover


def test_a_unit_of_the_catalog_takes_a_place_by_its_name():
    fmus = select_fmus(HelixHandover, {"arm": "TendonArmFast"}, lambda name: Path("built") / name)
    assert fmus["arm"] == Path("built/TendonArmFast")
    assert fmus["hand"] == Path("built/HandoverPartner")


def test_a_file_of_that_name_goes_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "TendonArmFast").write_bytes(b"")
    fmus = select_fmus(HelixHandover, {"arm": "TendonArmFast"}, lambda name: Path("built") / name)
    assert fmus["arm"] == Path("TendonArmFast")
