import ctypes
import struct

import pytest
from support.fmus.ctypes_host import ERROR, OK, CtypesHost
from support.fmus.saved_states import called, deserialise, digest, save, serialised
from support.fmus.workshop import Workshop
from support.wording import Wording

DT = 1 / 64


def ready(workshop: Workshop, fmi: int) -> CtypesHost:
    host = workshop.host("every_kind:EveryKind", fmi)
    assert host.initialise() == OK
    for i in range(3):
        assert host.step(i * DT, DT) == OK
    return host


def ten_steps(host: CtypesHost) -> list[list[float]]:
    seen: list[list[float]] = []
    for i in range(3, 13):
        assert host.step(i * DT, DT) == OK, host.log[-1]
        seen.append(host.get("p", 3))
    return seen


def resealed(data: bytes) -> bytes:
    """Return a serialised state that was changed with the digest that fits, as another writer would give it."""
    head = 64
    return data[: head - 8] + struct.pack("=Q", digest(data[: head - 8] + bytes(8), data[head:])) + data[head:]


@pytest.mark.parametrize("fmi", [2, 3])
def test_what_follows_a_restored_state_is_the_same_bit_for_bit(workshop: Workshop, fmi: int):
    host = ready(workshop, fmi)
    state = save(host)
    first = ten_steps(host)
    assert host.call(called(host, "SetFMUstate"), state) == OK
    assert ten_steps(host) == first
    assert host.call(called(host, "FreeFMUstate"), ctypes.byref(state)) == OK
    assert state.value is None


@pytest.mark.parametrize("fmi", [2, 3])
def test_a_serialised_state_continues_in_another_instance(workshop: Workshop, fmi: int):
    host, other = ready(workshop, fmi), workshop.host("every_kind:EveryKind", fmi)
    host.set("v", [3.0, 2.0, 1.0])
    data = serialised(host, save(host))
    status, state = deserialise(other, data)
    assert status == OK
    assert other.call(called(other, "SetFMUstate"), state) == OK
    assert ten_steps(other) == ten_steps(host)


def test_a_state_saved_while_initialising_rolls_back_to_initialising(workshop: Workshop):
    host = workshop.host("every_kind:EveryKind", 3)
    host.enter()
    host.set("gain", [4.0])
    state = save(host)
    host.call("ExitInitializationMode")
    first = host.get("p", 3)
    assert host.call("SetFMUState", state) == OK
    assert host.step(0.0, DT) == ERROR
    assert host.call("ExitInitializationMode") == OK
    assert (host.get("b"), host.get("p", 3)) == ([2.0], first)


def test_a_saved_state_revives_a_failed_instance(workshop: Workshop):
    host = ready(workshop, 3)
    state = save(host)
    first = ten_steps(host)
    host.call("SetFMUState", state)
    host.set("a", [666.0])
    assert host.step(3 * DT, DT) == ERROR
    assert host.call("SetFMUState", state) == OK
    assert ten_steps(host) == first


def test_saving_again_uses_the_same_state(workshop: Workshop):
    host = ready(workshop, 3)
    state = save(host)
    before = state.value
    ten_steps(host)
    assert host.call("GetFMUState", ctypes.byref(state)) == OK
    assert state.value == before
    assert host.step(13 * DT, DT) == OK


@pytest.mark.parametrize("damage", [b"", b"x" * 10, b"x" * 500])
def test_bytes_that_are_no_state_are_refused(workshop: Workshop, damage: bytes, wording: Wording):
    host = ready(workshop, 3)
    assert deserialise(host, damage)[0] == ERROR
    wording.check(host.log[-1])


@pytest.mark.parametrize("fmi", [2, 3])
def test_a_serialised_state_with_flipped_bits_is_refused(workshop: Workshop, fmi: int):
    host = ready(workshop, fmi)
    good = serialised(host, save(host))
    assert resealed(good) == good
    for bits in [(7, 71), *((bit,) for bit in range(0, 8 * len(good), 97))]:
        damaged = bytearray(good)
        for bit in bits:
            damaged[bit // 8] ^= 1 << bit % 8
        assert deserialise(host, bytes(damaged))[0] == ERROR
    assert "changed since" in host.log[-1]
    assert deserialise(host, good)[0] == OK


def test_a_foreign_state_is_refused_when_set(workshop: Workshop, wording: Wording):
    host, other = ready(workshop, 3), workshop.host("scalars:Scalars", 3)
    other.initialise()
    data = serialised(host, save(host))
    status, state = deserialise(other, data)
    assert status == OK
    assert other.call("SetFMUState", state) == ERROR
    wording.check(other.log[-1])
    assert other.step(0.0, DT) == OK


def test_a_state_with_a_parameter_out_of_range_changes_nothing(workshop: Workshop, wording: Wording):
    host, other = ready(workshop, 3), ready(workshop, 3)
    expected = ten_steps(ready(workshop, 3))
    data = serialised(host, save(host)).replace(struct.pack("d", 2.0), struct.pack("d", 12.0), 1)
    state = deserialise(other, resealed(data))[1]
    assert other.call("SetFMUState", state) == ERROR
    wording.check(other.log[-1])
    assert ten_steps(other) == expected


def test_an_instance_whose_block_fails_to_take_a_state_has_failed(workshop: Workshop, wording: Wording):
    host, other = ready(workshop, 3), ready(workshop, 3)
    data = serialised(host, save(host))
    state = deserialise(other, resealed(data[:-40] + bytes(40)))[1]
    assert other.call("SetFMUState", state) == ERROR
    assert other.step(3 * DT, DT) == ERROR
    wording.check(other.log[-1])
    assert other.call("SetFMUState", deserialise(other, data)[1]) == OK
    assert ten_steps(other) == ten_steps(host)


def test_a_freed_state_and_one_of_another_instance_are_refused(workshop: Workshop, wording: Wording):
    host, other = ready(workshop, 3), ready(workshop, 3)
    state = save(host)
    assert other.call("SetFMUState", state) == ERROR
    gone = ctypes.c_void_p(state.value)
    host.call("FreeFMUState", ctypes.byref(state))
    assert host.call("SetFMUState", gone) == ERROR
    wording.check(host.log[-1])
    assert host.call("FreeFMUState", ctypes.byref(ctypes.c_void_p())) == OK
