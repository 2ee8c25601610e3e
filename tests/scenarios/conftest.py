from collections.abc import Generator
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from matplotlib.figure import Figure
from playwright.sync_api import Browser
from support.kept_runs import copied_run, kept_run
from support.opened_page import launched


@pytest.fixture(scope="module")
def browser() -> Generator[Browser, None, None]:
    """Return a browser for a file's tests: as long as it is there, an event loop runs in the tests' thread."""
    with launched() as made:
        yield made


@pytest.fixture
def empty_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let files of figures be empty: drawing them takes most of the time where a test asks only which there are."""

    def save(_figure: Figure, file: Path, **_: object) -> None:
        Path(file).touch()

    monkeypatch.setattr(Figure, "savefig", save)


@pytest.fixture(scope="session")
def grasp() -> Path:
    """Return the folder of a run of `ir_grasp`, with page and figures; not to be changed."""
    return kept_run("run", "ir_grasp")


@pytest.fixture
def grasp_without_reflex(tmp_path: Path) -> Path:
    """Return such a run, without page, whose controller has recorded nothing, as one without the optional outputs."""
    copy = copied_run(tmp_path / "without_reflex", "run", "ir_grasp", "--no-report")
    table = pq.read_table(copy / "signals.parquet")
    kept = [name for name in table.column_names if not name.startswith("reflex.")]
    pq.write_table(table.select(kept), copy / "signals.parquet")
    return copy
