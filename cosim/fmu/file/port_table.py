"""What an FMU declares, as tables in HTML: its parameters, inputs and outputs with kinds, units, ranges and starts."""

import html
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

from handover.cosim.blocks.start_values import range_of

if TYPE_CHECKING:
    from handover.cosim.fmu.file.description import FmuDescription, FmuPort

_COLUMNS = ("name", "type", "unit", "range", "start", "description")
_MAX_START = 40
"""Letters of a start value."""


def description_html(d: "FmuDescription") -> str:
    """Return an FMU's name and standard, and a table of its ports; what has none of a kind has no table of it."""
    step = "" if d.step is None else f", a step of {d.step:g} s"
    sampled = ", sampled" if d.sampled else ""
    parts = [f"<p><b>{html.escape(d.name)}</b>: FMI {d.fmi}{step}{sampled}</p>"]
    for title, ports in (("Inputs", d.inputs), ("Outputs", d.outputs), ("Parameters", d.parameters)):
        if ports:
            parts.append(_table(title, ports))
    return f"<div>{''.join(parts)}</div>"


def _table(title: str, ports: "Mapping[str, FmuPort]") -> str:
    rows = "".join(_row("td", _cells(port)) for port in ports.values())
    caption = f"<caption style='text-align: left'><b>{title}</b></caption>"
    return f"<table>{caption}<thead>{_row('th', _COLUMNS)}</thead><tbody>{rows}</tbody></table>"


def _row(kind: str, cells: Iterable[str]) -> str:
    texts = (f"<{kind} style='text-align: left'>{html.escape(cell)}</{kind}>" for cell in cells)
    return f"<tr>{''.join(texts)}</tr>"


def _cells(port: "FmuPort") -> tuple[str, ...]:
    shape = f" [{','.join(map(str, port.shape))}]" if port.shape else ""
    items = ", ".join(name.lower() for name, _ in port.items)
    start = {str(value): name.lower() for name, value in port.items}.get(port.start or "", port.start or "")
    start = f"{start[:_MAX_START]}…" if len(start) > _MAX_START else start
    tunable = ", tunable" if port.tunable else ""
    symbol = port.unit.shown
    return port.name, f"{port.kind.value}{shape}{tunable}", symbol, items or range_of(port), start, port.description
