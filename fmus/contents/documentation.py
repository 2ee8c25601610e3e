"""documentation/index.html of an FMU: a page of the block's declarations and docstring, with the papers that it cites.

A docstring's parts are paragraphs, lists (lines that begin with `- `), formulas (indented lines) and the errors of its
section `Raises:`. `[key]` cites a paper. The page's template is unit.html.
"""

import enum
import re
from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

import numpy as np
from markupsafe import Markup, escape

from handover.cosim.blocks.variable import Causality, Kind, Variable
from handover.fmus.contents.model_description import Model, enumerations
from handover.fmus.layout import SAMPLE_CLOCK, Form
from handover.fmus.sources import Package

PAPERS = {
    "Fernandes2020": 'Fernandes, "Object handover between humans and robots in microgravity", MSc thesis, '
    "Instituto Superior Tecnico, Lisbon 2020",
    "Gandarias2020": 'Gandarias et al., "Open-loop position control in collaborative, modular '
    'Variable-Stiffness-Link (VSL) robots", IEEE Robotics and Automation Letters 2020',
    "Luberto": 'Luberto et al., "Enhancing adaptive grasp planning through a simple sensor-based reflex mechanism"',
    "Vervloet2025": 'Vervloet, "A first step to visual servoing based autonomous handovers with soft robots", '
    "TU Delft 2025",
}
"""The papers that blocks follow, by the keys with which docstrings cite them."""


def cited(text: str) -> dict[str, str]:
    """Return the papers that a text cites as `[key]`."""
    return {key: paper for key, paper in PAPERS.items() if f"[{key}]" in text}


_FORMS = {
    Form.FMI2: "FMI 2.0 for co-simulation",
    Form.FMI3: "FMI 3.0 for co-simulation",
    Form.FMI3_SCALAR: "FMI 3.0 for co-simulation, without arrays",
}
_GROUPS = (("Parameters", Causality.PARAMETER), ("Inputs", Causality.INPUT), ("Outputs", Causality.OUTPUT))


@dataclass(frozen=True)
class Row:
    """A variable's row in a table."""

    name: str
    kind: str
    shape: str
    unit: str
    start: str
    range: str
    description: str


def page(model: Model, packages: list[Package], platform: str = "") -> bytes:
    """Return the page as HTML; `platform` is the one for which the unit brings its interpreter, if it does."""
    import jinja2  # slow to load, and most FMUs are found in the cache

    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        trim_blocks=True,
        undefined=jinja2.StrictUndefined,
        keep_trailing_newline=True,
    )
    environment.filters.update(seconds=seconds, prose=_prose)
    shown = {v.variable.name: v.variable for v in model.layout.shown(model.form)}
    groups = [
        (title, [row(v, model.form) for v in shown.values() if v.causality is causality])
        for title, causality in _GROUPS
    ]
    d = model.description
    return (
        environment.get_template("unit.html")
        .render(
            model=model,
            platform=platform,
            form=_FORMS[model.form],
            clock=SAMPLE_CLOCK if model.layout.has_clock(model.form) else "",
            origin=d.module_doc.partition("\n\n")[0],
            doc=parse(d.doc),
            papers=cited("\n".join((d.module_doc, d.doc, *(v.description for v in d.variables)))),
            groups=groups,
            enumerations=[(e.__name__, items(e)) for e in enumerations(d.variables)],
            packages=packages,
        )
        .encode()
    )


def seconds(time: Fraction) -> str:
    """Return a time as a decimal number if that is exact, as in `0.016 s`, else as a fraction, as in `1/30 s`."""
    decimal = repr(float(time))
    return f"{decimal.removesuffix('.0') if Fraction(decimal) == time else time} s"


def _prose(text: str) -> Markup:
    """Return a docstring's text as HTML, with what is between backquotes as code."""
    return Markup(re.sub(r"`([^`]+)`", r"<code>\1</code>", str(escape(text))))


def row(v: Variable, form: Form) -> Row:
    """Return a variable's row in a table."""
    return Row(
        name=v.name,
        kind=_type(v, form),
        shape=" × ".join(map(str, v.shape)),
        unit=v.unit.symbol if v.kind is Kind.REAL else "",
        start="" if v.causality is Causality.OUTPUT or v.kind is Kind.BINARY else _start(v),
        range=_range(v),
        description=v.description,
    )


