"""The process that serves a live page, beside the run's own."""

import contextlib
import os
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Generator, Mapping
from dataclasses import dataclass
from pathlib import Path

from handover.cosim.files import scratch_folder
from handover.cosim.master.live_control import LiveControl
from handover.cosim.python_process import module_command
from handover.cosim.system.time_series import ExternalSource
from handover.scenarios.experiment.live_inputs import LedHand
from handover.scenarios.live.shared_inputs import SharedInputs
from handover.scenarios.live.shared_pictures import PictureWriter

HOST = "127.0.0.1"
CONTROL_FILE = "control"
"""Name of the file of a run's controls, in a folder of both processes."""
_PUSHES_FILE, _HAND_FILE = "pushes", "hand"
PICTURE_FILE = "pictures"
"""Name of the file of a run's camera pictures, in that folder."""
_PATIENCE = 10.0
"""How long the server may take to tell the pages of the end, s."""


@dataclass(frozen=True)
class PageInputs:
    """Inputs of a run that its page sets, and pictures that it shows, in files of both processes.

    Attributes:
        folder: of both processes.
        pushes: forces and points of bodies that are pushed; None where none can be.
        hand: the samples of a hand that is led, which have an age of their own; None where there is none.
    """

    folder: Path | None = None
    pushes: SharedInputs | None = None
    hand: SharedInputs | None = None

    @property
    def pictures(self) -> PictureWriter | None:
        """What shows the run's camera pictures to the page, as an observer of the run."""
        return None if self.folder is None else PictureWriter(self.folder / PICTURE_FILE)

    @classmethod
    def create(cls, folder: Path, pushes: Mapping[str, int], hand: LedHand | None) -> "PageInputs":
        """Make the files of those that there are.

        Args:
            folder: of both processes.
            pushes: names and sizes of the inputs of bodies that can be pushed.
            hand: the one that can be led.
        """
        return cls(
            folder,
            SharedInputs.create(folder / _PUSHES_FILE, pushes) if pushes else None,
            SharedInputs.create(folder / _HAND_FILE, hand.inputs, [hand.age]) if hand is not None else None,
        )

    @classmethod
    def open(cls, folder: Path) -> "PageInputs":
        """Return those that another process has made in a folder."""
        shared = [SharedInputs(folder / f) if (folder / f).is_file() else None for f in (_PUSHES_FILE, _HAND_FILE)]
        return cls(folder, *shared)

    def sources(self) -> dict[str, ExternalSource]:
        """Return who gives values to the inputs, by their names."""
        return {name: source for inputs in self._shared for name, source in inputs.sources().items()}

    def let_go(self) -> None:
        """Push nothing any more."""
        if self.pushes is not None:
            self.pushes.set({name: [0.0] * size for name, size in self.pushes.sizes.items()}, time.monotonic())

    def close(self) -> None:
        """Release the files."""
        for inputs in self._shared:
            inputs.close()

    @property
    def _shared(self) -> list[SharedInputs]:
        return [inputs for inputs in (self.pushes, self.hand) if inputs is not None]


@contextlib.contextmanager
def live_page(
    folder: Path,
    pace: float,
    pushes: Mapping[str, int],
    hand: LedHand | None = None,
    webcam: Path | None = None,
    scenario: str = "",
) -> Generator[tuple[str, LiveControl, PageInputs], None, None]:
    """Serve the page of a run that will write a folder; at the end, wait until its end has been sent to the pages.

    Args:
        folder: the run's.
        pace: simulated seconds per second of wall time at first.
        pushes: names and sizes of the inputs of bodies that the page may push.
        hand: what the page, or a tracker, may lead.
        webcam: folder of the files by which a webcam leads it; None where it is not offered.
        scenario: path of the class of the run's scenario, which the page's process imports; "" for this package's.

    Yields:
        The page's address, the run's controls, and the inputs that the page sets. The run is paused until a page is
        open.
    """
    with contextlib.ExitStack() as opened:
        scratch = opened.enter_context(scratch_folder("live"))
        control = LiveControl.create(scratch / CONTROL_FILE, pace, paused=True)
        opened.callback(control.close)
        inputs = PageInputs.create(scratch, pushes, hand)
        opened.callback(inputs.close)
        listening = opened.enter_context(socket.create_server((HOST, 0)))
        number = listening.fileno()
        given = [str(folder), str(scratch), str(number), scenario, *([] if webcam is None else [str(webcam)])]
        command = module_command("handover.scenarios.live", *given)
        server = subprocess.Popen(command, pass_fds=(number,), stdin=subprocess.PIPE)  # by its end it sees this one's
        assert server.stdin is not None
        opened.callback(server.stdin.close)
        over = threading.Event()
        threading.Thread(target=_let_go_without, args=(server, control, inputs, over), daemon=True).start()
        try:
            yield f"http://{HOST}:{listening.getsockname()[1]}/", control, inputs
            over.set()
            with contextlib.suppress(subprocess.TimeoutExpired):
                server.wait(_PATIENCE)
        finally:
            over.set()
            server.kill()
            server.wait()


def _let_go_without(
    server: "subprocess.Popen[bytes]", control: LiveControl, inputs: PageInputs, over: threading.Event
) -> None:
    """If the page's server fails before the run has ended, release all pushes and resume a paused run."""
    if server.wait() == 0 or over.is_set():  # by itself it ends after the run
        return
    inputs.let_go()
    if control.paused:
        control.paused = False
        print("the live page has ended; the run goes on without it", file=sys.stderr)


@contextlib.contextmanager
def controlled_from(
    folder: Path, pushes: Mapping[str, int], hand: LedHand | None
) -> Generator[tuple[LiveControl, PageInputs], None, None]:
    """Give the controls that another process, which began this one, has made in a folder; and inputs that it sets.

    The run ends after its step where that process ends: then the standard input, a pipe from it, is closed.
    """
    control = LiveControl(folder / CONTROL_FILE)
    threading.Thread(target=_stop_with_standard_input, args=(control,), daemon=True).start()
    inputs = PageInputs.create(folder, pushes, hand)
    try:
        yield control, inputs
    finally:
        inputs.close()
        control.close()


def _stop_with_standard_input(control: LiveControl) -> None:
    wait_for_end_of_input()
    control.stop, control.paused = True, False


def wait_for_end_of_input() -> None:
    """Return once the standard input is closed, a pipe from the process that began this one: so that has ended."""
    with contextlib.suppress(OSError):
        while os.read(0, 64):
            pass
