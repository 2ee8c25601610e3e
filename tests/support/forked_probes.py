"""Parts of a check in processes that are forked from a warm one, as each start of Python takes longer than the part.

Nor does FMPy make its grammar of names for each check anew.
"""

import contextlib
import importlib
import json
import os
import subprocess
import time
from collections.abc import Generator, Mapping, Sequence
from functools import cache
from multiprocessing import forkserver
from pathlib import Path
from types import SimpleNamespace
from typing import Any, BinaryIO
from unittest.mock import patch

from handover.cosim.probe import isolated_process
from support.commands import forking


@cache
def _lark(*given: Any, **options: Any) -> Any:
    return importlib.import_module("lark.lark").Lark(*given, **options)  # not in the processes that are forked


class ForkedProbes:
    """How probes end early: as if their time were over, once a text is in their journal and nothing comes after it."""

    hangs_after = ""


@contextlib.contextmanager
def forked_probes() -> Generator[ForkedProbes, None, None]:
    """Let checks fork their processes."""
    forking()
    forkserver.ensure_running()  # before a test gives temporary files another folder
    probes = ForkedProbes()

    def popen(command: Sequence[str], *, stdout: BinaryIO, **_options: object) -> _ForkedProbe:
        return _ForkedProbe(command, stdout, probes)

    forked = SimpleNamespace(**{**vars(subprocess), "Popen": popen})
    with patch.object(isolated_process, "subprocess", forked), patch("lark.Lark", _lark):
        yield probes


class _ForkedProbe:
    """What `run_isolated` needs of a `subprocess.Popen`."""

    def __init__(self, command: Sequence[str], stdout: BinaryIO, probes: ForkedProbes) -> None:
        module, task = command[-2:]
        self._journal, self._hangs_after = Path(json.loads(task)["journal"]), probes.hangs_after
        given = (module, task, stdout.name, dict(os.environ))
        self._process = forking().Process(target=_main, args=given)
        self._process.start()
        self.pid = self._process.pid

    def wait(self, timeout: float | None = None) -> int:
        if timeout is None:  # it was killed
            self._process.join()
        else:
            end = time.monotonic() + timeout
            while self._process.exitcode is None:
                self._process.join(0.05 if self._hangs_after else timeout)
                if self._hangs() or time.monotonic() > end:
                    raise subprocess.TimeoutExpired("probe", timeout)
        assert self._process.exitcode is not None
        return self._process.exitcode

    def _hangs(self) -> bool:
        return bool(self._hangs_after) and self._hangs_after in self._journal.read_text("utf-8").rpartition("{")[2]

    def kill(self) -> None:
        self._process.kill()


def _main(module: str, task: str, output: str, environment: Mapping[str, str]) -> None:
    os.setsid()
    os.environ.clear()
    os.environ.update(environment)
    written = os.open(output, os.O_WRONLY | os.O_APPEND)
    for opened, number in ((os.open(os.devnull, os.O_RDONLY), 0), (written, 1), (written, 2)):
        os.dup2(opened, number)
    importlib.import_module(module).main(json.loads(task))
