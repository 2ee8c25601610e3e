"""What the project's tools look at: a folder that they leave out would be checked by nobody."""

from pathlib import Path
from typing import Any

import tomli

ROOT = Path(__file__).parents[1]


def test_types_are_checked_in_every_folder():
    """Links are followed only where the settings name them."""
    settings: dict[str, Any] = tomli.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    included = set(settings["tool"]["pyrefly"]["project-includes"])
    links = {f"handover/{p.name}" for p in (ROOT / "handover").iterdir() if p.is_dir() and p.name != "__pycache__"}
    assert links
    assert {"handover", "tests", *links} <= included
