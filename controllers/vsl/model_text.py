"""A learned model of the VSL arm as text: JSON of a fixed form, checked when it is read."""

import base64
import binascii
import hashlib
import itertools
import json
import math
import textwrap
from pathlib import Path
from typing import Any, cast

import numpy as np

from handover.controllers.vsl.beam import Beam, BentCommand, BentTip, Stiffness, Weights
from handover.controllers.vsl.kinematics import Elbow, VslKinematics
from handover.controllers.vsl.learned_model import (
    DEGREE,
    FORWARD_INPUTS,
    FORWARD_INPUTS_X,
    INVERSE_INPUTS,
    NOMINAL_INPUTS,
    VALUES,
    Adapted,
    Cubic,
    Domain,
    ForwardInput,
    Learned,
    Regressor,
    VslModel,
    hull_directions,
)
from handover.controllers.vsl.network import ACTIVATIONS, LAYERS, Activation, Network
from handover.cosim.blocks.ports import Floats
from handover.cosim.files import read_regular, reading_fault

FORMAT, VERSION = "handover-vsl-model", 2

ANY = -1
"""A number of entries that is not checked."""

_FORWARD_INPUTS = {ForwardInput.Q: FORWARD_INPUTS, ForwardInput.X: FORWARD_INPUTS_X}

_STORED = np.dtype("<f4")
"""Of a network's weights in a file, and what they are rounded to when they are trained."""

_PRECISIONS = ("float32", "float64")
"""In which a network is evaluated."""

_WIDTH = 115

_MAX_DEPTH = 3
"""Depth to which nested lists are checked; a matrix has two levels."""


class InvalidModel(ValueError):
    """Text that is not a model of this version.

    `source` says where it came from, `fault` what is wrong, and `remedy` what makes one that is.
    """

    is_refusal = True

    def __init__(self, source: str, fault: str, remedy: str = "handover vsl-train") -> None:
        super().__init__(f"model {source}: {fault}; `{remedy}` makes one")
        self.source, self.fault = source, fault


def model_text(model: VslModel) -> str:
    """Return a model as JSON in lines of less than 120 characters, ending in a newline, with a digest of all of it.

    Weights of networks are their bytes in base64: 1.6 million numbers as text would be read for seconds.
    """
    k = model.kinematics
    content = {
        "format": FORMAT,
        "version": VERSION,
        "kind": model.kind.name.lower(),
        "provenance": model.provenance,
        "links": {"L_1": k.L_1, "L_2": k.L_2, "L_3": k.L_3, "elbow": k.elbow.name},
        "friction": list(model.friction),
        **({"nominal": {"inputs": list(NOMINAL_INPUTS), **_plain(model.nominal)}} if model.nominal else {}),
        "inverse": {"inputs": list(INVERSE_INPUTS), **_plain(model.inverse)},
        "forward": {"inputs": list(_FORWARD_INPUTS[model.forward_input]), **_plain(model.forward)},
    }
    return _json({**content, "sha256": _digest(content)}, "") + "\n"


def read_model(path: Path) -> VslModel:
    """Read a model from a file.

    Raises:
        InvalidModel: there is no such file, or it is not a model.
    """
    try:
        text = read_regular(path).decode()
    except OSError as e:
        raise InvalidModel(str(path), reading_fault(e)) from e
    except UnicodeDecodeError as e:
        raise InvalidModel(str(path), f"it cannot be read: {e}") from e
    return parse_model(text, str(path))


