import enum
import math
import struct
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple, cast

import hypothesis.strategies as st
import msgpack
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis.extra import numpy as arrays
from support.cosim.planted import CodeThatRuns, planted_pickle
from support.wording import Wording

from handover.cosim.blocks.block import InvalidState
from handover.cosim.blocks.start_values import fault_of, numbers_of, range_of
from handover.cosim.blocks.state import NotPlainData, pack_state, unpack_state
from handover.cosim.blocks.units import BaseExponents, Unit
from handover.cosim.blocks.variable import Causality, Kind, Variable

NUMBERS = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.floats(allow_nan=False),
    st.complex_numbers(allow_nan=False),
    st.text(),
    st.binary(),
    st.fractions(),
)
PLAIN = st.recursive(
    NUMBERS,
    lambda inner: st.one_of(
        st.lists(inner), st.lists(inner).map(tuple), st.dictionaries(st.one_of(st.text(), st.integers(0, 99)), inner)
    ),
)


def kinds(state: Any) -> Any:
    """Return the types of all parts of a state."""
    if isinstance(state, (list, tuple)):
        return type(cast(object, state)), [kinds(item) for item in cast(Sequence[Any], state)]
    if isinstance(state, Mapping):
        return dict, {key: kinds(value) for key, value in cast(Mapping[Any, Any], state).items()}
    return type(cast(object, state))


@given(PLAIN)
@settings(max_examples=40)
def test_plain_data_comes_back_type_for_type(state: Any):
    again = unpack_state(pack_state(state))
    assert again == state
    assert kinds(again) == kinds(state)


def test_numbers_keep_their_bits_and_types():
    nan = struct.unpack("<d", (0x7FF8_0000_DEAD_BEEF).to_bytes(8, "little"))[0]
    for x in (0.0, -0.0, 0.1, math.inf, -math.inf, 5e-324, nan):
        assert struct.pack("<d", unpack_state(pack_state(x))) == struct.pack("<d", x)
    array = np.frombuffer((0xFFF8_0000_0000_0001).to_bytes(8, "little"))
    assert unpack_state(pack_state(array)).tobytes() == array.tobytes()
    for number in (np.float64(0.1), np.float32(0.1), np.int64(-3), np.bool_(True), np.str_("a")):
        again = unpack_state(pack_state([number]))[0]
        assert type(again) is type(number)
        assert again == number


@given(
    arrays.arrays(arrays.scalar_dtypes().filter(lambda d: d.kind in "biufcSU" and d.itemsize), arrays.array_shapes())
)
@settings(max_examples=40)
def test_an_array_keeps_type_shape_and_bytes(array: Any):
    again = unpack_state(pack_state(array))
    assert (again.dtype, again.shape, again.tobytes()) == (array.dtype, array.shape, array.tobytes())
    assert again.flags.writeable


def test_an_array_keeps_its_order_in_memory():
    rows = np.arange(6.0).reshape(2, 3)
    columns = np.asfortranarray(rows)
    for array in (rows, columns, rows[:, ::2], np.zeros((0, 3)), np.float64(3.0) + np.zeros(())):
        again = unpack_state(pack_state(array))
        np.testing.assert_array_equal(again, array)
        assert again.shape == array.shape
        assert again.flags.fnc == array.flags.fnc
    assert unpack_state(pack_state(columns)).flags.fnc


@pytest.mark.parametrize("generator", [np.random.PCG64, np.random.MT19937, np.random.Philox, np.random.SFC64])
def test_a_generator_goes_on_with_the_same_numbers(generator: Any):
    rng = np.random.Generator(generator(7))
    rng.integers(10, dtype=np.int32)  # leaves half of a number
    kept = pack_state((1, rng.bit_generator))
    again = unpack_state(pack_state((1, rng.bit_generator.state)))[1]
    assert pack_state(again) == pack_state(unpack_state(kept)[1])
    wanted = [rng.standard_normal(5).tolist(), rng.integers(10, size=3, dtype=np.int32).tolist()]
    other = np.random.Generator(generator(8))
    _, other.bit_generator.state = unpack_state(kept)
    assert [other.standard_normal(5).tolist(), other.integers(10, size=3, dtype=np.int32).tolist()] == wanted


class Colour(enum.Enum):
    RED = "red"


class Pair(NamedTuple):
    a: float
    b: tuple[int, ...]


@dataclass(frozen=True)
class Item:
    colour: Colour
    pair: Pair | None = None
    seen: list[float] = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "seen", [])
        if self.pair is not None and self.pair.a < 0:
            raise ValueError("a is below 0")


RECORDS = (Item, Pair, Colour)


def test_records_come_back_for_a_reader_that_names_them_through_their_constructor(wording: Wording):
    item = Item(Colour.RED, Pair(1.0, (2, 3)))
    item.seen.append(4.0)
    again = unpack_state(pack_state({"items": [item]}, RECORDS), RECORDS)["items"][0]
    assert again == item
    assert again.seen == [4.0]
    packed = pack_state(Item(Colour.RED, Pair(1.0, ())), RECORDS)
    for content, known in (
        (packed, ()),
        (pack_state(item.pair, RECORDS), ()),
        (packed, (Item, Pair)),
        (packed.replace(struct.pack(">d", 1.0), struct.pack(">d", -1.0)), RECORDS),
        (packed.replace(b"pair", b"four"), RECORDS),
        (packed.replace(b"RED", b"RID"), RECORDS),
    ):
        with pytest.raises(InvalidState) as refused:
            unpack_state(content, known)
        wording.check(refused.value)


