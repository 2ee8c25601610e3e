"""Where a Dask scheduler is, and whether it is one: found out before anything is sent to it."""

import asyncio
from typing import Any, cast
from urllib.parse import urlsplit

from distributed.comm.registry import backends
from distributed.core import rpc
from distributed.security import Security

from cosim.exceptions import one_line
from scenarios.campaign.bad_crew import BadCrew

_CONNECT, _ANSWER = 4.0, 7.0
"""How long a scheduler gets to be connected, and until it has answered, s."""

_RIGHT = "tcp://HOST:PORT, as `dask scheduler` prints it, is right"


def scheduler_address(told: str) -> str:
    """Return the whole address of a scheduler that has answered.

    Raises:
        BadCrew: the address is malformed, nothing is there, or no scheduler is.
    """
    address = _whole(told)
    try:
        kind = asyncio.run(asyncio.wait_for(_kind(address), _ANSWER))
    except (asyncio.TimeoutError, TimeoutError) as e:
        raise BadCrew(f"{address} does not answer as a Dask scheduler within {_ANSWER:g} s; {_RIGHT}") from e
    except OSError as e:
        raise BadCrew(f"no scheduler can be reached at {address}: {one_line(e)}; {_RIGHT}") from e
    except Exception as e:  # what another protocol's bytes lead to
        raise BadCrew(f"{address} is no Dask scheduler: {one_line(e)}; {_RIGHT}") from e
    if kind != "Scheduler":
        raise BadCrew(f"{address} is a {kind}, not a scheduler; {_RIGHT}")
    return address


def _whole(told: str) -> str:
    """Return an address with its protocol, after looking at its form."""
    address = told if "://" in told else f"tcp://{told}"
    try:
        parts = urlsplit(address)
        port = parts.port
    except ValueError as e:
        raise BadCrew(f"scheduler {told!r}: {one_line(e)}; {_RIGHT}") from e
    protocols = [p for p in backends if p != "inproc"]
    if parts.scheme not in protocols:
        raise BadCrew(f"scheduler {told!r}: there is no protocol {parts.scheme!r}, only {', '.join(protocols)}")
    if not parts.hostname or not port:
        raise BadCrew(f"scheduler {told!r} has no {'port' if parts.hostname else 'host'}; {_RIGHT}")
    return address


async def _kind(address: str) -> str:
    arguments = cast("dict[str, Any]", Security().get_connection_args("client"))
    async with rpc(address, timeout=_CONNECT, connection_args=arguments) as there:
        told = cast("dict[str, Any]", await there.identity())
        return str(told["type"])