def _type(v: Variable, form: Form) -> str:
    """Return a type as in the model description; an enumeration's name; for a picture its MIME type as well."""
    if v.enumeration:
        return v.enumeration.__name__
    if form is Form.FMI2 or v.width is None:
        return v.kind.value.capitalize() + (f", {v.raster.mime}" if v.raster else "")
    return v.width.value


def _start(v: Variable) -> str:
    if v.shape:
        rows = np.atleast_2d(v.start)
        if rows.size > 9:
            return f"all {rows.flat[0]:.6g}" if np.all(rows == rows.flat[0]) else f"{rows.size} values"
        if len(rows) > 1 and rows.shape[0] == rows.shape[1] and np.array_equal(rows, np.diag(np.diag(rows))):
            return f"diag({', '.join(f'{value:.6g}' for value in np.diag(rows))})"
        return "; ".join(", ".join(f"{value:.6g}" for value in row) for row in rows)
    return v.start.name if v.enumeration is not None else f"{v.start:.6g}" if v.kind is Kind.REAL else str(v.start)


def _range(v: Variable) -> str:
    if v.minimum is None and v.maximum is None:
        return ""
    low, high = ("" if bound is None else f"{bound:.6g}" for bound in (v.minimum, v.maximum))
    return f"{low or '−∞'} … {high or '∞'}"


def items(enumeration: Iterable[enum.IntEnum]) -> str:
    """Return an enumeration's items with their numbers."""
    return ", ".join(f"{int(item)} {item.name}" for item in enumeration)


_RAISES = "Raises:"
_NAMES = re.compile(r"(\w+(?:, \w+)*): (.*)", re.DOTALL)


@dataclass(frozen=True)
class Part:
    """A part of a docstring.

    Attributes:
        kind: `paragraph`, `list` or `formula`.
        texts: one text, or one for each item of a list; a formula's keeps its lines.
    """

    kind: str
    texts: tuple[str, ...]


@dataclass(frozen=True)
class Docstring:
    """A docstring's parts, and the errors of its section `Raises:` as pairs of names and of when they are raised."""

    parts: tuple[Part, ...]
    errors: tuple[tuple[str, str], ...]


def parse(text: str) -> Docstring:
    """Return a docstring's parts; `text` must be without the indentation of its source."""
    parts: list[Part] = []
    errors: list[tuple[str, str]] = []
    for chunk in re.split(r"\n[ \t]*\n", text.strip("\n")):
        lines = chunk.splitlines()
        if lines and lines[0].strip() == _RAISES:
            errors += [_error(item) for item in _markdown_items(lines[1:], r"    \S")]
        elif chunk.startswith("    "):
            parts.append(Part("formula", ("\n".join(line.removeprefix("    ") for line in lines),)))
        elif chunk.strip():
            parts += _markdown_prose(lines)
    return Docstring(tuple(parts), tuple(errors))


def _markdown_prose(lines: list[str]) -> list[Part]:
    """Return a paragraph, a list, or both if text is followed by a list."""
    first = next((i for i, line in enumerate(lines) if line.startswith("- ")), len(lines))
    paragraph = [Part("paragraph", (_joined(lines[:first]),))] if first else []
    items = tuple(item.removeprefix("- ") for item in _markdown_items(lines[first:], "- "))
    return [*paragraph, Part("list", items)] if items else paragraph


def _markdown_items(lines: list[str], begin: str) -> list[str]:
    """Return the items of lines, each as one line; an item begins at a line that matches `begin`."""
    items: list[list[str]] = []
    for line in lines:
        if re.match(begin, line) or not items:
            items.append([])
        items[-1].append(line)
    return [_joined(item) for item in items]


def _joined(lines: list[str]) -> str:
    return " ".join(line.strip() for line in lines)


def _error(text: str) -> tuple[str, str]:
    match = _NAMES.fullmatch(text)
    return (match[1], match[2]) if match else ("", text)
