"""A learned model of the VSL arm as text: JSON of a fixed form, checked when it is read."""

import json
import math
import textwrap
from pathlib import Path
from typing import Any, cast

import numpy as np

from handover.controllers.vsl.kinematics import Elbow, VslKinematics
from handover.controllers.vsl.learned_model import (
    DEGREE,
    FORWARD_INPUTS,
    INVERSE_INPUTS,
    VALUES,
    Cubic,
    VslModel,
    hull_directions,
)
from handover.cosim.blocks.ports import Floats

FORMAT, VERSION = "handover-vsl-model", 1

ANY = -1
"""A number of entries that is not checked."""

_WIDTH = 115

_MAX_DEPTH = 3
"""Depth to which nested lists are checked; a matrix has two levels."""


class InvalidModel(ValueError):
    """Text that is no model of this version; `source` says where it came from, `fault` what is wrong."""

    is_refusal = True

    def __init__(self, source: str, fault: str) -> None:
        super().__init__(f"model {source}: {fault}; `handover vsl-train` makes one")
        self.source, self.fault = source, fault


def model_text(model: VslModel) -> str:
    """Return a model as JSON in lines of less than 120 characters, ending in a newline."""
    k = model.kinematics
    content = {
        "format": FORMAT,
        "version": VERSION,
        "provenance": model.provenance,
        "links": {"L_1": k.L_1, "L_2": k.L_2, "L_3": k.L_3, "elbow": k.elbow.name},
        "inverse": {"inputs": list(INVERSE_INPUTS), **_plain(model.inverse)},
        "forward": {"inputs": list(FORWARD_INPUTS), **_plain(model.forward)},
    }
    return _json(content, "") + "\n"


def read_model(path: Path) -> VslModel:
    """Read a model from a file.

    Raises:
        InvalidModel: there is no such file, or it is not a model.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as e:
        raise InvalidModel(str(path), f"it cannot be read: {e}") from e
    return parse_model(text, str(path))


def parse_model(text: str, source: str) -> VslModel:
    """Return the model that `model_text` wrote.

    Raises:
        InvalidModel: it is not JSON, of another format or version, lacks something, or has a part of a wrong kind.
    """
    try:
        content: object = json.loads(text)
    except (ValueError, RecursionError) as e:
        raise InvalidModel(source, f"it is not JSON: {e}") from e
    reader = _Reader(source)
    whole = reader.table(content, "the file")
    if whole.get("format") != FORMAT:
        raise InvalidModel(source, f"its format is {whole.get('format')!r}, not {FORMAT!r}")
    if whole.get("version") != VERSION:
        raise InvalidModel(source, f"its version is {whole.get('version')!r}; this program reads version {VERSION}")
    links = reader.table(reader.entry(whole, "links"), "links")
    L_1, L_2, L_3 = (reader.numbers(links, "links", name, ()).item() for name in ("L_1", "L_2", "L_3"))
    elbow = reader.entry(links, "elbow", "links")
    if elbow not in ("UP", "DOWN"):
        raise InvalidModel(source, f"links.elbow is {elbow!r}, not 'UP' or 'DOWN'")
    if min(L_2, L_3) <= 0.0:
        raise InvalidModel(source, "links.L_2 and links.L_3 must be above 0")
    return VslModel(
        inverse=reader.cubic(whole, "inverse", INVERSE_INPUTS),
        forward=reader.cubic(whole, "forward", FORWARD_INPUTS),
        kinematics=VslKinematics(L_1, L_2, L_3, Elbow[elbow]),
        provenance=reader.table(reader.entry(whole, "provenance"), "provenance"),
    )


class _Reader:
    """Takes a model's parts out of parsed JSON, and raises InvalidModel where one is wrong."""

    def __init__(self, source: str) -> None:
        self._source = source

    def table(self, value: object, name: str) -> dict[str, Any]:
        if not isinstance(value, dict):
            raise InvalidModel(self._source, f"{name} must be an object, not {type(value).__name__}")
        return cast("dict[str, Any]", value)

    def entry(self, table: dict[str, Any], key: str, of: str = "the file") -> Any:
        if key not in table:
            raise InvalidModel(self._source, f"{of} has no {key!r}")
        return table[key]

    def numbers(self, table: dict[str, Any], of: str, key: str, shape: tuple[int, ...]) -> Floats:
        """Return finite numbers of a shape, whose extents may be ANY."""
        value = self.entry(table, key, of)
        if not _all_numbers(value, _MAX_DEPTH):
            raise InvalidModel(self._source, f"{of}.{key} must be made of finite numbers")
        try:
            array = np.array(value, dtype=np.float64)
        except ValueError as e:
            raise InvalidModel(self._source, f"{of}.{key}: its rows differ in length") from e
        if array.ndim != len(shape) or any(w not in (ANY, n) for n, w in zip(array.shape, shape, strict=True)):
            wanted = ", ".join("any" if w == ANY else str(w) for w in shape)
            raise InvalidModel(self._source, f"{of}.{key} has the shape {list(array.shape)}, not [{wanted}]")
        return array

    def cubic(self, whole: dict[str, Any], name: str, inputs: tuple[str, ...]) -> Cubic:
        """Return one of the two learned residuals."""
        table = self.table(self.entry(whole, name), name)
        if (stated := self.entry(table, "inputs", name)) != list(inputs):
            raise InvalidModel(self._source, f"{name}.inputs are {stated}, not {list(inputs)}")
        n = len(inputs)
        powers = np.transpose(self.numbers(table, name, "powers", (n, ANY)))
        if np.any(powers != np.floor(powers)) or np.any(powers < 0.0) or np.any(np.sum(powers, axis=1) > DEGREE):
            fault = f"{name}.powers must be whole numbers from 0, {DEGREE} at most in a column"
            raise InvalidModel(self._source, fault)
        scale = self.numbers(table, name, "scale", (n,))
        if np.any(scale <= 0.0):
            raise InvalidModel(self._source, f"{name}.scale must be above 0")
        hull = self.numbers(table, name, "hull", (len(hull_directions(n)),))
        if np.any(hull[0 : 2 * n : 2] < -hull[1 : 2 * n : 2]):
            raise InvalidModel(self._source, f"{name}.hull is empty: an upper side lies below its lower one")
        coefficients = np.transpose(self.numbers(table, name, "coefficients", (VALUES, len(powers))))
        return Cubic(
            mean=self.numbers(table, name, "mean", (n,)),
            scale=scale,
            powers=powers.astype(np.int64),
            coefficients=np.ascontiguousarray(coefficients),  # as when it was fitted: sums round likewise
            hull=hull,
        )


