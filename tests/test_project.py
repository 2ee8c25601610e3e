"""What the project's tools look at: a folder that they leave out would be checked by nobody."""

from importlib import import_module
from pathlib import Path
from typing import Any

import tomli

ROOT = Path(__file__).parents[1]


def test_types_are_checked_in_every_folder():
    """Links, as which `make lint` lays out the package, are followed only where the settings name them."""
    settings: dict[str, Any] = tomli.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    parts = {f"build/lint/handover/{p.parent.name}" for p in ROOT.glob("*/__init__.py") if p.parent.name != "handover"}
    assert parts
    assert {"build/lint/handover", "tests", *parts} == set(settings["tool"]["pyrefly"]["project-includes"])


def test_each_folder_is_a_part_of_the_package_without_links():
    for part in ROOT.glob("*/__init__.py"):
        if part.parent.name != "handover":
            assert Path(import_module(f"handover.{part.parent.name}").__file__ or "") == part
    assert not [p for p in ROOT.glob("handover/*") if p.is_symlink()]
