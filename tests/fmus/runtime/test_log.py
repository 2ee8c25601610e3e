"""What is logged for a host, and which categories it can choose."""

import ctypes
import json

import pytest
from support.fmus.ctypes_host import ERROR, OK, SIZE, CtypesHost
from support.fmus.workshop import Workshop, expect_error
from support.sample_units.trouble import Deed
from support.wording import Wording

from handover.cosim.exceptions import InitializationError
from handover.cosim.master.master import Master
from handover.cosim.system.system import System

BLOCK = "every_kind:EveryKind"

both = pytest.mark.parametrize("fmi", [2, 3])


def choose(host: CtypesHost, on: bool, *categories: bytes) -> int:
    flag = ctypes.c_bool(on) if host.fmi == 3 else ctypes.c_int(on)
    return host.call("SetDebugLogging", flag, SIZE(len(categories)), (ctypes.c_char_p * len(categories))(*categories))


@both
def test_messages_have_the_instances_name_in_fmi_3_and_beside_them_in_fmi_2(
    workshop: Workshop, fmi: int, wording: Wording
):
    host = workshop.host(BLOCK, fmi)
    choose(host, True)
    assert host.initialise() == OK
    wording.check(host.log[-1])
    expect_error(wording, host, host.step(7.0, 0.1))
    host.set("a", [666.0])
    assert host.step(0.0, 0.1) == ERROR
    wording.check(host.log[-1].partition("\n")[0])
    assert host.names == (["x"] * 3 if fmi == 2 else [])


def test_a_long_traceback_keeps_its_end_within_what_hosts_of_fmi_2_print(workshop: Workshop):
    messages: dict[int, str] = {}
    for fmi in (2, 3):
        host = workshop.host("trouble:Trouble", fmi)
        assert host.initialise() == OK
        assert host.put("Integer", "deed", Deed.FAIL_DEEP_DOWN) == OK
        assert host.step(0.0, 0.1) == ERROR
        messages[fmi] = host.log[-1]
    assert len(messages[3]) > 2048 > len(messages[2])
    assert messages[2].startswith("fmi2DoStep: Traceback")
    assert "\n  [...]\n" in messages[2]
    assert all(m.endswith("RuntimeError: the deepest reason") for m in messages.values())


ALL, ERRORS = ["logAll", "logStatusError", "logAll"], ["logStatusError"]


@both
def test_a_host_chooses_categories(workshop: Workshop, fmi: int, wording: Wording):
    for on, chosen, entries in (
        (None, (), ERRORS),
        (True, (), ALL),
        (True, (b"logAll",), ALL),
        (True, (b"logStatusWarning", b"logAll"), ALL),
        (True, (b"logStatusWarning",), ERRORS),
        (True, (b"logStatusError",), ERRORS),
        (False, (), ERRORS),
        (False, (b"logAll",), ERRORS),
    ):
        host = workshop.host(BLOCK, fmi)
        if on is not None:
            assert choose(host, not on) == choose(host, on, *chosen) == OK
        assert host.initialise() == OK
        assert host.step(7.0, 0.1) == ERROR
        assert host.call("Terminate") == OK
        assert host.categories == entries
    host = workshop.host(BLOCK, fmi)
    assert choose(host, True) == OK
    expect_error(wording, host, choose(host, True, b"logStatusWarning", b"logWeather"))
    assert host.initialise() == OK
    assert host.categories[-1] == "logAll"


@both
def test_a_warning_is_reported_while_logging_is_on(workshop: Workshop, fmi: int):
    host = workshop.own(BLOCK, fmi)
    file = host.folder / "resources" / "unit.json"
    unit = json.loads(file.read_text())
    unit["packages"] = [{"module": "numpy", "distribution": "numpy", "version": "99999.0"}]
    file.write_text(json.dumps(unit))
    for host.logging in (False, True):
        assert host.instantiate(), host.log
        assert host.categories == ["logStatusWarning"] * host.logging
        host.free()


@both
def test_our_own_master_says_a_units_name_once(workshop: Workshop, fmi: int, wording: Wording):
    s = System()
    s.add("walker", workshop.fmu(BLOCK, fmi), gain=10.0, a=1e308)
    with pytest.raises(InitializationError) as raised, Master(s):
        pass
    wording.check(raised.value)
    wording.check(raised.value.failure.log[-1])
