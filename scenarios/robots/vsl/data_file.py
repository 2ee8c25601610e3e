"""Measured points of the VSL arm as a Parquet file: matrix D of [Gandarias2020] eq. (9), and where it comes from."""

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, cast

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from handover.controllers.vsl.kinematics import VslKinematics
from handover.cosim.files import reading_fault
from handover.cosim.record.reader import InvalidRecord, read_parquet
from handover.plants.vsl.parameters import MAX_ANGLE, MAX_PRESSURE
from handover.plants.vsl.parameters import Params as ArmParams
from handover.scenarios.robots.vsl.training_data import Dataset, Measured

VERSION = 1

_METADATA = b"handover-vsl-data"
"""Key of the file's metadata that says, as JSON, which arm was measured and how."""

_COLUMNS: Mapping[str, tuple[str, int]] = {
    "p_WG": ("p_WG_meas", 3),
    "p": ("p_meas", 2),
    "i": ("i_meas", 3),
    "q": ("q_meas", 3),
    "q_cmd": ("q_cmd", 3),
}
"""By the matrix's parts: the arm's port, of which each entry is a column, in SI units; in the order of eq. (9)."""

_PLAUSIBLE: Mapping[str, tuple[float, float, str]] = {
    "p": (1e3, 1.02 * MAX_PRESSURE, "Pa above the air outside (1e5 are a bar)"),
    "q": (1e-3, MAX_ANGLE, "rad"),
    "q_cmd": (1e-3, MAX_ANGLE, "rad"),
}
"""By the matrix's parts: between what its largest magnitude lies on any arm of this size, and the unit (assumed)."""

_MAX_TORQUE = 30.0
"""By currents, N m (assumed: the weakest arm's are below 2; in milliamperes they would be above 1000)."""

_MAX_SHARE_OF_CHANCE = 0.9
"""How far rigid links' tips are at most from the measured, in the median, as a share of how far they are from other
points' (assumed: 0.1 of the arm as it is, 0.8 of one with a tenth of the stiffness)."""

_ORDER = "order"

_NAMED = 4
"""Parameters that are named where an arm has others."""


class InvalidData(ValueError):
    """A file of which no model can be trained; `path` is the file, `fault` says why."""

    def __init__(self, path: Path, fault: str) -> None:
        super().__init__(f"data {path}: {fault}; `handover vsl-train --save-data FILE` makes one")
        self.path, self.fault = path, fault


def write_data(path: Path, measured: Measured) -> None:
    """Write points to a file.

    Raises:
        OSError: it cannot be written.
    """
    columns: dict[str, Any] = {
        name: values for part, (port, _) in _COLUMNS.items() for name, values in _entries(measured, part, port)
    }
    table: Any = pa.Table.from_pydict({**columns, _ORDER: measured.order})
    metadata = {_METADATA: json.dumps({"version": VERSION, **measured.origin}, sort_keys=True).encode()}
    pq.write_table(table.replace_schema_metadata(metadata), path)


def read_data(path: Path, kinematics: VslKinematics, parameters: Mapping[str, Any] | None = None) -> Measured:
    """Read points of an arm.

    Args:
        path: Parquet file.
        kinematics: of rigid links, by which the arm was commanded.
        parameters: of the arm, as plain data; None: of any.

    Raises:
        InvalidData: it cannot be read, is no Parquet file, lacks columns, has numbers that are not finite or, by their
            size, not in SI units, or is of an arm with other parameters or links.
    """
    try:
        table: Any = read_parquet(path)
    except OSError as e:
        raise InvalidData(path, reading_fault(e)) from e
    except InvalidRecord as e:
        raise InvalidData(path, f"it is not a Parquet file that can be read: {e.fault}") from e
    wanted = [*(f"{port}[{k + 1}]" for port, n in _COLUMNS.values() for k in range(n)), _ORDER]
    if missing := [name for name in wanted if name not in table.column_names]:
        raise InvalidData(path, f"it lacks the columns {', '.join(missing)}")
    origin = _origin(path, table.schema.metadata or {})
    _check_links(path, origin, kinematics)
    if parameters is not None:
        _check_parameters(path, origin["arm"], parameters)
    numbers = {name: _numbers(path, table, name) for name in wanted}
    parts = {
        part: np.column_stack([numbers[f"{port}[{k + 1}]"] for k in range(n)]) for part, (port, n) in _COLUMNS.items()
    }
    points, order = Dataset(**parts), _order(path, numbers[_ORDER])
    arm: object = origin["arm"].get("parameters")
    known = cast("dict[str, Any]", arm) if isinstance(arm, dict) else {}
    _check_units(path, points.rows(order >= 0), kinematics, known)
    return Measured(points, order, origin)


def _entries(measured: Measured, part: str, port: str) -> list[tuple[str, Any]]:
    values = getattr(measured.points, part)
    return [(f"{port}[{k + 1}]", np.ascontiguousarray(values[:, k])) for k in range(values.shape[1])]


