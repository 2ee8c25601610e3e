"""A unit to which a host hands a pickle as its state refuses it and executes nothing, whatever the standard."""

import struct
from pathlib import Path

import pytest
from fmpy.fmi1 import FMICallException
from support.cosim.planted import planted_pickle
from support.fmus.fmpy_host import FmpyHost
from support.fmus.saved_states import digest

from handover.fmus.buffers import join, split
from handover.fmus.build import cached

IN_OTHER_PARTS = "HandAndObject"
"""A unit whose state holds states of its parts."""


def header_of(saved: bytes) -> bytes:
    """Return what stands before the variables and the block's state: its last words are their size and the digest."""
    sizes = (n for n in range(24, 512, 8) if struct.unpack_from("<Q", saved, n - 16)[0] == len(saved) - n)
    return saved[: next(sizes)]


def with_state(saved: bytes, state: bytes) -> bytes:
    """Return a serialised state with another state of the block in it, and with the digest that belongs to that."""
    header = header_of(saved)
    buffers, _ = split(saved[len(header) :])
    content = join([buffers, state])
    begin = header[:-16] + struct.pack("<Q", len(content))
    return begin + struct.pack("<Q", digest(begin + bytes(8) + content)) + content


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("name", ["FreeFlyer", IN_OTHER_PARTS])
def test_a_pickle_as_a_units_state_is_refused_and_not_executed(name: str, fmi: int, tmp_path: Path):
    planted, mark = planted_pickle(tmp_path)
    with FmpyHost(cached(name, fmi)) as host:
        host.enter()
        host.leave()
        saved = host.saved()
        before = host.outputs()
        assert with_state(saved, split(saved[len(header_of(saved)) :])[1]) == saved
        with pytest.raises(FMICallException):
            host.restore(with_state(saved, planted))
        assert not mark.exists()
        assert "bytes are not a state that was saved here" in host.log[-1]
        assert "Traceback" not in host.log[-1]
        with pytest.raises(FMICallException):
            host.restore(planted)
        assert not mark.exists()
        assert host.outputs() == before
