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


@pytest.mark.parametrize(("fmi", "compiled"), [(2, True), (3, False)])
def test_a_text_is_read_as_text_and_a_binary_as_bytes(fmu: FmuOf, fmi: int, compiled: bool):
    s = System()
    s.add("diary", fmu("Diary", fmi), mark="ab")
    s.add("passer", native_fmu("binary_passer", 3), u=b"some bytes")
    with Master(s, MasterOptions(compiled=compiled)) as master:
        assert master.signals["diary.text"] == ""
        master.run(Fraction(3, 10))
        text = master.signals["diary.text"]
        assert isinstance(text, str)
        assert text == master.signals.text("diary.text") == "abéabéabé"
        assert master.signals["passer.y"].tobytes() == b"some bytes"
        for read in (master.signals.__getitem__, master.signals.text, master.signals.plain):
            with pytest.raises(KeyError, match=r"did you mean passer\.y"):
                read("passer.z")


def output(kind: Kind, shape: tuple[int, ...], fmi_type: str) -> dict[str, FmuPort]:
    ends = {"causality": Causality.OUTPUT, "references": (1,)}
    return {"y": FmuPort(name="y", kind=kind, fmi_type=fmi_type, shape=shape, **ends)}  # type: ignore[arg-type]


def test_arrays_have_their_shape_and_single_values_are_plain():
    contents = [ctypes.create_string_buffer(text) for text in (b"one", b"", "zwölf".encode(), b"\xff")]
    addresses = np.array([ctypes.addressof(c) for c in contents[:3]] + [0], dtype=np.uint64)
    sizes = np.array([3, 0, 6, 0], dtype=np.uint64)
    views = {
        "texts": {"y": (addresses,)},
        "bytes": {"y": (addresses, sizes)},
        "text": {"y": (addresses[:1],)},
        "one": {"y": (np.array([0.1]),)},
        "two": {"y": (np.array([True, False]),)},
    }
    ports = {
        "texts": output(Kind.STRING, (2, 2), "String"),
        "bytes": output(Kind.BINARY, (4,), "Binary"),
        "text": output(Kind.STRING, (), "String"),
        "one": output(Kind.REAL, (), "Float64"),
        "two": output(Kind.BOOLEAN, (2,), "Boolean"),
    }
    signals = Signals(views, ports, contents)
    assert signals["texts.y"].tolist() == [["one", ""], ["zwölf", ""]]
    assert [b.tobytes() for b in signals["bytes.y"]] == [b"one", b"", "zwölf".encode(), b""]
    plain = [signals.plain(f"{unit}.y") for unit in ("text", "one", "two")]
    assert plain == ["one", 0.1, [True, False]]
    assert [type(value) for value in plain] == [str, float, list]
    addresses[0] = ctypes.addressof(contents[3])
    assert signals.text("texts.y") == "\N{REPLACEMENT CHARACTER}"  # not UTF-8: shown, not refused