def parse_model(text: str, source: str) -> VslModel:
    """Return the model that `model_text` wrote.

    Raises:
        InvalidModel: it is not JSON, of another format or version, lacks something, has a part of a wrong kind, or is
            not what its digest was made of.
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
    kinematics = VslKinematics(L_1, L_2, L_3, Elbow[elbow])
    kind = reader.kind(whole)
    forward_input = reader.forward_input(whole)
    forward_inputs = _FORWARD_INPUTS[forward_input]
    model = VslModel(
        inverse=reader.regressor(whole, "inverse", INVERSE_INPUTS, kind, kinematics),
        forward=reader.regressor(whole, "forward", forward_inputs, kind, kinematics),
        kinematics=kinematics,
        provenance=reader.table(reader.entry(whole, "provenance"), "provenance"),
        kind=kind,
        forward_input=forward_input,
        friction=reader.friction(whole),
        nominal=reader.nominal(whole),
    )
    stated = reader.entry(whole, "sha256")
    if stated != _digest({name: part for name, part in whole.items() if name != "sha256"}):
        raise InvalidModel(source, "it is damaged, or was changed by hand: its sha256 is not that of its content")
    return model


def _digest(content: dict[str, Any]) -> str:
    """Return a hash of what JSON holds, whatever its order and spaces."""
    return hashlib.sha256(json.dumps(content, sort_keys=True, separators=(",", ":")).encode()).hexdigest()


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

    def kind(self, whole: dict[str, Any]) -> Learned:
        """Return what the model is."""
        kind = self.entry(whole, "kind")
        for known in Learned:
            if kind == known.name.lower():
                return known
        raise InvalidModel(
            self._source, f"its kind is {kind!r}, not one of {', '.join(known.name.lower() for known in Learned)}"
        )

    def forward_input(self, whole: dict[str, Any]) -> ForwardInput:
        """Return what eq. (10) takes: the one whose inputs are named."""
        table = self.table(self.entry(whole, "forward"), "forward")
        is_X = self.entry(table, "inputs", "forward") == list(FORWARD_INPUTS_X)
        return ForwardInput.X if is_X else ForwardInput.Q

    def friction(self, whole: dict[str, Any]) -> tuple[float, float]:
        """Return the currents by friction, A; 0 where they are not compensated."""
        first, second = self.numbers(whole, "the file", "friction", (2,)).tolist()
        return first, second

    def nominal(self, whole: dict[str, Any]) -> Cubic | None:
        """Return the nominal currents, which a model on currents with friction does not have."""
        if not any(self.friction(whole)):
            return None
        table = self._named(whole, "nominal", NOMINAL_INPUTS)
        return self._cubic(
            table, "nominal", self._domain(table, "nominal", len(NOMINAL_INPUTS)), len(NOMINAL_INPUTS) // 2
        )

    def _named(self, whole: dict[str, Any], name: str, inputs: tuple[str, ...]) -> dict[str, Any]:
        """Return a table of which the inputs are these."""
        table = self.table(self.entry(whole, name), name)
        if (stated := self.entry(table, "inputs", name)) != list(inputs):
            raise InvalidModel(self._source, f"{name}.inputs are {stated}, not {list(inputs)}")
        return table

    def regressor(
        self, whole: dict[str, Any], name: str, inputs: tuple[str, ...], kind: Learned, kinematics: VslKinematics
    ) -> Regressor:
        """Return what was learned for one of the two equations."""
        table = self._named(whole, name, inputs)
        domain = self._domain(table, name, len(inputs))
        if kind is Learned.CUBIC:
            regressor: Regressor = self._cubic(table, name, domain)
        elif kind is Learned.PHYSICS:
            regressor = self._bent(table, name, domain, kinematics)
        else:
            regressor = self._network(table, name, domain, kind)
        return self._adapted(table, name, regressor) if "adaptation" in table else regressor

    def _domain(self, table: dict[str, Any], name: str, n: int) -> Domain:
        scale = self.numbers(table, name, "scale", (n,))
        if np.any(scale <= 0.0):
            raise InvalidModel(self._source, f"{name}.scale must be above 0")
        hull = self.numbers(table, name, "hull", (len(hull_directions(n)),))
        if np.any(hull[0 : 2 * n : 2] < -hull[1 : 2 * n : 2]):
            raise InvalidModel(self._source, f"{name}.hull is empty: an upper side lies below its lower one")
        return Domain(self.numbers(table, name, "mean", (n,)), scale, hull)

    def _adapted(self, table: dict[str, Any], name: str, base: Regressor) -> Adapted:
        part = f"{name}.adaptation"
        adaptation = self.table(table["adaptation"], part)
        shapes = {"offset": (VALUES,), "weights": (VALUES, len(base.domain.mean)), "gain": (VALUES, VALUES)}
        return Adapted(base, *(self.numbers(adaptation, part, key, shape) for key, shape in shapes.items()))

    def _bent(
        self, table: dict[str, Any], name: str, domain: Domain, kinematics: VslKinematics
    ) -> BentTip | BentCommand:
        beam = self.table(self.entry(table, "beam", name), f"{name}.beam")
        stiffness = Stiffness(*(self._above_0(beam, f"{name}.beam", key) for key in Stiffness._fields))
        weights = Weights(*(self._above_0(beam, f"{name}.beam", key) for key in Weights._fields))
        if not 2.0 * weights.cap < min(kinematics.L_2, kinematics.L_3):
            raise InvalidModel(self._source, f"{name}.beam.cap: two caps leave nothing of a link that bends")
        bent = Beam(kinematics, stiffness, weights)
        if name == "forward":
            return BentTip(domain.mean, domain.scale, domain.hull, bent)
        droop = self.numbers(table, name, "droop", ()).item()
        return BentCommand(domain.mean, domain.scale, domain.hull, bent, droop)

    def _above_0(self, table: dict[str, Any], of: str, key: str) -> float:
        value = self.numbers(table, of, key, ()).item()
        if not value > 0.0:
            raise InvalidModel(self._source, f"{of}.{key} must be above 0")
        return value

    def _network(self, table: dict[str, Any], name: str, domain: Domain, kind: Learned) -> Network:
        layers = (len(domain.mean), *LAYERS[kind], VALUES)
        if (stated := self.entry(table, "neurons", name)) != list(LAYERS[kind]):
            raise InvalidModel(
                self._source, f"{name}.neurons are {stated}; a {kind.name.lower()} network has {list(LAYERS[kind])}"
            )
        if (activation := self.entry(table, "activation", name)) != ACTIVATIONS[kind].value:
            raise InvalidModel(self._source, f"{name}.activation is {activation!r}, not {ACTIVATIONS[kind].value!r}")
        precision = self.entry(table, "precision", name)
        if precision not in _PRECISIONS:
            raise InvalidModel(self._source, f"{name}.precision is {precision!r}, not one of {', '.join(_PRECISIONS)}")
        numbers = self._weights(table, name)
        shapes = [shape for n, m in itertools.pairwise(layers) for shape in ((n, m), (m,))]
        sizes = [int(np.prod(shape)) for shape in shapes]
        if len(numbers) != sum(sizes):
            raise InvalidModel(self._source, f"{name}.weights has {len(numbers)} numbers, not {sum(sizes)}")
        arrays = [
            part.reshape(shape).astype(precision)
            for part, shape in zip(np.split(numbers, np.cumsum(sizes)[:-1]), shapes, strict=True)
        ]
        scale_y = self.numbers(table, name, "scale_y", (VALUES,))
        mean_y = self.numbers(table, name, "mean_y", (VALUES,))
        weights, biases = tuple(arrays[0::2]), tuple(arrays[1::2])
        return Network(domain.mean, domain.scale, domain.hull, weights, biases, Activation(activation), mean_y, scale_y)

    def _weights(self, table: dict[str, Any], name: str) -> Any:
        """Return the numbers of all layers one after another."""
        lines = self.entry(table, "weights", name)
        if not isinstance(lines, list) or not all(isinstance(line, str) for line in cast("list[object]", lines)):
            raise InvalidModel(self._source, f"{name}.weights must be a list of texts")
        try:
            data = base64.b64decode("".join(cast("list[str]", lines)), validate=True)
        except (binascii.Error, ValueError) as e:
            raise InvalidModel(self._source, f"{name}.weights is not base64: {e}") from e
        if len(data) % _STORED.itemsize:
            raise InvalidModel(self._source, f"{name}.weights is not a whole number of {_STORED.itemsize} bytes")
        numbers = np.frombuffer(data, _STORED)
        if not np.all(np.isfinite(numbers)):
            raise InvalidModel(self._source, f"{name}.weights must be made of finite numbers")
        return numbers

    def _cubic(self, table: dict[str, Any], name: str, domain: Domain, values: int = VALUES) -> Cubic:
        n = len(domain.mean)
        powers = np.transpose(self.numbers(table, name, "powers", (n, ANY)))
        if np.any(powers != np.floor(powers)) or np.any(powers < 0.0) or np.any(np.sum(powers, axis=1) > DEGREE):
            fault = f"{name}.powers must be whole numbers from 0, {DEGREE} at most in a column"
            raise InvalidModel(self._source, fault)
        coefficients = np.transpose(self.numbers(table, name, "coefficients", (values, len(powers))))
        return Cubic(
            domain.mean,
            domain.scale,
            domain.hull,
            powers=powers.astype(np.int64),
            coefficients=np.ascontiguousarray(coefficients),  # as when it was fitted: sums round likewise
        )


def _all_numbers(value: object, depth: int) -> bool:
    if isinstance(value, list):
        return depth > 0 and all(_all_numbers(v, depth - 1) for v in cast("list[object]", value))
    return (
        isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) < 1e300 and math.isfinite(value)
    )


def _plain(regressor: Regressor) -> dict[str, Any]:
    """Return a regressor's numbers as they stand in a file."""
    if isinstance(regressor, Adapted):
        parts = {name: getattr(regressor, name).tolist() for name in ("offset", "weights", "gain")}
        return {**_plain(regressor.base), "adaptation": parts}
    domain = regressor.domain
    mean, scale, hull = domain.mean.tolist(), domain.scale.tolist(), domain.hull.tolist()
    if isinstance(regressor, Network):
        return {"mean": mean, "scale": scale, "hull": hull, **_plain_network(regressor)}
    if isinstance(regressor, (BentTip, BentCommand)):
        beam = {**regressor.beam.stiffness._asdict(), **regressor.beam.weights._asdict()}
        droop = {"droop": regressor.droop} if isinstance(regressor, BentCommand) else {}
        return {"mean": mean, "scale": scale, "hull": hull, "beam": beam, **droop}
    if not isinstance(regressor, Cubic):
        raise TypeError(f"a model's file has no form for {type(regressor).__name__}")
    return {
        "mean": mean,
        "scale": scale,
        "powers": regressor.powers.T.tolist(),  # a row an input, and coefficients a row a value: few lines
        "coefficients": regressor.coefficients.T.tolist(),
        "hull": hull,
    }


def _plain_network(network: Network) -> dict[str, Any]:
    layers = zip(network.weights, network.biases, strict=True)
    data = b"".join(part.astype(_STORED).tobytes() for layer in layers for part in layer)
    text = base64.b64encode(data).decode("ascii")
    return {
        "neurons": list(network.neurons),
        "activation": network.activation.value,
        "precision": network.weights[0].dtype.name,
        "mean_y": network.mean_y.tolist(),
        "scale_y": network.scale_y.tolist(),
        "weights": [text[k : k + _WIDTH - 8] for k in range(0, len(text), _WIDTH - 8)],
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
