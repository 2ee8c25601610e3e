import importlib.metadata
import os
from pathlib import Path

import pytest

from handover.scenarios.results.run_folder import InvalidRunFolder, RunFolder, versions


def test_nothing_is_made_before_it_is_asked_for(tmp_path: Path):
    folder = RunFolder(tmp_path / "a" / "b")
    assert list(tmp_path.iterdir()) == []
    folder.make()
    assert folder.figures.is_dir()


def test_an_empty_folder_can_be_used(tmp_path: Path):
    RunFolder(tmp_path).make()
    assert (tmp_path / "figures").is_dir()


def test_a_folder_with_something_in_it_is_refused(tmp_path: Path):
    (tmp_path / "mine").write_text("precious")
    with pytest.raises(InvalidRunFolder, match="not empty"):
        RunFolder(tmp_path)
    assert (tmp_path / "mine").read_text() == "precious"


def test_a_file_in_the_way_is_reported(tmp_path: Path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InvalidRunFolder, match="file of that name"):
        RunFolder(tmp_path / "file")
    with pytest.raises(InvalidRunFolder, match="is a file"):
        RunFolder(tmp_path / "file" / "below")


def test_a_place_without_permission_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def denied(path: Path, mode: int) -> bool:  # noqa: ARG001
        return False

    monkeypatch.setattr(os, "access", denied)
    with pytest.raises(InvalidRunFolder, match="no permission"):
        RunFolder(tmp_path / "new")


def test_a_package_that_is_not_installed_is_reported(monkeypatch: pytest.MonkeyPatch):
    def missing(package: str) -> str:
        raise importlib.metadata.PackageNotFoundError(package)

    monkeypatch.setattr(importlib.metadata, "version", missing)
    assert versions()["exudyn"] == "not installed"
