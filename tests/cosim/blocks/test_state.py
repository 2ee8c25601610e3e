import enum
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple, cast

import hypothesis.strategies as st
import msgpack
import numpy as np
import pytest
from hypothesis import given
from hypothesis.extra import numpy as arrays
from support.cosim.planted import CodeThatRuns, planted_pickle

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
def test_plain_data_comes_back_type_for_type(state: Any):
    again = unpack_state(pack_state(state))
    assert again == state
    assert kinds(again) == kinds(state)


@given(st.floats(width=64))
def test_a_float_keeps_its_bits(x: float):
    assert struct.pack("<d", unpack_state(pack_state(x))) == struct.pack("<d", x)


def test_a_nan_keeps_its_payload():
    nan = struct.unpack("<d", (0x7FF8_0000_DEAD_BEEF).to_bytes(8, "little"))[0]
    assert struct.pack("<d", unpack_state(pack_state(nan))) == struct.pack("<d", nan)
    array = np.frombuffer((0xFFF8_0000_0000_0001).to_bytes(8, "little"))
    assert unpack_state(pack_state(array)).tobytes() == array.tobytes()


@given(
    arrays.arrays(arrays.scalar_dtypes().filter(lambda d: d.kind in "biufcSU" and d.itemsize), arrays.array_shapes())
)
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


def test_a_number_of_numpy_stays_one():
    for number in (np.float64(0.1), np.float32(0.1), np.int64(-3), np.bool_(True), np.str_("a")):
        again = unpack_state(pack_state([number]))[0]
        assert type(again) is type(number)
        assert again == number


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


def test_records_come_back_for_a_reader_that_names_them():
    item = Item(Colour.RED, Pair(1.0, (2, 3)))
    item.seen.append(4.0)
    again = unpack_state(pack_state({"items": [item]}, RECORDS), RECORDS)["items"][0]
    assert again == item
    assert again.seen == [4.0]
    with pytest.raises(InvalidState, match="holds a 'Colour RED', and none"):
        unpack_state(pack_state(item, RECORDS))
    with pytest.raises(InvalidState, match="holds a 'Pair', and none"):
        unpack_state(pack_state(item.pair, RECORDS))
    with pytest.raises(InvalidState, match="holds a 'Colour'; valid are Item, Pair"):
        unpack_state(pack_state(item, RECORDS), (Item, Pair))


def test_the_constructor_of_a_record_checks_it():
    packed = pack_state(Item(Colour.RED, Pair(1.0, ())), RECORDS)
    with pytest.raises(InvalidState, match="ValueError: a is below 0"):
        unpack_state(packed.replace(struct.pack(">d", 1.0), struct.pack(">d", -1.0)), RECORDS)
    with pytest.raises(InvalidState, match="'colour', 'pair', 'seen'"):
        unpack_state(packed.replace(b"pair", b"four"), RECORDS)
    with pytest.raises(InvalidState, match="KeyError: 'RID'"):
        unpack_state(packed.replace(b"RED", b"RID"), RECORDS)


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
        (ext(4, b"|O C 1\0" + bytes(8)), "no plain data"),
        (ext(4, b"<f8,<i4 C 1\0" + bytes(12)), "no plain data"),
        (ext(4, b"<f8 A 1\0" + bytes(8)), "no plain data"),
        (ext(4, b"<f8 C -1\0"), "no plain data"),
        (ext(4, b"<f8 C 1000000000000\0" + bytes(8)), "in 8 bytes"),
        (ext(4, b"<f8 C 1\0" + bytes(9)), "in 9 bytes"),
        (ext(4, b"__import__('os') C 1\0" + bytes(8)), "not a state"),
        (ext(4, b"<f8"), "not a state"),
        (ext(6, b"Colour RED"), "holds a 'Colour RED'"),
        (ext(1, b""), "not a state"),
        (ext(7, b"1/0"), "ZeroDivisionError"),
        (ext(7, b"1e9"), "ValueError"),
        (ext(8, b"1"), "not a state"),
        (b"\x91" + ext(2, b""), "not a state"),
    ],
)
def test_what_is_damaged_or_made_up_is_refused(packed: bytes, fault: str):
    with pytest.raises(InvalidState, match=fault) as e:
        unpack_state(packed)
    assert "\n" not in str(e.value)


@given(st.binary(max_size=300))
def test_any_bytes_are_plain_data_or_refused(packed: bytes):
    try:
        state = unpack_state(packed)
    except InvalidState:
        return
    kinds(state)


def test_texts_of_what_are_no_characters_are_refused():
    packed = pack_state(np.array(["abcd"]))
    with pytest.raises(InvalidState, match="no characters"):
        unpack_state(packed[:-16] + b"\xff" * 16)


METRE = Unit("m", BaseExponents(m=1))


class Place(enum.IntEnum):
    FRONT = 0
    LEFT = 4


def variable(kind: Kind, **facts: Any) -> Variable:
    if kind is Kind.ENUMERATION:
        facts["items"] = tuple((e.name, int(e)) for e in Place)
    return Variable(name="x", kind=kind, causality=Causality.PARAMETER, description="", start=None, **facts)


@pytest.mark.parametrize(
    ("given", "value", "text"),
    [
        (variable(Kind.REAL, unit=METRE, minimum=0.0, maximum=2.0), 2.5, "out of range: from 0 to 2 m"),
        (variable(Kind.REAL, unit=METRE, minimum=0.0), -1, "at least 0 m"),
        (variable(Kind.REAL, unit=METRE, maximum=0.0), 1, "at most 0 m"),
        (variable(Kind.REAL, unit=METRE), "far", "'far' is not a number in m"),
        (variable(Kind.REAL), float("nan"), "not finite"),
        (variable(Kind.REAL, shape=(3,), unit=METRE), [1.0, 2.0], "an array of shape [3] of numbers in m"),
        (variable(Kind.REAL, shape=(2,), minimum=0.0), [1.0, -2.0], "out of range"),
        (variable(Kind.INTEGER), 1.5, "a whole number"),
        (variable(Kind.BOOLEAN), "maybe", "neither true nor false"),
        (variable(Kind.ENUMERATION), "behind", "none of front, left"),
        (variable(Kind.ENUMERATION), 3, "none of 0 (front), 4 (left)"),
        (variable(Kind.STRING), 5, "5 is not a string"),
    ],
)
def test_a_bad_value_is_reported_with_valid_values(given: Variable, value: Any, text: str):
    fault = fault_of(given, value)
    assert fault is not None
    assert text in fault


def test_a_port_whose_unit_has_no_name_is_of_numbers():
    assert fault_of(variable(Kind.REAL, unit=Unit("")), "far") == "'far' is not a number"


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


def test_numbers_come_in_row_major_order():
    assert numbers_of(variable(Kind.REAL, shape=(2, 2)), [[1, 2], [3, 4]]).tolist() == [1, 2, 3, 4]
    assert numbers_of(variable(Kind.ENUMERATION), "Left").tolist() == [4]


def test_no_range_is_reported_where_there_is_none():
    assert range_of(variable(Kind.REAL)) == ""
