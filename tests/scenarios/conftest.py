import shutil
from collections.abc import Generator
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner
from opened_page import launched
from playwright.sync_api import Browser

from handover.scenarios.cli.command import main


@pytest.fixture(scope="module")
def browser() -> Generator[Browser, None, None]:
    """Return a browser for a file's tests: as long as it is there, an event loop runs in the tests' thread."""
    with launched() as made:
        yield made


@pytest.fixture(scope="session")
def grasp(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a run of `ir_grasp`; not to be changed."""
    out = tmp_path_factory.mktemp("runs") / "grasp"
    done = CliRunner().invoke(main, ["run", "ir_grasp", "--out", str(out)])
    assert done.exit_code == 0, done.output
    return out


@pytest.fixture
def grasp_without_reflex(grasp: Path, tmp_path: Path) -> Path:
    """Return a copy of that run whose controller has recorded nothing, as one without the optional outputs."""
    copy = shutil.copytree(grasp, tmp_path / "without_reflex")
    table = pq.read_table(copy / "signals.parquet")
    kept = [name for name in table.column_names if not name.startswith("reflex.")]
    pq.write_table(table.select(kept), copy / "signals.parquet")
    return copy