def _origin(path: Path, metadata: Mapping[bytes, bytes]) -> dict[str, Any]:
    """Return what the file says of its arm."""
    if _METADATA not in metadata:
        raise InvalidData(path, f"it does not say of which arm it is: no metadata {_METADATA.decode()!r}")
    try:
        origin: object = json.loads(metadata[_METADATA])
    except ValueError as e:
        raise InvalidData(path, f"its metadata {_METADATA.decode()!r} is not JSON: {e}") from e
    content = cast("dict[str, Any]", origin) if isinstance(origin, dict) else {}
    if content.pop("version", None) != VERSION:
        raise InvalidData(path, f"its metadata {_METADATA.decode()!r} is not of version {VERSION}")
    arm, links = content.get("arm"), content.get("links")
    if not isinstance(arm, dict) or not isinstance(links, dict) or "seed" not in content or "walk" not in content:
        raise InvalidData(path, f"its metadata {_METADATA.decode()!r} lacks arm, links, seed or walk")
    if type(content["seed"]) is not int or content["seed"] < 0 or type(content["walk"]) is not bool:
        raise InvalidData(path, f"its metadata {_METADATA.decode()!r} has a seed or walk of a wrong kind")
    return content


def _check_links(path: Path, origin: Mapping[str, Any], kinematics: VslKinematics) -> None:
    links = links_of(kinematics)
    if dict(origin["links"]) != links:
        raise InvalidData(path, f"it was measured with links of {_text(origin['links'])}, not {_text(links)}")


def _check_parameters(path: Path, arm: Mapping[str, Any], parameters: Mapping[str, Any]) -> None:
    """Refuse points of an arm whose parameters are others; its noise may be drawn from any seed."""
    stated: object = arm.get("parameters")
    if not isinstance(stated, dict):
        raise InvalidData(path, f"its metadata {_METADATA.decode()!r} lacks the arm's parameters")
    found = cast("dict[str, Any]", stated)
    others = [n for n in sorted({*found, *parameters} - {"seed"}) if found.get(n) != parameters.get(n)]
    if others:
        differing = ", ".join(f"{n} = {found.get(n)}, not {parameters.get(n)}" for n in others[:_NAMED])
        differing += f" and {len(others) - _NAMED} more" if len(others) > _NAMED else ""
        raise InvalidData(
            path,
            f"it was measured on an arm with {differing}: --arm NAME=VALUE says which arm is meant, --adapt learns"
            " what makes it differ",
        )


def _check_units(path: Path, points: Dataset, kinematics: VslKinematics, arm: Mapping[str, Any]) -> None:
    """Refuse points that are in other units, as degrees, bar or millimetres: no arm is like that."""
    if not len(points):
        return
    for part, (least, most, unit) in _PLAUSIBLE.items():
        port, largest = _COLUMNS[part][0], float(np.max(np.abs(getattr(points, part))))
        if 0.0 < largest < least or largest > most:
            raise InvalidData(path, f"its {port}, up to {largest:.4g}, cannot be in {unit}; columns are in SI units")
    kt = arm.get("kt", ArmParams().kt)
    if (largest := float(np.max(np.abs(points.i)))) * kt > _MAX_TORQUE:
        raise InvalidData(path, f"its i_meas, up to {largest:.4g}, cannot be in A; columns are in SI units")
    rigid = np.array([kinematics.forward(q) for q in points.q])
    off, chance = (
        float(np.median(np.linalg.norm(rigid - tips, axis=1)))
        for tips in (points.p_WG, np.roll(points.p_WG, len(points) // 2, axis=0))
    )
    if off > _MAX_SHARE_OF_CHANCE * chance:
        raise InvalidData(
            path,
            f"its p_WG_meas is {off:.3g} m from where rigid links have the tip by q_meas, in the median: one of them "
            "is not in m, rad and the world's frame, or they are not of the same points",
        )


def _text(links: Mapping[str, Any]) -> str:
    return ", ".join(f"{name} {value}" for name, value in links.items())


def links_of(kinematics: VslKinematics) -> dict[str, Any]:
    """Return lengths and elbow as plain data."""
    k = kinematics
    return {"L_1": k.L_1, "L_2": k.L_2, "L_3": k.L_3, "elbow": k.elbow.name}


def _numbers(path: Path, table: Any, name: str) -> Any:
    column = table.column(name)
    if not (pa.types.is_floating(column.type) or pa.types.is_integer(column.type)):
        raise InvalidData(path, f"its column {name} holds {column.type}, not numbers")
    if column.null_count:
        raise InvalidData(path, f"its column {name} has {column.null_count} rows without a value")
    values = np.asarray(column.to_numpy(), dtype=np.float64)
    bad = np.flatnonzero(~np.isfinite(values))
    if len(bad):
        raise InvalidData(path, f"its column {name} is not finite in {len(bad)} rows, row {bad[0] + 1} first")
    return values


def _order(path: Path, values: Any) -> Any:
    """Return the places in the split: -1, or each number from 0 once."""
    places = np.sort(values[values != -1.0])
    if not np.array_equal(places, np.arange(len(places))) or math.isnan(float(np.sum(places))):
        raise InvalidData(
            path, f"its column {_ORDER} must count the usable rows from 0, in any order, -1 for the others"
        )
    return values.astype(np.int64)