@pytest.mark.parametrize(
    "value",
    [object(), {1, 2}, Colour.RED, Pair(1.0, ()), print, np.array([None]), np.zeros(2, "f8,i4"), CodeThatRuns("")],
)
def test_what_is_no_plain_data_is_not_saved(value: Any):
    with pytest.raises(NotPlainData, match=type(value).__name__):
        pack_state({"all": [1, value]})


def test_a_pickle_is_refused_and_not_executed(tmp_path: Path):
    packed, mark = planted_pickle(tmp_path)
    with pytest.raises(InvalidState, match="are not a state that was saved here"):
        unpack_state(packed)
    assert not mark.exists()


def ext(code: int, content: bytes) -> bytes:
    return cast(bytes, msgpack.packb(msgpack.ExtType(code, content)))


@pytest.mark.parametrize(
    ("packed", "fault"),
    [
        (b"", "0 bytes are not a state"),
        (b"\xdd\xff\xff\xff\xff", "not a state"),  # a list of 4,294,967,295 items
        (b"\xc6\xff\xff\xff\xff", "not a state"),  # as many bytes
        (b"\x91" * 5000 + b"\x00", "not a state"),  # as deep as no state is
        (pack_state(1.0) + b"\x00", "extra data"),
        (pack_state((1, 2))[:-1], "not a state"),
        (ext(9, b""), "not a state"),
        (ext(10, b""), "extension type 10"),
        (ext(4, b"|O C 1\0" + bytes(8)), "not plain data"),
        (ext(4, b"<f8,<i4 C 1\0" + bytes(12)), "not plain data"),
        (ext(4, b"<f8 A 1\0" + bytes(8)), "not plain data"),
        (ext(4, b"<f8 C -1\0"), "not plain data"),
        (ext(4, b"<f8 C 1000000000000\0" + bytes(8)), "in 8 bytes"),
        (ext(4, b"<f8 C 1\0" + bytes(9)), "in 9 bytes"),
        (ext(4, b"__import__('os') C 1\0" + bytes(8)), "not a state"),
        (ext(4, b"<f8"), "not a state"),
        (ext(6, b"Colour RED"), "holds a 'Colour RED'"),
        (ext(1, b""), "not a state"),
        (ext(7, b"1/0"), "ZeroDivisionError"),
        (ext(7, b"1e9"), "ValueError"),
        (ext(8, b"1"), "not a state"),
        (pack_state(np.array(["abcd"]))[:-16] + b"\xff" * 16, "no characters"),
        (b"\x91" + ext(2, b""), "not a state"),
    ],
)
def test_what_is_damaged_or_made_up_is_refused(packed: bytes, fault: str):
    with pytest.raises(InvalidState, match=fault) as e:
        unpack_state(packed)
    assert "\n" not in str(e.value)


@given(st.binary(max_size=300))
def test_any_bytes_are_plain_data_or_refused(packed: bytes):
    with suppress(InvalidState):
        kinds(unpack_state(packed))


METRE = Unit("m", BaseExponents(m=1))


class Place(enum.IntEnum):
    FRONT = 0
    LEFT = 4


def variable(kind: Kind, **facts: Any) -> Variable:
    if kind is Kind.ENUMERATION:
        facts["items"] = tuple((e.name, int(e)) for e in Place)
    return Variable(name="x", kind=kind, causality=Causality.PARAMETER, description="", start=None, **facts)


@pytest.mark.parametrize(
    ("kind", "facts", "value"),
    [
        (Kind.REAL, {"unit": METRE, "minimum": 0.0, "maximum": 2.0}, 2.5),
        (Kind.REAL, {"unit": METRE, "minimum": 0.0}, -1),
        (Kind.REAL, {"unit": METRE, "maximum": 0.0}, 1),
        (Kind.REAL, {"unit": METRE}, "far"),
        (Kind.REAL, {"unit": Unit("")}, "far"),
        (Kind.REAL, {}, float("nan")),
        (Kind.REAL, {"shape": (3,), "unit": METRE}, [1.0, 2.0]),
        (Kind.REAL, {"shape": (2,), "minimum": 0.0}, [1.0, -2.0]),
        (Kind.INTEGER, {}, 1.5),
        (Kind.BOOLEAN, {}, "maybe"),
        (Kind.ENUMERATION, {}, "behind"),
        (Kind.ENUMERATION, {}, 3),
        (Kind.STRING, {}, 5),
    ],
)
def test_a_bad_value_is_reported_with_valid_values(kind: Kind, facts: dict[str, Any], value: Any, wording: Wording):
    wording.check(fault_of(variable(kind, **facts), value))


@pytest.mark.parametrize(
    ("given", "value"),
    [
        (variable(Kind.REAL, unit=METRE, minimum=0.0, maximum=2.0), 2.0),
        (variable(Kind.REAL, shape=(3,)), np.ones(3)),
        (variable(Kind.INTEGER, minimum=0.0), 7),
        (variable(Kind.BOOLEAN), True),
        (variable(Kind.ENUMERATION), "left"),
        (variable(Kind.STRING), "a word"),
    ],
)
def test_a_good_value_has_no_fault(given: Variable, value: Any):
    assert fault_of(given, value) is None


def test_numbers_come_in_row_major_order_and_large_ones_keep_their_digits():
    assert numbers_of(variable(Kind.REAL, shape=(2, 2)), [[1, 2], [3, 4]]).tolist() == [1, 2, 3, 4]
    assert numbers_of(variable(Kind.ENUMERATION), "Left").tolist() == [4]
    assert numbers_of(variable(Kind.INTEGER), 2**53 + 1).tolist() == [2**53 + 1]
    assert range_of(variable(Kind.REAL)) == ""
