import os
import shutil
from collections.abc import Generator
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner
from playwright.sync_api import Browser, sync_playwright

from handover.scenarios.cli.command import main

_FLAGS = (
    "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
)  # fmt: skip
"""No network, no screen; space is drawn by software."""


@pytest.fixture(scope="module")
def browser() -> Generator[Browser, None, None]:
    """Return a browser for a file's tests: as long as it is there, an event loop runs in the tests' thread."""
    chromium = shutil.which("chromium")
    if chromium is None:
        assert "CI" not in os.environ, "there is no chromium to look at pages with"
        pytest.skip("there is no chromium to look at pages with")
    with sync_playwright() as playwright:
        made = playwright.chromium.launch(executable_path=chromium, args=_FLAGS)
        yield made
        made.close()


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
