"""What is logged for a host, and which categories it can choose."""

import ctypes
import json

import pytest
from support.fmus.ctypes_host import ERROR, OK, SIZE, CtypesHost
from support.fmus.workshop import Workshop
from support.sample_units.trouble import Deed

from handover.cosim.exceptions import InitializationError
from handover.cosim.master.master import Master
from handover.cosim.system.system import System

BLOCK = "every_kind:EveryKind"


def choose(host: CtypesHost, on: bool, *categories: bytes) -> int:
    flag = ctypes.c_bool(on) if host.fmi == 3 else ctypes.c_int(on)
    return host.call("SetDebugLogging", flag, SIZE(len(categories)), (ctypes.c_char_p * len(categories))(*categories))


def forget(host: CtypesHost) -> None:
    host.log.clear()
    host.categories.clear()


def test_in_fmi_3_every_message_begins_with_the_instances_name(workshop: Workshop):
    host = workshop.host(BLOCK, 3)
    choose(host, True)
    assert host.initialise() == OK
    assert host.step(7.0, 0.1) == ERROR
    host.set("a", [666.0])
    assert host.step(0.0, 0.1) == ERROR
    assert host.log[0] == "x: fmi3EnterInitializationMode: initialising at t = 0 s"
    assert host.log[1].startswith("x: fmi3DoStep: the step begins at t = 7 s")
    assert host.log[2].startswith("x: fmi3DoStep: Traceback")


def test_in_fmi_2_the_host_gets_the_name_beside_the_message(workshop: Workshop):
    host = workshop.host(BLOCK, 2)
    host.initialise()
    assert host.step(7.0, 0.1) == ERROR
    assert host.names == ["x"]
    assert host.log[0].startswith("fmi2DoStep: the step begins")


def test_a_long_traceback_keeps_its_end_within_what_hosts_of_fmi_2_print(workshop: Workshop):
    messages: dict[int, str] = {}
    for fmi in (2, 3):
        host = workshop.host("trouble:Trouble", fmi)
        assert host.initialise() == OK
        deed = (ctypes.c_uint32 * 1)(host.references["deed"])
        if fmi == 2:
            assert host.call("SetInteger", deed, SIZE(1), (ctypes.c_int * 1)(Deed.FAIL_DEEP_DOWN)) == OK
        else:
            assert host.call("SetInt64", deed, SIZE(1), (ctypes.c_int64 * 1)(Deed.FAIL_DEEP_DOWN), SIZE(1)) == OK
        assert host.step(0.0, 0.1) == ERROR
        messages[fmi] = host.log[-1]
    assert len(messages[3]) > 2048 > len(messages[2])
    assert messages[2].startswith("fmi2DoStep: Traceback")
    assert "\n  [...]\n" in messages[2]
    assert all(m.endswith("RuntimeError: the deepest reason") for m in messages.values())


def test_a_refused_kind_of_instance_is_reported_with_its_name(workshop: Workshop):
    host = workshop.host(BLOCK, 3)
    made = host.library.fmi3InstantiateModelExchange(b"me", b"", b"", False, False, None, host.logger3)
    assert not made
    assert host.log == [
        "me: fmi3InstantiateModelExchange: not supported: this unit is a co-simulation slave, it has no"
        " model-exchange form"
    ]


@pytest.mark.parametrize("fmi", [2, 3])
def test_while_logging_is_off_only_errors_are_reported(workshop: Workshop, fmi: int):
    host = workshop.host(BLOCK, fmi)
    assert host.initialise() == OK
    assert host.log == []
    assert host.step(7.0, 0.1) == ERROR
    assert host.categories == ["logStatusError"]


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize(
    ("on", "chosen", "entries"),
    [
        (True, (), ["logAll", "logStatusError", "logAll"]),
        (True, (b"logAll",), ["logAll", "logStatusError", "logAll"]),
        (True, (b"logStatusWarning", b"logAll"), ["logAll", "logStatusError", "logAll"]),
        (True, (b"logStatusWarning",), ["logStatusError"]),
        (True, (b"logStatusError",), ["logStatusError"]),
        (False, (), ["logStatusError"]),
        (False, (b"logAll",), ["logStatusError"]),
    ],
)
def test_a_host_chooses_categories(
    workshop: Workshop, fmi: int, on: bool, chosen: tuple[bytes, ...], entries: list[str]
):
    host = workshop.host(BLOCK, fmi)
    assert choose(host, not on) == OK
    assert choose(host, on, *chosen) == OK
    assert host.initialise() == OK
    assert host.step(7.0, 0.1) == ERROR
    assert host.call("Terminate") == OK
    assert host.categories == entries


@pytest.mark.parametrize("fmi", [2, 3])
def test_an_unknown_category_is_refused_with_the_known_ones_and_changes_nothing(workshop: Workshop, fmi: int):
    host = workshop.host(BLOCK, fmi)
    assert choose(host, True) == OK
    assert choose(host, True, b"logStatusWarning", b"logWeather") == ERROR
    assert "unknown log category 'logWeather'; known: logStatusError, logStatusWarning, logAll" in host.log[-1]
    forget(host)
    assert host.initialise() == OK
    assert host.categories == ["logAll"]


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("on", [True, False])
def test_a_warning_is_reported_while_logging_is_on(workshop: Workshop, fmi: int, on: bool):
    host = workshop.own(BLOCK, fmi)
    file = host.folder / "resources" / "unit.json"
    unit = json.loads(file.read_text())
    unit["packages"] = [{"module": "numpy", "distribution": "numpy", "version": "99999.0"}]
    file.write_text(json.dumps(unit))
    host.logging = on
    forget(host)
    assert host.instantiate(), host.log
    assert host.categories == (["logStatusWarning"] if on else [])


@pytest.mark.parametrize("fmi", [2, 3])
def test_our_own_master_says_a_units_name_once(workshop: Workshop, fmi: int):
    s = System()
    s.add("walker", workshop.fmu(BLOCK, fmi), gain=10.0, a=1e308)
    with pytest.raises(InitializationError) as raised, Master(s):
        pass
    call = "fmi2GetReal" if fmi == 2 else "fmi3GetFloat64"
    assert str(raised.value) == f"walker does not start: output 'b' is inf ({call} answered Error)"
    assert raised.value.failure.log[-1] == f"[Error] fmi{fmi}GetReal: output 'b' is inf".replace(
        "fmi3GetReal", "fmi3GetFloat64"
    )
