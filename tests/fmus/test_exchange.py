"""Outputs that are not of their declared type are rejected by name, none is converted with a loss."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from support.sample_units import every_kind, eye
from support.wording import Wording

from handover.cosim.blocks.description import describe
from handover.fmus.buffers import Buffers
from handover.fmus.exchange import InvalidOutput, OtherReturn, input_reader, output_writer
from handover.fmus.layout import Layout


def write(block: Any, y: Any, **changed: Any) -> Buffers:
    buffers = Buffers(Layout(describe(block)))
    output_writer(buffers)(replace(y, **changed))
    return buffers


def every_kind_with(**changed: Any) -> Buffers:
    block = every_kind.EveryKind(every_kind.Params())
    return write(every_kind.EveryKind, block.outputs(0.0, every_kind.Inputs()), **changed)


REFUSED: dict[str, list[Any]] = {
    "b": [None, "1.0", np.zeros(2)],
    "p": [np.array(["1", "2", "3"]), np.ones(3) * 1j, [True, False, True], [None, 1.0, 2.0]],
    "total": [1.0, True, 1 << 63],
    "off": ["False", 1, None],
    "mood_out": [3, True, 1.0],
    "sentence": [None, b"words", "\ud800"],
}


def test_an_output_of_another_type_is_refused(wording: Wording):
    for name, values in REFUSED.items():
        for value in values:
            with pytest.raises(InvalidOutput) as refused:
                every_kind_with(**{name: value})
            wording.check(refused.value)


def test_bytes_of_another_type_or_without_room_are_refused():
    y = eye.Outputs(brighter=np.zeros((720, 1280, 3), np.uint8), note_back=b"")
    for value in ("text", bytearray(b"x"), None, bytes(1 << 17)):
        with pytest.raises(InvalidOutput, match="note_back"):
            write(eye.Eye, y, note_back=value)
    for picture in (np.zeros((720, 1280, 3)), np.zeros((720, 1280, 1), np.uint8), [0]):
        with pytest.raises(InvalidOutput, match=r"uint8 array of shape \(720, 1280, 3\)"):
            write(eye.Eye, y, brighter=picture)


def test_what_are_no_outputs_is_refused_with_what_would_be(wording: Wording):
    for y in (None, {"b": 1.0}, 1.0):
        with pytest.raises(OtherReturn) as refused:
            output_writer(Buffers(Layout(describe(every_kind.EveryKind))))(y)
        wording.check(refused.value)


def test_numpys_scalars_and_lists_of_numbers_are_taken():
    buffers = every_kind_with(
        b=np.float32(0.5), p=[1, 2.0, 3], total=np.int32(7), off=np.bool_(True), mood_out=5, sentence=np.str_("ä")
    )
    entries = {name: slot.entries for name, slot in buffers.layout.slots.items()}
    assert buffers.floats[entries["b"]] == [0.5]
    assert buffers.floats[entries["p"]].tolist() == [1.0, 2.0, 3.0]
    assert buffers.integers[entries["total"]] == [7]
    assert buffers.integers[entries["mood_out"]] == [5]
    assert buffers.booleans[entries["off"]] == [True]
    assert buffers.strings[entries["sentence"]] == ["ä".encode()]


def test_what_a_block_gave_is_shown_in_one_line():
    variable = next(v for v in describe(every_kind.EveryKind).outputs if v.shape)
    assert "\n" not in str(InvalidOutput(variable, np.ones((40, 9))))


def test_inputs_have_their_declared_types_and_follow_the_buffers():
    buffers = Buffers(Layout(describe(every_kind.EveryKind)))
    read = input_reader(buffers)
    u = read()
    places = buffers.layout.slots
    buffers.floats[places["a"].entries] = 0.25
    buffers.floats[places["v"].entries] = [1.0, 2.0, 3.0]
    buffers.integers[places["k"].offset] = -7
    buffers.booleans[places["on"].offset] = False
    buffers.integers[places["mood_in"].offset] = 5
    buffers.strings[places["word"].offset] = "ä".encode()
    assert read() is u
    assert (u.a, u.k, u.on, u.mood_in, u.word) == (0.25, -7, False, every_kind.Mood.WILD, "ä")
    assert [type(x) for x in (u.a, u.k, u.on, u.mood_in, u.word)] == [float, int, bool, every_kind.Mood, str]
    assert u.v.tolist() == [1.0, 2.0, 3.0]
    assert not u.v.flags.writeable
