from pathlib import Path

import pytest

from handover.fmus.build import cached
from handover.scenarios.robots.helix.helix_handover import HelixHandover
from handover.scenarios.runs.execution.errors import UsageError
from handover.scenarios.runs.execution.selection import select_fmus


def test_a_unit_of_the_catalog_takes_a_place_by_its_name_but_a_file_of_that_name_goes_first(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.chdir(tmp_path)
    for arm in (Path("built/TendonArmFast"), Path("TendonArmFast")):
        fmus = select_fmus(HelixHandover, {"arm": "TendonArmFast"}, lambda name: Path("built") / name)
        assert (fmus["arm"], fmus["hand"]) == (arm, Path("built/HandoverPartner"))
        Path("TendonArmFast").touch()


@pytest.mark.parametrize("given", ["gentle.py", "gentle.py:Gentle", "gentle", "./gentle.py"])
def test_a_python_file_is_refused_with_how_its_block_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, given: str
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "gentle.py").write_text("class Params: ...\nclass Gentle:\n    def step(self, t, dt, u): ...\n")
    with pytest.raises(UsageError, match=r"^unit servo: .*gentle.* is named MODULE:CLASS: gentle:Gentle$"):
        select_fmus(HelixHandover, {"servo": given}, lambda name: Path("built") / name)


def test_the_nearest_module_here_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "gentle.py").write_text("")
    with pytest.raises(UsageError, match=r"there is no module 'gentel', .*; did you mean gentle\?$"):
        select_fmus(HelixHandover, {"servo": "gentel:Gentle"}, lambda name: cached(name, 3))
