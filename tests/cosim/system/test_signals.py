"""Signals by name: what a user reads of texts and binaries, which lie in memory as addresses."""

import ctypes
from fractions import Fraction

import numpy as np
import pytest
from support.cosim.fmu_of import FmuOf
from support.cosim.native_units import native_fmu

from handover.cosim.blocks.variable import Causality, Kind
from handover.cosim.fmu.file.description import FmuPort
from handover.cosim.master.master import Master
from handover.cosim.stepping.options import MasterOptions
from handover.cosim.system.signals import Signals
from handover.cosim.system.system import System

COMPILED = pytest.mark.parametrize("compiled", [True, False])


@COMPILED
@pytest.mark.parametrize("fmi", [2, 3])
def test_a_text_is_read_as_text(fmu: FmuOf, fmi: int, compiled: bool):
    s = System()
    s.add("diary", fmu("Diary", fmi), mark="ab")
    with Master(s, MasterOptions(compiled=compiled)) as master:
        assert master.signals["diary.text"] == ""
        master.run(Fraction(3, 10))
        text = master.signals["diary.text"]
        assert isinstance(text, str)
        assert text == master.signals.text("diary.text") == "abéabéabé"


def output(kind: Kind, shape: tuple[int, ...], fmi_type: str) -> FmuPort:
    return FmuPort(
        name="y", kind=kind, causality=Causality.OUTPUT, fmi_type=fmi_type, references=(1,), shape=shape
    )  # fmt: skip


def test_arrays_of_texts_and_of_binaries_have_their_shape():
    contents = [ctypes.create_string_buffer(text) for text in (b"one", b"", "zwölf".encode(), b"\xff")]
    addresses = np.array([ctypes.addressof(c) for c in contents[:3]] + [0], dtype=np.uint64)
    sizes = np.array([3, 0, 6, 0], dtype=np.uint64)
    views = {"text": {"y": (addresses,)}, "bytes": {"y": (addresses, sizes)}}
    ports = {"text": {"y": output(Kind.STRING, (2, 2), "String")}, "bytes": {"y": output(Kind.BINARY, (4,), "Binary")}}
    signals = Signals(views, ports, contents)
    assert signals["text.y"].tolist() == [["one", ""], ["zwölf", ""]]
    assert [b.tobytes() for b in signals["bytes.y"]] == [b"one", b"", "zwölf".encode(), b""]
    addresses[0] = ctypes.addressof(contents[3])
    assert signals.text("text.y") == "\N{REPLACEMENT CHARACTER}"  # not UTF-8: shown, not refused


def test_plain_values_are_those_of_the_arrays():
    contents = [ctypes.create_string_buffer(b"one")]
    texts = np.array([ctypes.addressof(contents[0])], dtype=np.uint64)
    views = {"text": {"y": (texts,)}, "one": {"y": (np.array([0.1]),)}, "two": {"y": (np.array([True, False]),)}}
    ports = {
        "text": {"y": output(Kind.STRING, (), "String")},
        "one": {"y": output(Kind.REAL, (), "Float64")},
        "two": {"y": output(Kind.BOOLEAN, (2,), "Boolean")},
    }
    signals = Signals(views, ports, contents)
    assert [signals.plain(f"{unit}.y") for unit in views] == ["one", 0.1, [True, False]]
    assert [type(signals.plain(f"{unit}.y")) for unit in views] == [str, float, list]
    with pytest.raises(KeyError, match=r"did you mean two\.y"):
        signals.plain("two.z")


def test_a_binary_is_an_array_of_bytes_and_an_unknown_name_is_refused():
    s = System()
    s.add("passer", native_fmu("binary_passer", 3), u=b"some bytes")
    with Master(s) as master:
        assert master.signals["passer.y"].tobytes() == b"some bytes"
        for read in (master.signals.__getitem__, master.signals.text):
            with pytest.raises(KeyError, match=r"did you mean passer\.y"):
                read("passer.z")
