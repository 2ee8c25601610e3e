import ctypes

import numpy as np
import pytest
from support.fmus.binary_values import SIZE_OF_PICTURE, put, take
from support.fmus.ctypes_host import OK
from support.fmus.workshop import Workshop, expect_error
from support.wording import Wording


@pytest.mark.parametrize("process", ["0", "1"])
def test_a_picture_goes_in_and_out_and_is_read_where_it_lies(
    workshop: Workshop, monkeypatch: pytest.MonkeyPatch, process: str
):
    """In the host's process, and through memory that it shares with the unit's."""
    monkeypatch.setenv("FMU_PYTHON_PROCESS", process)
    host = workshop.host("eye:Eye", 3)
    picture = np.random.default_rng(1).integers(0, 256, SIZE_OF_PICTURE, dtype=np.uint8)
    assert put(host, "picture", picture.tobytes()) == put(host, "note", b"drawer") == OK
    host.initialise()
    address, size = take(host, "brighter")
    assert size == SIZE_OF_PICTURE
    assert ctypes.string_at(address, size) == (picture + np.uint8(1)).tobytes()
    assert ctypes.string_at(*take(host, "note_back")) == b"reward"
    assert put(host, "picture", (picture + np.uint8(7)).tobytes()) == put(host, "note", b"") == OK
    host.step(0.0, 1 / 30)
    assert take(host, "brighter") == (address, size)  # no copy: the pointer stays, its content changes
    assert ctypes.string_at(address, size) == (picture + np.uint8(8)).tobytes()
    assert take(host, "note_back")[1] == 0


def test_no_bytes_make_a_picture_black_and_others_are_refused(workshop: Workshop, wording: Wording):
    host = workshop.host("eye:Eye", 3)
    assert put(host, "picture", b"\xff" * SIZE_OF_PICTURE) == put(host, "picture", b"") == OK
    expect_error(wording, host, put(host, "picture", b"abc"))
    expect_error(wording, host, put(host, "note", bytes(1 << 17)))
    host.initialise()
    assert ctypes.string_at(*take(host, "brighter")) == b"\1" * SIZE_OF_PICTURE
