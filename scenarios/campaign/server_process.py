"""A run server, seen from the worker that uses it."""

import contextlib
import os
import pickle
import queue
import shutil
import subprocess
import sys
import tempfile
import threading
import uuid
from collections.abc import Callable
from pathlib import Path
from typing import Any, BinaryIO, cast

from handover.scenarios.campaign.run_order import RunAnswer, RunOrder

_LOOK = 0.5
"""How often it is asked whether a run is still wanted, s."""

_GRACE = 5.0
"""How long a server gets to end its run and remove what it left, s."""

_ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OPENCV_FOR_THREADS_NUM")
"""Runs go on side by side: each has one core."""


class ServerLost(Exception):
    """The server has ended without an answer."""


class NotWanted(Exception):
    """The run was ended, as nobody waits for it any more."""


class ServerProcess:
    """A process of `handover.scenarios.campaign.run_server`. It ends when this process does, however that ends.

    It hears of no Ctrl-C: whoever started the campaign does, and ends it.
    """

    def __init__(self) -> None:
        self._errors = tempfile.TemporaryFile()  # noqa: SIM115 (as long as the process)
        places = [p for p in sys.path if p]
        alike = {"PYTHONPATH": os.pathsep.join(places), "PYTHONSAFEPATH": "1"}
        self._process = subprocess.Popen(
            [sys.executable, "-m", "handover.scenarios.campaign.run_server"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._errors,
            env={**os.environ, **alike, **dict.fromkeys(_ONE_THREAD, "1")},
            start_new_session=True,
        )
        self._answers: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._listening = threading.Thread(target=self._listen, daemon=True)
        self._listening.start()

    @property
    def pid(self) -> int:
        """Its number."""
        return self._process.pid

    @property
    def lives(self) -> bool:
        """Whether it can be given orders."""
        return self._process.poll() is None

    def carry_out(self, order: RunOrder, wanted: Callable[[], bool]) -> RunAnswer:
        """Carry out an order.

        Raises:
            ServerLost: the server has died, or was about to end. NotWanted: `wanted` says so; the server has ended.
        """
        folder = Path(order.runs, f".{order.name}.{uuid.uuid4().hex[:12]}")
        try:
            try:
                pickle.dump((order, folder), self._orders)
                self._orders.flush()
            except (OSError, ValueError) as e:
                raise ServerLost(self._last_words()) from e
            while True:
                lives = self.lives
                with contextlib.suppress(queue.Empty):
                    answer = self._answers.get(timeout=_LOOK)
                    if answer is None:
                        raise ServerLost(self._last_words())
                    return answer
                if not lives:
                    raise ServerLost(self._last_words())
                if not wanted():
                    raise NotWanted
        except BaseException:
            self.end()
            shutil.rmtree(folder, ignore_errors=True)
            raise

    def ask_to_end(self) -> None:
        """Let it end, without waiting for that."""
        with contextlib.suppress(OSError, ValueError):
            self._orders.close()

    def end(self) -> None:
        """End it, and the run that it carries out, which leaves nothing."""
        self.ask_to_end()
        try:
            self._process.wait(_GRACE)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._listening.join(_GRACE)  # its run dies after it, and writes until then

    @property
    def _orders(self) -> BinaryIO:
        return cast(BinaryIO, self._process.stdin)

    def _listen(self) -> None:
        """Take answers until both the server and the run that it carries out have ended."""
        answers = cast(BinaryIO, self._process.stdout)
        with contextlib.suppress(EOFError, OSError, pickle.UnpicklingError):  # it has ended, maybe amid an answer
            while True:
                self._answers.put(pickle.load(answers))
        self._answers.put(None)
        answers.close()

    def _last_words(self) -> str:
        """Return how the server ended."""
        status = self._process.wait()
        self._errors.seek(0)
        lines = self._errors.read().decode("utf-8", "replace").split("\n")
        said = next((f": {line.strip()}" for line in reversed(lines) if line.strip()), "")
        return f"its run server ended with status {status}{said}"
