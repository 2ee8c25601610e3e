"""Folders of runs as a kill leaves them: copied at a communication point of a run that goes no further."""

import contextlib
import shutil
import tempfile
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path
from typing import TextIO
from unittest import mock

from click.testing import CliRunner

from handover.scenarios.cli.command import main


def killed_run(folder: Path, passed: float, *arguments: object) -> Path:
    """Leave what a run of `handover ARGUMENTS` has written once a simulated time, s, has passed, and return its folder.

    What a kill in the midst of writing leaves needs a real one.
    """

    class Killed(BaseException):
        pass

    with tempfile.TemporaryDirectory() as place:
        out = Path(place) / "run"

        def end(t: float, _end: float) -> None:
            if t >= passed:
                shutil.copytree(out, folder)
                raise Killed

        @contextmanager
        def ending(stream: TextIO) -> Generator[Callable[[float, float], None], None, None]:
            del stream
            yield end

        with mock.patch("handover.scenarios.cli.run.progress_bar", ending), contextlib.suppress(Killed):
            done = CliRunner().invoke(main, [*map(str, arguments), "--out", str(out)])
            raise AssertionError(f"the run ended before {passed:g} s: {done.output}")
    return folder
