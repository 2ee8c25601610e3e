"""States as plain data: what a block's `get_state` returns, in the format MessagePack; nothing in it is ever executed.

A state is made of None, booleans, integers of any size, floats, complex numbers, fractions, texts, bytes, lists,
tuples, mappings, numpy's numbers and arrays. All of it comes back as it was, bit for bit and type for type: a tuple as
a tuple, an array in the order of its memory. The bit generator of a `numpy.random.Generator` is saved as its `state`.
Dataclasses, named tuples and enumerations come back only as one of the types that the reader names.

MessagePack has no such types of its own, so they are its extension types: 1 begins an array that is a tuple, 2 one that
is a record (its type's name and its values by name); 3 is an integer beyond 64 bits (little endian, two's complement);
4 an array of numbers or texts and 5 a single one (a header such as `<f8 C 3 3`, a zero byte, the values); 6 a member of
an enumeration; 7 a fraction; 8 a complex number (two float64); 9 the state of numpy's PCG64, whose integers of 128
bits would take longer than all else.
"""

import enum
import struct
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from fractions import Fraction
from functools import cache, lru_cache
from math import prod
from typing import Any, cast

import msgpack
import numpy as np

from handover.cosim.blocks.block import InvalidState

_TUPLE, _RECORD, _INTEGER, _ARRAY, _NUMBER, _MEMBER, _FRACTION, _COMPLEX, _PCG64 = range(1, 10)

_KINDS = "biufcSU"
"""Kinds of numpy's types that are plain data; objects are not."""

_unpackb = cast(Callable[..., Any], msgpack.unpackb)

_TWO_FLOATS = struct.Struct("<2d")
_PCG64_STATE = struct.Struct("<16s16sBI")

_BUFFER = 1024
"""Bytes with which packing begins; msgpack's own choice takes longer to allocate than a state to pack."""


class NotPlainData(TypeError):
    """A state holds something that is not plain data."""

    def __init__(self, value: object) -> None:
        kind = type(value)
        super().__init__(
            f"a state cannot hold {kind.__module__}.{kind.__qualname__}: numbers, texts, booleans, bytes, None, lists, "
            "tuples, mappings and numpy's arrays of numbers can be saved"
        )


def pack_state(state: object, records: Sequence[type[Any]] = ()) -> bytes:
    """Return plain data as bytes, for `unpack_state`.

    Args:
        state: plain data, see the module.
        records: dataclasses, named tuples and enumerations that it may hold besides.

    Raises:
        NotPlainData: it holds anything else. ValueError: it is nested more than 500 deep.
    """
    default = _of_special if not records else _packer_of(tuple(records))
    return cast(bytes, msgpack.packb(state, default=default, strict_types=True, buf_size=_BUFFER))


def unpack_state(packed: Any, records: Sequence[type[Any]] = ()) -> Any:
    """Return the plain data from which `pack_state` made these bytes.

    Only as much memory is taken as the bytes can fill, whatever lengths they claim.

    Args:
        packed: the bytes; anything else is refused.
        records: the types besides plain data that are made of them, by their names; none by default.

    Raises:
        InvalidState: the bytes are damaged, hold another type, or were not made by `pack_state`.
    """
    if not isinstance(packed, bytes | bytearray):  # what was read out of another state may be anything
        raise InvalidState(f"a {type(packed).__name__} where the bytes of a state are expected")
    of_extension, of_list = (_extension, _list) if not records else _unpackers_of(tuple(records))
    try:
        state = _unpackb(packed, ext_hook=of_extension, list_hook=of_list, strict_map_key=False)
    except InvalidState:
        raise
    except Exception as e:  # msgpack, numpy and the records' constructors raise various exceptions
        reason = " ".join(str(e).split())[:200]
        raise InvalidState(
            f"these {len(packed)} bytes are not a state that was saved here ({type(e).__name__}: {reason})"
        ) from e
    if type(state) is _Begin:
        raise InvalidState(f"these {len(packed)} bytes are not a state that was saved here")
    return state


class _Begin:
    """The first item of an array that stands for something else."""


_BEGINS_TUPLE, _BEGINS_RECORD = _Begin(), _Begin()
_TUPLE_ITEM, _RECORD_ITEM = msgpack.ExtType(_TUPLE, b""), msgpack.ExtType(_RECORD, b"")