def _all_numbers(value: object, depth: int) -> bool:
    if isinstance(value, list):
        return depth > 0 and all(_all_numbers(v, depth - 1) for v in cast("list[object]", value))
    return (
        isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) < 1e300 and math.isfinite(value)
    )


def _plain(cubic: Cubic) -> dict[str, Any]:
    """Return a cubic's numbers; powers have a row an input and coefficients a row a value, which makes few lines."""
    return {
        "mean": cubic.mean.tolist(),
        "scale": cubic.scale.tolist(),
        "powers": cubic.powers.T.tolist(),
        "coefficients": cubic.coefficients.T.tolist(),
        "hull": cubic.hull.tolist(),
    }


def _json(value: object, indent: str, taken: int = 0) -> str:
    """Return JSON that breaks objects and lists that do not fit a line; long lists of numbers fill their lines.

    Args:
        value: what JSON can hold.
        indent: of the line that it begins in.
        taken: characters that the line has already.
    """
    flat = json.dumps(value, allow_nan=False)
    if taken + len(flat) < _WIDTH or not isinstance(value, (dict, list)):
        return flat
    inner = indent + " "
    if isinstance(value, dict):
        members = cast("dict[str, object]", value)
        keys = [f"{inner}{json.dumps(k)}: " for k in members]
        parts = [key + _json(v, inner, len(key)) for key, v in zip(keys, members.values(), strict=True)]
        return "{\n" + ",\n".join(parts) + f"\n{indent}}}"
    elements = cast("list[object]", value)
    if all(isinstance(v, (int, float)) for v in elements):
        return textwrap.fill(
            flat, _WIDTH, initial_indent=" " * taken, subsequent_indent=inner, break_long_words=False
        ).lstrip()
    return "[\n" + ",\n".join(inner + _json(v, inner, len(inner)) for v in elements) + f"\n{indent}]"
