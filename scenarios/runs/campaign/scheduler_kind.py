"""Asks a server in Dask's protocol what it is: scheduler, worker or nanny. Importing this module loads Dask."""

import asyncio
from typing import Any, cast

from distributed.comm.registry import backends
from distributed.core import rpc
from distributed.security import Security

from handover.scenarios.runs.campaign.cluster import call_with_timeout

PROTOCOLS = tuple(p for p in backends if p != "inproc")
"""Protocols that Dask has here."""


def kind_at(address: str, connect: float, answer: float) -> str:
    """Return what is at an address, such as "Scheduler".

    Args:
        address: with its protocol.
        connect: how long the connection may take, s.
        answer: how long it may take until the answer, s.

    Raises:
        TimeoutError, asyncio.TimeoutError, OSError: it cannot be reached, or does not answer.
    """
    return call_with_timeout(lambda: asyncio.run(asyncio.wait_for(_kind(address, connect), answer)), connect + answer)


async def _kind(address: str, connect: float) -> str:
    arguments = cast("dict[str, Any]", Security().get_connection_args("client"))
    async with rpc(address, timeout=connect, connection_args=arguments) as server:
        identity = cast("dict[str, Any]", await server.identity())
        return str(identity["type"])
