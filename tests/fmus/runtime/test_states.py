import ctypes
import struct

import pytest
from support.fmus.ctypes_host import ERROR, OK, CtypesHost
from support.fmus.saved_states import called, deserialise, digest, save, serialised
from support.fmus.workshop import Workshop, expect_error
from support.wording import Wording

DT = 1 / 64

both = pytest.mark.parametrize("fmi", [2, 3])


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


def restore(host: CtypesHost, state: object) -> int:
    return host.call(called(host, "SetFMUstate"), state)


@both
def test_what_follows_a_restored_state_is_the_same_bit_for_bit_in_any_instance(workshop: Workshop, fmi: int):
    host, other = ready(workshop, fmi), workshop.host("every_kind:EveryKind", fmi)
    host.set("v", [3.0, 2.0, 1.0])
    state, at = save(host), ctypes.c_void_p()
    data, at.value = serialised(host, state), state.value
    first = ten_steps(host)
    assert host.call(called(host, "GetFMUstate"), ctypes.byref(state)) == OK
    assert state.value == at.value  # saving again uses the same state
    status, read = deserialise(host, data)
    assert status == restore(host, read) == OK
    host.set("a", [666.0])
    assert host.step(3 * DT, DT) == ERROR
    assert restore(host, read) == OK  # which revives an instance that has failed
    assert ten_steps(host) == first
    assert restore(other, deserialise(other, data)[1]) == OK
    assert ten_steps(other) == first
    assert host.call(called(host, "FreeFMUstate"), ctypes.byref(state)) == OK
    assert state.value is None


def test_a_state_saved_while_initialising_rolls_back_to_initialising(workshop: Workshop):
    host = workshop.host("every_kind:EveryKind", 3)
    host.enter()
    host.set("gain", [4.0])
    state = save(host)
    host.call("ExitInitializationMode")
    first = host.get("p", 3)
    assert restore(host, state) == OK
    assert host.step(0.0, DT) == ERROR
    assert host.call("ExitInitializationMode") == OK
    assert (host.get("b"), host.get("p", 3)) == ([2.0], first)


@both
def test_bytes_that_are_no_state_or_have_flipped_bits_are_refused(workshop: Workshop, fmi: int, wording: Wording):
    host = ready(workshop, fmi)
    for damage in (b"", b"x" * 10, b"x" * 500):
        expect_error(wording, host, deserialise(host, damage)[0])
    good = serialised(host, save(host))
    assert resealed(good) == good
    for bits in [(7, 71), *((bit,) for bit in range(0, 8 * len(good), 97))]:
        damaged = bytearray(good)
        for bit in bits:
            damaged[bit // 8] ^= 1 << bit % 8
        assert deserialise(host, bytes(damaged))[0] == ERROR
    assert "changed since" in host.log[-1]
    assert deserialise(host, good)[0] == OK


def test_a_state_of_another_unit_or_instance_and_a_freed_one_are_refused(workshop: Workshop, wording: Wording):
    host, other, foreign = ready(workshop, 3), ready(workshop, 3), workshop.host("scalars:Scalars", 3)
    foreign.initialise()
    state = save(host)
    status, read = deserialise(foreign, serialised(host, state))
    assert status == OK
    expect_error(wording, foreign, restore(foreign, read))
    assert foreign.step(0.0, DT) == OK
    assert restore(other, state) == ERROR
    gone = ctypes.c_void_p(state.value)
    host.call("FreeFMUState", ctypes.byref(state))
    expect_error(wording, host, restore(host, gone))
    assert host.call("FreeFMUState", ctypes.byref(ctypes.c_void_p())) == OK


def test_a_state_with_a_parameter_out_of_range_changes_nothing(workshop: Workshop, wording: Wording):
    host, other = ready(workshop, 3), ready(workshop, 3)
    data = serialised(host, save(host)).replace(struct.pack("d", 2.0), struct.pack("d", 12.0), 1)
    expect_error(wording, other, restore(other, deserialise(other, resealed(data))[1]))
    assert ten_steps(other) == ten_steps(host)


def test_an_instance_whose_block_fails_to_take_a_state_has_failed(workshop: Workshop, wording: Wording):
    host, other = ready(workshop, 3), ready(workshop, 3)
    data = serialised(host, save(host))
    assert restore(other, deserialise(other, resealed(data[:-40] + bytes(40)))[1]) == ERROR
    expect_error(wording, other, other.step(3 * DT, DT))
    assert restore(other, deserialise(other, data)[1]) == OK
    assert ten_steps(other) == ten_steps(host)
