"""The page of all units, by robot: icon, name, summary, parameters and ports; it opens offline."""

from collections.abc import Sequence
from pathlib import Path

from markupsafe import Markup

from handover.cosim.blocks.declarations import DeclarationError
from handover.cosim.blocks.description import Description, describe
from handover.cosim.exceptions import counted
from handover.fmus.catalog import UNITS, Entry, UnknownBlock, find_unit, import_class, installed_units
from handover.fmus.contents.documentation import seconds
from handover.fmus.contents.icons import InvalidIcon, block_icon
from handover.scenarios.catalog import SYSTEMS
from handover.scenarios.cli.summaries.port_tables import port_rows
from handover.scenarios.runs.reporting.html import picture_source, rows_table
from handover.scenarios.runs.reporting.page import Section, template, write_page

_COLUMNS = ("name", "type", "start", "range", "description")


def write_units_page(path: Path) -> None:
    """Write the page of the catalog's units and of those of other packages.

    A unit whose class cannot be loaded is there with the reason in the place of its ports.

    Raises:
        RecordNotWritten: it cannot be written.
    """
    groups = [(system.package, system.title, system.units) for system in SYSTEMS]
    listed = {name for _, _, names in groups for name in names}
    groups.append(("others", "Other units", tuple(name for name in UNITS if name not in listed)))
    groups.append(("installed", "Of other packages", tuple(installed_units())))
    sections = [_section(anchor, title, names) for anchor, title, names in groups if names]
    number = sum(len(names) for _, _, names in groups)
    header = Markup(
        "<p>{} units. <code>handover build NAME</code> makes the FMUs of one, which have its icon, too.</p>"
    ).format(number)
    write_page(path, "Units", header, sections)


def _section(anchor: str, title: str, names: Sequence[str]) -> Section:
    return Section(anchor=anchor, title=title, html=Markup("\n").join(_unit(name) for name in names))


def _unit(name: str) -> Markup:
    """Return a unit's part of the page."""
    try:
        entry = find_unit(name)
        description = describe(import_class(entry.block))
        icon = block_icon(entry)
    except (UnknownBlock, DeclarationError, InvalidIcon) as e:
        return _html(name, fault=str(e))
    mime, content = icon.best
    return _html(name, entry, description, picture_source(content, mime))


def _html(
    name: str, entry: Entry | None = None, description: Description | None = None, picture: str = "", fault: str = ""
) -> Markup:
    groups = () if description is None else _tables(description)
    return Markup(
        template("unit.html").render(
            name=name,
            summary=entry.summary if entry else "",
            step=seconds(entry.step) if entry else "",
            sampled=description is not None and description.period is not None,
            picture=picture,
            contents=", ".join(count for count, _ in groups),
            tables=[table for _, table in groups],
            fault=fault,
        )
    )


def _tables(d: Description) -> Sequence[tuple[str, Markup]]:
    """Return how many there are, and the table, of each kind of variable that there is."""
    found: list[tuple[str, Markup]] = []
    for title, variables in (("input", d.inputs), ("output", d.outputs), ("parameter", d.parameters)):
        rows = port_rows(variables)
        shown = [k for k in range(len(_COLUMNS)) if any(row[k] for row in rows)]
        if rows:
            cells = [[row[k] for k in shown] for row in rows]
            table = rows_table([_COLUMNS[k] for k in shown], cells, caption=f"{title}s".capitalize(), cards=True)
            found.append((counted(len(rows), title), table))
    return found
