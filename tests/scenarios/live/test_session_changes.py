"""What a session shows changes one after the other, by however many pages it is asked at once."""

import asyncio
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import cast

import pytest

from handover.cosim.python_process import code_command
from handover.scenarios.execution.request import RunRequest
from handover.scenarios.live import play_page
from handover.scenarios.live.play_page import PlayPage, Session
from handover.scenarios.live.played_run import Choice, PlayedRun
from handover.scenarios.live.waiting_command import WaitingCommand

SCENARIO = "ir_grasp"


class Counted(PlayPage):
    """A session that counts what it shows at a time."""

    def __init__(self, session: Session) -> None:
        super().__init__(session)
        self.shows, self.most, self.begun_in_all = 0, 0, 0

    async def _replay(self, run: PlayedRun) -> None:
        assert run.number == 1
        self.shows += 1
        self.begun_in_all += 1
        self.most = max(self.most, self.shows)
        try:
            await asyncio.sleep(60.0)
        finally:
            self.shows -= 1

    async def _end_last(self) -> None:
        await asyncio.sleep(0.05)  # as a run takes time to end
        await super()._end_last()

    async def refuse_late(self, run: PlayedRun, later: dict[str, str]) -> dict[str, str]:
        """Show a run that was refused, once a later choice has faults; return all that is told."""
        self._runs.append(run)
        self._faults = later
        await self._show_run(run)
        return self._faults

    async def ask_at_once(self, run: PlayedRun) -> None:
        await asyncio.gather(*(self._show_again(run) for _ in range(3)))
        await asyncio.sleep(0.05)


class IdleCommand:
    """A command that waits for ever, without a process."""

    has_exited, last_error = True, ""

    def __init__(self, _scenario: str = "") -> None:
        self.folder, self.process = Path(tempfile.mkdtemp()), self

    def call(self, arguments: Sequence[str]) -> None:
        pass

    def kill(self) -> None:
        pass

    def close(self) -> None:
        shutil.rmtree(self.folder)


@pytest.fixture(autouse=True)
def idle(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Let no process wait for a session's next run."""
    monkeypatch.setattr(play_page, "WaitingCommand", IdleCommand)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))


def test_a_command_waits_where_pandas_is_not_installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "pandas.py").write_text("raise ModuleNotFoundError('not installed', name='pandas')\n")
    monkeypatch.syspath_prepend(tmp_path)
    assert subprocess.run(code_command("import pandas"), capture_output=True, check=False).returncode == 1
    waiting = WaitingCommand(SCENARIO)
    waiting.call(["list", "--help"])
    assert waiting.process.wait(60.0) == 0, waiting.last_error
    waiting.close()
    assert not waiting.folder.exists()


def test_of_several_runs_that_are_shown_again_at_once_the_last_one_is_shown_alone(tmp_path: Path):
    session = Session("", RunRequest(subject=SCENARIO), [], [], False, False, [], tmp_path, 2.0)

    async def work() -> None:
        page = Counted(session)
        run = PlayedRun(1, Choice(), SCENARIO, [], tmp_path / "001", 1.0, cast(WaitingCommand, IdleCommand()))
        await page.ask_at_once(run)
        page.end()
        await page.work()
        run.close()
        assert (page.most, page.shows) == (1, 0)
        assert page.begun_in_all >= 1
        assert not run.controls.exists()

    asyncio.run(work())


@pytest.mark.slow
def test_what_a_run_was_refused_for_is_told_beside_what_is_wrong_with_a_later_choice(tmp_path: Path):
    session = Session("", RunRequest(subject=SCENARIO), [], ["noise", "shift"], False, False, [], tmp_path, 2.0)

    async def work() -> dict[str, str]:
        page = Counted(session)
        waiting = WaitingCommand(SCENARIO)
        run = PlayedRun(1, Choice(parameters={"no_such": "1"}), SCENARIO, [], tmp_path / "001", 1.0, waiting)
        faults = await page.refuse_late(run, {"shift": "later"})
        run.close()
        page.end()
        await page.work()
        return faults

    faults = asyncio.run(work())
    assert faults.pop("shift") == "later"
    assert ["no_such" in text for text in faults.values()] == [True]
