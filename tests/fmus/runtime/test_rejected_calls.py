"""A rejected call leaves an instance as it is, to the last byte of its state."""

import ctypes

import pytest
from support.fmus.ctypes_host import BOOL, ERROR, OK, SIZE, CtypesHost
from support.fmus.saved_states import save, serialised
from support.fmus.workshop import Workshop
from support.wording import Wording

DT = 1 / 64


def state_of(host: CtypesHost) -> bytes:
    return serialised(host, save(host))


def set_strings(host: CtypesHost, names: tuple[str, ...], values: tuple[bytes | None, ...]) -> int:
    n = len(names)
    references = (ctypes.c_uint32 * n)(*(host.references[name] for name in names))
    more = (SIZE(n),) if host.fmi == 3 else ()
    return host.call("SetString", references, SIZE(n), (ctypes.c_char_p * n)(*values), *more)


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize(
    ("bad", "said"),
    [
        (None, "NULL"),
        (b"\xff", "not UTF-8"),
        (b"\xc3", "not UTF-8"),
        (b"\xc0\x80", "not UTF-8"),
        (b"\xe0\x80\xaf", "not UTF-8"),
        (b"\xed\xa0\x80", "not UTF-8"),
        (b"\xf4\x90\x80\x80", "not UTF-8"),
        (b"a\x80", "not UTF-8"),
    ],
)
def test_strings_are_set_all_or_none(workshop: Workshop, fmi: int, bad: bytes | None, said: str):
    host = workshop.host("every_kind:EveryKind", fmi)
    assert host.initialise() == OK
    assert host.call("Reset") == OK
    before = state_of(host)
    assert set_strings(host, ("label", "word"), (b"fine", bad)) == ERROR
    assert said in host.log[-1]
    assert "'word'" in host.log[-1] or bad is None
    assert state_of(host) == before


@pytest.mark.parametrize("fmi", [2, 3])
def test_every_kind_of_character_may_be_in_a_string(workshop: Workshop, fmi: int):
    host = workshop.host("every_kind:EveryKind", fmi)
    text = "a \x7f\x80\u07ff\u0800\ud7ff\ue000\uffff\U00010000\U0010ffff"
    assert set_strings(host, ("word",), (text.encode(),)) == OK


@pytest.mark.parametrize("fmi", [2, 3])
def test_no_variables_set_is_no_change(workshop: Workshop, fmi: int):
    host = workshop.host("every_kind:EveryKind", fmi)
    assert host.initialise() == OK
    before = state_of(host)
    assert set_strings(host, (), ()) == OK
    assert host.set("a", []) == (OK if fmi == 2 else ERROR)
    assert state_of(host) == before


@pytest.mark.parametrize("fmi", [2, 3])
def test_a_step_with_an_unknown_item_of_an_enumeration_changes_nothing(workshop: Workshop, fmi: int, wording: Wording):
    host = workshop.host("every_kind:EveryKind", fmi)
    assert host.initialise() == OK
    assert host.step(0.0, DT) == OK
    reference, value = ctypes.c_uint32(host.references["mood_in"]), ctypes.c_int64(99)
    kind, more = ("Integer", ()) if fmi == 2 else ("Int64", (SIZE(1),))
    assert host.call(f"Set{kind}", ctypes.byref(reference), SIZE(1), ctypes.byref(value), *more) == OK
    before = state_of(host)
    assert host.step(DT, 2 * DT) == ERROR
    wording.check(host.log[-1])
    assert state_of(host) == before


def test_bytes_without_sizes_do_not_make_a_block(workshop: Workshop):
    host = workshop.host("eye:Eye", 3)
    flags = (BOOL(False), ctypes.c_double(0.0), ctypes.c_double(0.0), BOOL(False), ctypes.c_double(0.0))
    assert host.call("EnterInitializationMode", *flags) == OK
    before = state_of(host)
    reference, value = ctypes.c_uint32(host.references["note_back"]), ctypes.c_void_p()
    assert host.call("GetBinary", ctypes.byref(reference), SIZE(1), None, ctypes.byref(value), SIZE(1)) == ERROR
    picture = ctypes.c_uint32(host.references["picture"])
    assert host.call("SetBinary", ctypes.byref(picture), SIZE(1), (SIZE * 1)(7), (ctypes.c_char_p * 1)(b"7"), SIZE(1))
    assert state_of(host) == before
