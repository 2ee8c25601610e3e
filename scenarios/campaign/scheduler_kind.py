"""Asks a server for what it is, in Dask's protocol."""

import asyncio
from typing import Any, cast

from distributed.comm.registry import backends
from distributed.core import rpc
from distributed.security import Security

from handover.scenarios.campaign.cluster import call_with_timeout

PROTOCOLS = tuple(p for p in backends if p != "inproc")
"""Those that Dask has here."""


def kind_at(address: str, connect: float, answer: float) -> str:
    """Return what is at an address, such as "Scheduler".

    Args:
        address: with its protocol.
        connect: how long it gets to be connected, s.
        answer: how long it gets until it has answered, s.

    Raises:
        TimeoutError, asyncio.TimeoutError, OSError: it cannot be reached, or does not answer.
    """
    return call_with_timeout(lambda: asyncio.run(asyncio.wait_for(_kind(address, connect), answer)), connect + answer)


async def _kind(address: str, connect: float) -> str:
    arguments = cast("dict[str, Any]", Security().get_connection_args("client"))
    async with rpc(address, timeout=connect, connection_args=arguments) as there:
        value = cast("dict[str, Any]", await there.identity())
        return str(value["type"])
