"""Commands that serve a page, `run --live`, `play` and `study serve`, and their page in a browser or on a socket."""

import json
import re
import signal
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import psutil
from playwright.sync_api import Browser, Page
from websockets.sync.client import ClientConnection, connect

from support.commands import Command
from support.opened_page import wait_until

LIVE = "document.querySelector('.live')"
TOLD = "document.querySelector('.replay-told').value"

_PATIENCE = 300.0
"""s; other tests may be using all of the machine."""


@contextmanager
def page_command(*arguments: object, cwd: Path | None = None) -> Generator[tuple[str, Command], None, None]:
    """Begin a command that serves a page; yield the page's address and the command, which is ended if it goes on."""
    command = Command(*arguments, cwd=cwd)
    try:
        yield _address(command), command
    except BaseException:
        print(f"its standard error: {command.errors_file.read_text('utf-8') if command.errors_file.exists() else ''}")
        raise
    finally:
        if command.poll() is None:
            command.send_signal(signal.SIGTERM)
        if command.join(_PATIENCE) is None:
            command.send_signal(signal.SIGKILL)


@contextmanager
def live_run(out: Path, *more: object, scenario: object = "ir_grasp") -> Generator[tuple[str, Command], None, None]:
    """Begin a run that waits for its page; yield the page's address and the run."""
    with page_command("run", scenario, "--live", "--no-report", "--out", out, *more) as begun:
        yield begun


@contextmanager
def shown(
    browser: Browser, address: str, width: int = 640, height: int = 480, *, has_touch: bool = False, script: str = ""
) -> Generator[Page, None, None]:
    """Open the page; a script runs before its own. A small page costs little: software draws it."""
    page = browser.new_page(viewport={"width": width, "height": height}, has_touch=has_touch)
    page.add_init_script(script)
    page.set_default_timeout(1000 * _PATIENCE)
    messages: list[str] = []
    page.on("pageerror", lambda error: messages.append(str(error)))
    page.goto(address)
    page.wait_for_selector(".live")  # before that, a page that loads itself again until the run has begun
    try:
        yield page
        assert messages == []
    finally:
        page.close()


@contextmanager
def connected(address: str, path: str = "run", **options: Any) -> Generator[ClientConnection, None, None]:
    """Connect to what a page connects to, as the page or, without an origin, as a device does."""
    host = address.removeprefix("http://").rstrip("/")
    own = {"origin": f"http://{host}"} if path == "run" else {}
    given: dict[str, Any] = {"open_timeout": _PATIENCE, "max_size": None, **own, **options}
    with connect(f"ws://{host}/{path}", **given) as made:
        yield made


def reported(page: ClientConnection, name: str) -> Any:
    """Return the next message of a name; frames and messages of other names are passed over."""
    while True:
        got = page.recv(timeout=_PATIENCE)
        if isinstance(got, str) and name in (content := json.loads(got)):
            return content[name]


def frame(page: ClientConnection) -> bytes:
    """Return the next frame of what is drawn."""
    while isinstance(got := page.recv(timeout=_PATIENCE), str):
        pass
    return got


def send(page: ClientConnection, command: str, value: object = None) -> None:
    """Send a command of the page."""
    page.send(json.dumps({"command": command, "value": value}))


def frames_come(page: Page, more: int = 3) -> None:
    """Wait until some more frames of the run have come to a browser's page."""
    before = page.evaluate(f"Number({LIVE}.dataset.frames ?? 0)")
    wait_until(page, f"{LIVE}.dataset.frames > {before + more}")


def time_passes(page: Page, seconds: float) -> None:
    """Wait until so much simulated time has passed, s."""
    wait_until(page, f"parseFloat({TOLD}) >= 0")
    since = float(page.evaluate(f"parseFloat({TOLD})"))
    wait_until(page, f"parseFloat({TOLD}) > {since + seconds}")


def process_with(command: Command, argument: str) -> psutil.Process:
    """Return the process below a command's that was called with an argument."""
    (found,) = [p for p in psutil.Process(command.pid).children(recursive=True) if argument in p.cmdline()]
    return found


def _address(command: Command) -> str:
    """Return the address that a command tells."""
    while True:
        ended = command.poll()
        if address := re.search(r"\w+: (http://\S+)", command.errors_file.read_text("utf-8")):
            return address[1]
        assert ended is None, f"it ended before it printed its address:\n{command.wait().errors}"
        command.join(0.05)
