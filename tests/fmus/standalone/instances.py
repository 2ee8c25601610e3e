"""Instances of one unit in one host: they share the unpacked folder and, of a unit with its interpreter, a process."""

import copy

from ctypes_host import OK, CtypesHost, Log3


def instance(host: CtypesHost) -> CtypesHost:
    """Return a host of one more instance in the same folder, which is initialised."""
    other = copy.copy(host)
    other.instance, other.log = None, []
    other.logger3 = Log3(other._take_3)  # pyright: ignore[reportPrivateUsage]
    assert other.instantiate(), other.log
    assert other.initialise() == OK, other.log
    return other


def process(host: CtypesHost) -> int:
    return int(host.get("process")[0])


def free(host: CtypesHost) -> None:
    host.call("FreeInstance")
    host.instance = None
