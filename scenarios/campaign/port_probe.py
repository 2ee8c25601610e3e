"""Whether something answers at a port as Dask's schedulers do: found out in seconds, without loading Dask."""

import socket

from handover.cosim.exceptions import one_line
from handover.scenarios.campaign.bad_crew import BadCrew

_CONNECT, _GREETING = 3.0, 3.0
"""How long a server gets to be connected, and to say something, s."""

RIGHT = "tcp://HOST:PORT, as `dask scheduler` prints it, is right"


def probe_port(address: str, host: str, port: int) -> None:
    """Wait for the greeting that a scheduler sends, over plain TCP, to whoever connects.

    Most other servers wait to be spoken to.

    Args:
        address: what is told.
        host: where it is.
        port: its number there.

    Raises:
        BadCrew: nothing is there, or it says nothing.
    """
    try:
        with socket.create_connection((host, port), timeout=_CONNECT) as connection:
            connection.settimeout(_GREETING)
            greeted = bool(connection.recv(1))
    except TimeoutError as e:
        raise BadCrew(f"{address} does not answer as a Dask scheduler within {_GREETING:g} s; {RIGHT}") from e
    except OSError as e:
        raise BadCrew(f"no scheduler can be reached at {address}: {one_line(e)}; {RIGHT}") from e
    if not greeted:
        raise BadCrew(f"{address} is no Dask scheduler: it hangs up; {RIGHT}")
