import ctypes

import numpy as np
from support.fmus.binary_values import SIZE_OF_PICTURE, put, take
from support.fmus.ctypes_host import ERROR, OK
from support.fmus.workshop import Workshop
from support.wording import Wording


def test_a_picture_goes_in_and_out_and_is_read_where_it_lies(workshop: Workshop):
    host = workshop.host("eye:Eye", 3)
    picture = np.random.default_rng(1).integers(0, 256, SIZE_OF_PICTURE, dtype=np.uint8)
    assert put(host, "picture", picture.tobytes()) == OK
    host.initialise()
    address, size = take(host, "brighter")
    assert size == SIZE_OF_PICTURE
    assert ctypes.string_at(address, size) == (picture + np.uint8(1)).tobytes()
    assert put(host, "picture", (picture + np.uint8(7)).tobytes()) == OK
    host.step(0.0, 1 / 30)
    assert take(host, "brighter") == (address, size)  # no copy: the pointer stays, its content changes
    assert ctypes.string_at(address, size) == (picture + np.uint8(8)).tobytes()


def test_a_picture_of_another_size_is_refused(workshop: Workshop, wording: Wording):
    host = workshop.host("eye:Eye", 3)
    assert put(host, "picture", b"abc") == ERROR
    wording.check(host.log[-1])


def test_no_bytes_make_a_picture_black(workshop: Workshop):
    host = workshop.host("eye:Eye", 3)
    put(host, "picture", b"\xff" * SIZE_OF_PICTURE)
    assert put(host, "picture", b"") == OK
    host.initialise()
    assert ctypes.string_at(*take(host, "brighter")) == b"\1" * SIZE_OF_PICTURE


def test_bytes_of_any_length_up_to_the_capacity(workshop: Workshop, wording: Wording):
    host = workshop.host("eye:Eye", 3)
    assert put(host, "note", b"drawer") == OK
    host.initialise()
    assert ctypes.string_at(*take(host, "note_back")) == b"reward"
    assert put(host, "note", b"") == OK
    host.step(0.0, 1 / 30)
    assert take(host, "note_back")[1] == 0
    assert put(host, "note", bytes(1 << 17)) == ERROR
    wording.check(host.log[-1])
