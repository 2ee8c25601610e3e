"""The server of pages of runs and studies, with bounded requests, and how signals end it in order."""

import asyncio
import contextlib
import signal
from collections.abc import Callable, Generator

import uvicorn
from starlette.applications import Starlette

from handover.scenarios.live.connections import BACKLOG, BoundedConnection


class PageServer(uvicorn.Server):
    """A server of pages, which handles no signals itself.

    Args:
        application: what is served.
        longest: characters of the longest message that a page sends; in UTF-8 one has 4 bytes at most.
        grace: time that what is under way has to end when the server does, s.
    """

    def __init__(self, application: Starlette, longest: int, grace: int) -> None:
        config = uvicorn.Config(
            application,
            log_level="error",
            http=BoundedConnection,
            backlog=BACKLOG,
            ws="websockets-sansio",
            ws_max_size=4 * longest,
            server_header=False,
            timeout_graceful_shutdown=grace,
        )
        super().__init__(config)

    @contextlib.contextmanager
    def capture_signals(self) -> Generator[None, None, None]:
        """Handle none."""
        yield

    def end(self) -> None:
        """End in order."""
        self.should_exit = True


@contextlib.contextmanager
def ended_by_signals(end: Callable[[], None]) -> Generator[None, None, None]:
    """Call `end` in the running loop at Ctrl-C, SIGTERM and SIGHUP, but for those that the command was to ignore."""
    loop = asyncio.get_running_loop()
    handled = [s for s in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP) if signal.getsignal(s) is not signal.SIG_IGN]
    for number in handled:
        loop.add_signal_handler(number, end)
    try:
        yield
    finally:
        for number in handled:
            loop.remove_signal_handler(number)