def _of_special(value: Any) -> Any:
    """Return what MessagePack knows in place of what it does not."""
    kind = cast(type[Any], type(value))
    if kind is tuple:
        return [_TUPLE_ITEM, *value]
    if kind is np.random.PCG64:
        state = value.state
        wide = (state["state"][name].to_bytes(16, "little") for name in ("state", "inc"))
        return msgpack.ExtType(_PCG64, _PCG64_STATE.pack(*wide, state["has_uint32"], state["uinteger"]))
    if kind is np.ndarray and value.dtype.kind in _KINDS and value.dtype.itemsize:
        order = "F" if value.flags.fnc else "C"
        return msgpack.ExtType(_ARRAY, _header(value.dtype, order, value.shape) + value.tobytes(order))
    if kind is int:
        return msgpack.ExtType(_INTEGER, value.to_bytes(value.bit_length() // 8 + 1, "little", signed=True))
    if issubclass(kind, np.generic) and value.dtype.kind in _KINDS and value.dtype.itemsize:
        return msgpack.ExtType(_NUMBER, _header(value.dtype, "C", ()) + value.tobytes())
    if kind is complex:
        return msgpack.ExtType(_COMPLEX, _TWO_FLOATS.pack(value.real, value.imag))
    if kind is Fraction:
        return msgpack.ExtType(_FRACTION, str(value).encode())
    if isinstance(value, np.random.BitGenerator):
        return value.state
    raise NotPlainData(value)


def _list(items: list[Any]) -> Any:
    if items and type(items[0]) is _Begin:
        if items[0] is _BEGINS_TUPLE:
            return tuple(items[1:])
        raise InvalidState(f"the state holds a {items[1]!r}, and none is expected in it")
    return items


def _extension(code: int, content: bytes) -> Any:
    if code == _TUPLE:
        return _BEGINS_TUPLE
    if code == _RECORD:
        return _BEGINS_RECORD
    if code == _INTEGER:
        return int.from_bytes(content, "little", signed=True)
    if code in (_ARRAY, _NUMBER):
        at = content.index(0) + 1
        dtype, order, shape = _parsed(content[:at])
        if len(content) - at != dtype.itemsize * prod(shape):
            raise InvalidState(f"the state holds an array of {shape} {dtype} in {len(content) - at} bytes")
        array = np.ndarray(shape, dtype, bytearray(content[at:]), order=order)
        if dtype.kind == "U":
            codes = np.frombuffer(content, f"{cast(str, dtype.str)[0]}u4", offset=at)
            if codes.max(initial=0) > sys.maxunicode:
                raise InvalidState("the state holds a text of what are no characters")
        return array if code == _ARRAY else array[()]
    if code == _FRACTION:
        top, _, bottom = content.decode("ascii").partition("/")
        return Fraction(int(top), int(bottom or "1"))
    if code == _COMPLEX:
        return complex(*_TWO_FLOATS.unpack(content))
    if code == _PCG64:
        state, increment, has_half, half = _PCG64_STATE.unpack(content)
        wide = {"state": int.from_bytes(state, "little"), "inc": int.from_bytes(increment, "little")}
        return {"bit_generator": "PCG64", "state": wide, "has_uint32": has_half, "uinteger": half}
    if code == _MEMBER:
        raise InvalidState(f"the state holds a {content.decode()!r}, and none is expected in it")
    raise InvalidState(f"the state holds MessagePack's extension type {code}, and 1 to 9 are known")


@lru_cache(256)
def _header(dtype: "np.dtype[Any]", order: str, shape: tuple[int, ...]) -> bytes:
    return " ".join([cast(str, dtype.str), order, *map(str, shape)]).encode() + b"\0"


@lru_cache(256)
def _parsed(header: bytes) -> tuple["np.dtype[Any]", Any, tuple[int, ...]]:
    kind, order, *sizes = header[:-1].decode("ascii").split(" ")
    dtype, shape = np.dtype(kind), tuple(map(int, sizes))
    is_plain = dtype.kind in _KINDS and dtype.itemsize > 0
    if not is_plain or order not in ("C", "F") or min(shape, default=0) < 0:
        raise InvalidState(f"the state holds an array of {header[:-1].decode('ascii')!r}, which is not plain data")
    return dtype, order, shape


@cache
def _packer_of(records: tuple[type[Any], ...]) -> Callable[[Any], Any]:
    def special(value: Any) -> Any:
        kind = cast(type[Any], type(value))
        if kind not in records:
            return _of_special(value)
        if issubclass(kind, enum.Enum):
            return msgpack.ExtType(_MEMBER, f"{kind.__name__} {value.name}".encode())
        return [_RECORD_ITEM, kind.__name__, {name: getattr(value, name) for name in _fields(kind)}]

    return special


@cache
def _unpackers_of(records: tuple[type[Any], ...]) -> tuple[Callable[[int, bytes], Any], Callable[[list[Any]], Any]]:
    known = {kind.__name__: kind for kind in records}

    def kind_of(name: Any) -> type[Any]:
        if name not in known:
            raise InvalidState(f"the state holds a {name!r}; valid are {', '.join(known)}")
        return known[name]

    def extension(code: int, content: bytes) -> Any:
        if code != _MEMBER:
            return _extension(code, content)
        name, _, member = content.decode().partition(" ")
        return cast(Any, kind_of(name))[member]

    def of_list(items: list[Any]) -> Any:
        if not items or items[0] is not _BEGINS_RECORD:
            return _list(items)
        _, name, values = items
        return _made(kind_of(name), values)

    return extension, of_list


@cache
def _fields(kind: type[Any]) -> Mapping[str, bool]:
    """Return the names of a record's fields, and whether its constructor takes them."""
    if is_dataclass(kind):
        return {f.name: f.init for f in fields(kind)}
    return dict.fromkeys(cast(Any, kind)._fields, True)


def _made(kind: type[Any], values: Mapping[str, Any]) -> Any:
    """Return a record of its values, which its constructor checks."""
    known = _fields(kind)
    if set(values) != set(known):
        raise InvalidState(f"the state holds a {kind.__name__} of {sorted(values)}; {sorted(known)} are its fields")
    made = kind(**{name: value for name, value in values.items() if known[name]})
    for name, value in values.items():
        if not known[name]:
            object.__setattr__(made, name, value)
    return made
