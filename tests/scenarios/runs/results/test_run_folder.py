import contextlib
import importlib.metadata
import json
import multiprocessing
import os
import threading
import tracemalloc
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from support.wording import Wording

from handover.scenarios.runs.results.run_facts import RunFacts
from handover.scenarios.runs.results.run_folder import (
    InvalidRunFolder,
    RunFolder,
    dated_folder,
    replacing,
    sha256_of,
    versions,
)


def test_a_folder_is_made_once_it_is_asked_for_where_there_is_nothing(tmp_path: Path):
    folder = RunFolder(tmp_path / "a" / "b")
    assert list(tmp_path.iterdir()) == []
    folder.make()
    assert folder.figures.is_dir()
    RunFolder(folder.figures).make()  # an empty one can be used


def test_what_is_written_takes_its_name_when_it_is_whole_beside_files_of_names_like_it(tmp_path: Path):
    page, other = tmp_path / "page.html", tmp_path / "page.html.part"
    other.write_text("precious")
    with replacing(page) as slow:
        slow.write_text("begun")
        with replacing(page) as quick:
            quick.write_text("of another process")
        assert page.read_text() == "of another process"
        slow.write_text("whole")
    assert {p.name: p.read_text() for p in tmp_path.iterdir()} == {"page.html": "whole", "page.html.part": "precious"}


def denied(path: Path, mode: int) -> bool:  # noqa: ARG001
    return False


def test_a_folder_that_cannot_be_a_runs_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, wording: Wording):
    (tmp_path / "mine").write_text("precious")
    for place in (tmp_path, tmp_path / "mine", tmp_path / "mine" / "below"):
        with pytest.raises(InvalidRunFolder) as refused:
            RunFolder(place)
        wording.check(refused.value)
    assert (tmp_path / "mine").read_text() == "precious"
    monkeypatch.setattr(os, "access", denied)
    with pytest.raises(InvalidRunFolder) as refused:
        RunFolder(tmp_path / "new")
    wording.check(refused.value)


def begun_in_dated_folder(place: Path, together: Callable[[], object]) -> str:
    """Begin a run, as toy, in a folder of its own, at the same time as others; return what its run.json says."""
    with contextlib.ExitStack() as opened:
        together()
        folder = RunFolder(opened.enter_context(dated_folder(place, "toy"))).claim(opened)
        folder.begin({"scenario": str(folder.path), "parameters": {}})
    return folder.read_run()["scenario"]


def test_threads_that_begin_at_once_get_a_folder_each(tmp_path: Path):
    at_once = threading.Barrier(8)
    with ThreadPoolExecutor(8) as threads:
        for turn in range(5):
            place = tmp_path / str(turn)
            found = [threads.submit(begun_in_dated_folder, place, at_once.wait) for _ in range(8)]
            assert sorted(f.result() for f in found) == sorted(map(str, place.iterdir()))


@pytest.mark.skipif(os.name == "nt", reason="needs fork")
def test_processes_that_begin_at_once_get_a_folder_each(tmp_path: Path):
    of_fork = multiprocessing.get_context("fork")
    at_once = of_fork.Barrier(4)
    processes = [of_fork.Process(target=begun_in_dated_folder, args=(tmp_path / "runs", at_once.wait)) for _ in "abcd"]
    for process in processes:
        process.start()
    for process in processes:
        process.join()
    folders = list((tmp_path / "runs").iterdir())
    assert len(folders) == 4
    assert {RunFolder.of_run(f).read_run()["scenario"] for f in folders} == {str(f) for f in folders}


def test_of_two_runs_with_one_new_folder_the_second_is_refused(tmp_path: Path):
    out = tmp_path / "a" / "b"
    first, second = RunFolder(out), RunFolder(out)
    with contextlib.ExitStack() as opened:
        first.claim(opened)
        with contextlib.ExitStack() as others, pytest.raises(InvalidRunFolder, match=f"process {os.getpid()}"):
            second.claim(others)
        first.begin({})
        with contextlib.ExitStack() as others, pytest.raises(InvalidRunFolder, match="not empty"):
            second.claim(others)
    assert [f.name for f in out.iterdir()] == ["run.json"]


def test_a_run_that_is_refused_leaves_no_folder(tmp_path: Path):
    with contextlib.ExitStack() as opened:
        RunFolder(opened.enter_context(dated_folder(tmp_path / "runs", "toy"))).claim(opened)
        RunFolder(tmp_path / "a" / "b").claim(opened)
        assert len(list(tmp_path.iterdir())) == 2
    assert list(tmp_path.iterdir()) == []


def test_a_package_that_is_not_installed_is_reported(monkeypatch: pytest.MonkeyPatch):
    def missing(package: str) -> str:
        raise importlib.metadata.PackageNotFoundError(package)

    monkeypatch.setattr(importlib.metadata, "version", missing)
    assert versions()["exudyn"] == "not installed"


@pytest.mark.parametrize(
    ("file", "change"),
    [
        ("run.json", {"scenario": 1}),
        ("run.json", {"parameters": []}),
        ("run.json", {"checkpoint": "-1"}),
        ("run.json", {"checkpoint": "1/0"}),
        ("run.json", {"seed": 10**310}),
        ("run.json", {"formats": [".../../x"]}),
        ("run.json", {"files": {"arm": "\0"}}),
        ("run.json", {"told_parameters": [["a", "b"]]}),
        ("run.json", {"system": {"connections": [{"source": "a", "target": "b.c"}]}}),
        ("run.json", {"experiment": {"stop": "soon"}}),
        ("summary.json", {"success": "yes"}),
        ("summary.json", {"metrics": {"error": {"value": "1", "unit": "m"}}}),
        ("summary.json", {"simulated_seconds": "long"}),
        ("summary.json", {"units": [{"name": "arm"}]}),
        ("summary.json", {"warnings": [{"instance": "arm", "calls": 3, "time": 0.0, "message": ""}]}),
        ("summary.json", {"pace": {"pace": 1.0}}),
    ],
)
def test_a_damaged_file_is_refused(tmp_path: Path, file: str, change: dict[str, object]):
    contents: dict[str, dict[str, object]] = {
        "run.json": {"scenario": "toy", "parameters": {}, "source": {}},
        "summary.json": {"success": True, "reason": "", "metrics": {}},
    }
    for name, content in contents.items():
        (tmp_path / name).write_text(json.dumps(content))
    assert RunFacts.read(RunFolder.of_run(tmp_path)).scenario == "toy"
    (tmp_path / file).write_text(json.dumps({**contents[file], **change}))
    with pytest.raises(InvalidRunFolder, match=f"its {file} is damaged"):
        RunFacts.read(RunFolder.of_run(tmp_path))


def test_a_hash_takes_no_more_memory_for_a_large_file(tmp_path: Path):
    (tmp_path / "large").touch()
    os.truncate(tmp_path / "large", 32 << 20)
    tracemalloc.start()
    try:
        assert sha256_of(tmp_path / "large").startswith("83ee47245398adee")
        assert tracemalloc.get_traced_memory()[1] < 8 << 20
    finally:
        tracemalloc.stop()
