"""Saved states against the standards: freed, foreign, garbage, corrupted."""

import ctypes
import random

from support.faults.subject import Saved, Subject

GARBAGE = (1, 0xDEADBEEF, (1 << 64) - 8)


def null_state(s: Subject, rng: random.Random) -> None:
    size = ctypes.c_size_t()
    function, *more = rng.choice(
        [
            ("GetFMUState", None),
            ("SetFMUState", None),
            ("SerializedFMUStateSize", None, ctypes.byref(size)),
            ("SerializeFMUState", None, ctypes.create_string_buffer(8), 8),
            ("DeserializeFMUState", None, 100, ctypes.byref(size)),
            ("DeserializeFMUState", b"x" * 100, 100, None),
        ]
    )
    s.expect_refusal(function, *more)


def freeing_nothing(s: Subject, rng: random.Random) -> None:
    """This is legal."""
    s.demand("FreeFMUState", rng.choice([None, ctypes.byref(ctypes.c_void_p())]))


def garbage_state(s: Subject, rng: random.Random) -> None:
    refuse_pointer(s, rng.choice(GARBAGE), rng)


def freed_state(s: Subject, rng: random.Random) -> None:
    saved = s.save()
    s.forget(saved)
    refuse_pointer(s, saved.pointer, rng)


def refuse_foreign_state(s: Subject, foreign: Saved) -> None:
    """Expect that a state of another instance is rejected."""
    refuse_pointer(s, foreign.pointer, random.Random(s.answered))


def refuse_pointer(s: Subject, pointer: int, rng: random.Random) -> None:
    """Expect that a pointer is rejected that is none of this instance's states."""
    size, held = ctypes.c_size_t(), ctypes.c_void_p(pointer)
    function, *more = rng.choice(
        [
            ("GetFMUState", ctypes.byref(held)),
            ("SetFMUState", pointer),
            ("FreeFMUState", ctypes.byref(held)),
            ("SerializedFMUStateSize", pointer, ctypes.byref(size)),
            ("SerializeFMUState", pointer, ctypes.create_string_buffer(8), 8),
        ]
    )
    s.expect_refusal(function, *more)


def no_room_for_a_state(s: Subject, rng: random.Random) -> None:
    saved = s.save()
    size = ctypes.c_size_t()
    s.demand("SerializedFMUStateSize", saved.pointer, ctypes.byref(size))
    little = rng.choice([0, 1, size.value - 1])
    s.expect_refusal("SerializeFMUState", saved.pointer, ctypes.create_string_buffer(max(1, little)), little)
    s.expect_refusal("SerializeFMUState", saved.pointer, None, size.value)
    s.forget(saved)


def refuse_corrupted_state(s: Subject, good: bytes, rng: random.Random) -> None:
    """Expect that a state's bytes are rejected that are not as they were written."""
    data = bytearray(good)
    kind = rng.randrange(3)
    if kind == 0:
        del data[rng.randrange(len(data)) :]
    elif kind == 1:
        for bit in {rng.randrange(8 * len(data)) for _ in range(rng.randint(1, 8))}:
            data[bit // 8] ^= 1 << bit % 8
    else:
        at = rng.randrange(len(data))
        data[at : at + 16] = bytes(b ^ 0xA5 for b in data[at : at + 16])
    state = ctypes.c_void_p()
    s.expect_refusal("DeserializeFMUState", bytes(data), len(data), ctypes.byref(state))


REFUSALS = (null_state, freeing_nothing, garbage_state, freed_state, no_room_for_a_state)
