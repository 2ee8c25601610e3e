"""Equations of units' docstrings in LaTeX, from `equations.toml`, and as MathML, which browsers show by themselves."""

import functools
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import tomli

_FILE = Path(__file__).with_suffix(".toml")


class EquationGone(ValueError):
    """A docstring lacks an equation for which there is LaTeX."""


def with_latex(unit: str, doc: str) -> str:
    """Return a unit's docstring with its equations in LaTeX, between dollar signs.

    Raises:
        EquationGone: the docstring has another equation in the place of one.
    """
    for plain, latex in _equations().get(unit, {}).items():
        pattern = r"\s+".join(map(re.escape, plain.split()))
        sign = "$$" if plain.startswith(" ") else "$"
        doc, n = re.subn(rf"(?<![\w$]){pattern}(?!\w)", lambda _, text=f"{sign}{latex}{sign}": text, doc)
        if not n:
            raise EquationGone(f"the docstring of {unit} no longer has {plain.strip()!r}: see {_FILE.name}")
    return doc


@functools.cache
def _equations() -> Mapping[str, Mapping[str, str]]:
    return tomli.loads(_FILE.read_text(encoding="utf-8"))


def show_inline(translator: Any, node: Any) -> None:
    """Write an equation within a line as MathML, in place of Sphinx's visitor."""
    _write(translator, node, "inline")


def show_block(translator: Any, node: Any) -> None:
    """Write an equation of its own as MathML, in place of Sphinx's visitor."""
    _write(translator, node, "block")


def _write(translator: Any, node: Any, display: str) -> None:
    from docutils.nodes import SkipNode
    from latex2mathml.converter import convert

    equation = convert(node.astext(), display=display)
    translator.body.append(f'<div class="equation">{equation}</div>' if display == "block" else equation)
    raise SkipNode
