"""A campaign on a disk that is full ends in one line, with status 3, and the same call goes on."""

import contextlib
import errno
import os
from collections.abc import Generator
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result
from own_crew import OwnCrew

from scenarios.campaign import dask_crew
from scenarios.campaign.cluster_crew import ClusterCrew
from scenarios.campaign.crew import Crew
from scenarios.campaign.run_order import RunOrder
from scenarios.command import main

CALL = ["sweep", "ir_grasp", "-p", "strategy=forward", "--out", "c", "--no-report", "--workers", "2"]
BEGINNING = "1 run of ir_grasp on 2 workers into c\n"


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def sweep(monkeypatch: pytest.MonkeyPatch, crew: Crew) -> Result:
    """Return how the command ended with a crew."""

    @contextlib.contextmanager
    def given(_workers: int | None) -> Generator[Crew, None, None]:
        yield crew

    monkeypatch.setattr(dask_crew, "embedded_crew", given)
    return CliRunner().invoke(main, CALL)


def interrupt(_order: RunOrder) -> str:
    raise KeyboardInterrupt


class UnaskedCrew(ClusterCrew):
    """Workers that have nothing against anything."""

    def __init__(self) -> None:
        super().__init__(None, "nowhere")  # type: ignore[arg-type]

    def _ask(self, function: Any, *arguments: str) -> dict[str, Any]:
        return {}


def test_a_mark_for_workers_that_cannot_be_written_is_told(here: Path, monkeypatch: pytest.MonkeyPatch):
    """It is the first that a campaign which goes on writes."""
    assert sweep(monkeypatch, OwnCrew(interrupt)).exit_code == 1
    before = sorted(here.rglob("*"))

    def refuse(file: Path, *_text: Any, **_options: Any) -> None:
        file.touch()  # a name takes no room
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(file))

    monkeypatch.setattr(Path, "write_text", refuse)
    result = sweep(monkeypatch, UnaskedCrew())
    told = f"{BEGINNING}Error: c cannot be written: No space left on device\n"
    assert (result.exit_code, result.output) == (3, told)
    assert sorted(here.rglob("*")) == before
