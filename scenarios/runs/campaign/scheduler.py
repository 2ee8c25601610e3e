"""Checks the address of a Dask scheduler: its form, whether something answers there, and whether that is a scheduler.

`probe_port` finds out the most frequent mistakes within seconds and without loading Dask; `scheduler_address` then asks
in Dask's own protocol.
"""

import asyncio
import socket
from urllib.parse import urlsplit

from handover.cosim.exceptions import one_line
from handover.scenarios.runs.execution.errors import PoolError

_CONNECT_TIMEOUT, _GREETING_TIMEOUT = 3.0, 3.0
"""How long a plain connection to a server may take, and how long its first byte, s."""

RIGHT = "expected tcp://HOST:PORT, as `dask scheduler` prints it"


def probe_port(address: str, host: str, port: int) -> None:
    """Wait for the greeting that a scheduler sends, over plain TCP, to whoever connects.

    Most other servers wait to be spoken to.

    Args:
        address: as error messages name it.
        host: name or number of the machine.
        port: TCP port.

    Raises:
        PoolError: nothing listens there, or it sends nothing.
    """
    try:
        with socket.create_connection((host, port), timeout=_CONNECT_TIMEOUT) as connection:
            connection.settimeout(_GREETING_TIMEOUT)
            greeted = bool(connection.recv(1))
    except TimeoutError as e:
        raise PoolError(f"{address} does not answer as a Dask scheduler within {_GREETING_TIMEOUT:g} s; {RIGHT}") from e
    except OSError as e:
        raise PoolError(f"no scheduler can be reached at {address}: {one_line(e)}; {RIGHT}") from e
    if not greeted:
        raise PoolError(f"{address} is not a Dask scheduler: it hangs up; {RIGHT}")


_DASK_CONNECT_TIMEOUT, _ANSWER_TIMEOUT = 4.0, 5.0
"""How long a connection in Dask's protocol may take, and how long until the answer, s."""


def scheduler_address(text: str) -> str:
    """Return the complete address, with its protocol, of a scheduler that has answered.

    Raises:
        PoolError: the address is malformed, nothing answers there, or something else than a scheduler.
    """
    address, host, port = _parts(text)
    if address.startswith("tcp:"):
        probe_port(address, host, port)
    from handover.scenarios.runs.campaign.scheduler_kind import kind_at  # loads Dask

    try:
        kind = kind_at(address, _DASK_CONNECT_TIMEOUT, _ANSWER_TIMEOUT)
    except (asyncio.TimeoutError, TimeoutError) as e:  # type: ignore  # one class from Python 3.11 on
        raise PoolError(f"{address} does not answer as a Dask scheduler within {_ANSWER_TIMEOUT:g} s; {RIGHT}") from e
    except OSError as e:
        raise PoolError(f"no scheduler can be reached at {address}: {one_line(e)}; {RIGHT}") from e
    except Exception as e:  # bytes of another protocol may raise anything
        raise PoolError(f"{address} is not a Dask scheduler: {one_line(e)}; {RIGHT}") from e
    if kind != "Scheduler":
        raise PoolError(f"{address} is a {kind}, not a scheduler; {RIGHT}")
    return address


def _parts(text: str) -> tuple[str, str, int]:
    """Return an address with its protocol, its host and its port."""
    address = text if "://" in text else f"tcp://{text}"
    try:
        parts = urlsplit(address)
        port = parts.port
    except ValueError as e:
        raise PoolError(f"scheduler {text!r}: {one_line(e)}; {RIGHT}") from e
    if parts.scheme != "tcp":
        _check_protocol(text, address)
    if not parts.hostname or not port:
        raise PoolError(f"scheduler {text!r} has no {'port' if parts.hostname else 'host'}; {RIGHT}")
    return address, parts.hostname, port


def _check_protocol(text: str, address: str) -> None:
    from handover.scenarios.runs.campaign.scheduler_kind import PROTOCOLS  # loads Dask

    protocol = address.partition("://")[0].lower()
    if protocol not in PROTOCOLS:
        raise PoolError(f"scheduler {text!r}: there is no protocol {protocol!r}, only {', '.join(PROTOCOLS)}")
