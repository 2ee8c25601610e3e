"""documentation/index.html of an FMU: what the block declares, as a page."""

from dataclasses import dataclass
from pathlib import Path

import jinja2
import numpy as np

from cosim.variable import Kind, Variable
from fmus.model_description import Model
from fmus.sources import Package


@dataclass(frozen=True)
class Row:
    """A variable's line in a table."""

    name: str
    kind: str
    shape: str
    unit: str
    start: str
    range: str
    description: str


def page(model: Model, packages: list[Package]) -> bytes:
    """Return the page as HTML."""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        trim_blocks=True,
        undefined=jinja2.StrictUndefined,
        keep_trailing_newline=True,
    )
    d = model.description
    groups = [
        (title, [_row(v) for v in variables])
        for title, variables in (("Parameters", d.parameters), ("Inputs", d.inputs), ("Outputs", d.outputs))
    ]
    return environment.get_template("unit.html").render(model=model, groups=groups, packages=packages).encode()


def _row(v: Variable) -> Row:
    return Row(
        name=v.name,
        kind=v.raster.mime if v.raster else v.enumeration.__name__ if v.enumeration else v.type_name,
        shape=" × ".join(map(str, v.shape)),
        unit=v.unit.symbol if v.kind is Kind.REAL else "",
        start="" if v.causality.value == "output" or v.kind is Kind.BINARY else _start(v),
        range=_range(v),
        description=v.description,
    )


def _start(v: Variable) -> str:
    if v.shape:
        values = np.ravel(v.start)
        return f"{values[0]:.6g} …" if values.size > 9 else ", ".join(f"{value:.6g}" for value in values)
    return v.start.name if v.enumeration else f"{v.start:.6g}" if v.kind is Kind.REAL else str(v.start)


def _range(v: Variable) -> str:
    if v.minimum is None and v.maximum is None:
        return ""
    low, high = ("" if bound is None else f"{bound:.6g}" for bound in (v.minimum, v.maximum))
    return f"{low or '−∞'} … {high or '∞'}"
