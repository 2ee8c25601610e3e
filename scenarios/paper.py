"""Reads a scenario's `paper.toml`: every value with its unit, its place in the paper, and its status."""

import functools
from importlib import resources
from typing import Any

import tomli


def paper_values(scenario: str, group: str) -> dict[str, Any]:
    """Return the values of one group of a scenario's `paper.toml` by name."""
    return {name: entry["value"] for name, entry in _read(scenario)[group].items()}


def paper_entry(scenario: str, group: str, name: str) -> dict[str, Any]:
    """Return a value of a scenario's `paper.toml` with its unit, its place in the paper (`where`) and its status.

    Raises:
        KeyError: there is none of that name.
    """
    return dict(_read(scenario)[group][name])


@functools.lru_cache
def _read(scenario: str) -> dict[str, Any]:
    return tomli.loads(
        resources.files(f"handover.scenarios.{scenario}").joinpath("paper.toml").read_text(encoding="utf-8")
    )
