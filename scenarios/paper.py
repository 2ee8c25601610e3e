"""Reads a scenario's `paper.toml`: every value with its unit, its place in the paper, and its status."""

from importlib import resources
from typing import Any

import tomli


def paper_values(scenario: str, group: str) -> dict[str, Any]:
    """Return the values of one group of a scenario's `paper.toml` by name."""
    text = resources.files(f"scenarios.{scenario}").joinpath("paper.toml").read_text(encoding="utf-8")
    return {name: entry["value"] for name, entry in tomli.loads(text)[group].items()}
