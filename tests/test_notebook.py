"""The notebook runs from top to bottom, and shows what it says: verdict, figures, graph, tables, replay."""

from pathlib import Path
from typing import Any, cast

import nbformat
import pytest
from nbclient import NotebookClient

NOTEBOOK = Path(__file__).parent.parent / "docs" / "python.ipynb"


pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def executed(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[dict[str, Any]]]:
    """Return the outputs of each cell by its first line, after the notebook was executed in an empty folder."""
    folder = tmp_path_factory.mktemp("notebook")
    notebook = cast(Any, nbformat).read(NOTEBOOK, as_version=4)
    NotebookClient(
        notebook, timeout=300, kernel_name="python3", resources={"metadata": {"path": str(folder)}}
    ).execute()
    cells = [cell for cell in notebook.cells if cell.cell_type == "code"]
    return {cell.source.splitlines()[0]: cell.outputs for cell in cells}


def shown(executed: dict[str, list[dict[str, Any]]], begin: str, kind: str) -> str:
    """Return what a cell shows of a kind, a MIME type; the cell is named by how it begins."""
    (outputs,) = (outputs for line, outputs in executed.items() if line.startswith(begin))
    found = [o["data"][kind] for o in outputs if kind in o.get("data", {})]
    assert found, [list(o.get("data", o)) for o in outputs]
    return found[-1]


def printed(executed: dict[str, list[dict[str, Any]]], begin: str) -> str:
    (outputs,) = (outputs for line, outputs in executed.items() if line.startswith(begin))
    return "".join(o["text"] for o in outputs if o["output_type"] == "stream")


def test_a_run_shows_its_verdict_and_plots(executed: dict[str, list[dict[str, Any]]]):
    html = shown(executed, "run = ", "text/html")
    assert "succeeded</span>" in html
    assert html.count("data:image/png;base64,") == 2


def test_its_progress_was_a_bar_that_is_gone(executed: dict[str, list[dict[str, Any]]]):
    (outputs,) = (outputs for line, outputs in executed.items() if line.startswith("run = "))
    bars = [o for o in outputs if o["output_type"] == "display_data"]
    assert len(bars) == 1
    assert bars[0]["data"]["text/html"] == ""


def test_a_plot_is_a_picture(executed: dict[str, list[dict[str, Any]]]):
    assert len(shown(executed, "run.plot(", "image/png")) > 20_000


def test_numbers_have_units(executed: dict[str, list[dict[str, Any]]]):
    assert "0.150 mm - how far the object was pushed" in printed(executed, "moved = ")
    assert "(945, 2) m" in printed(executed, "moved = ")
    assert "scene.yaw" in shown(executed, "moved = ", "text/html")


def test_a_replay_is_a_frame(executed: dict[str, list[dict[str, Any]]]):
    assert shown(executed, "run.replay(", "text/html").startswith("<iframe srcdoc=")


def test_a_system_is_a_graph_and_a_unit_a_table(executed: dict[str, list[dict[str, Any]]]):
    assert shown(executed, "handover.system(", "text/html").count("<rect") == 5
    assert "<b>Inputs" in shown(executed, "handover.describe(", "text/html")


def test_a_campaign_shows_its_rates(executed: dict[str, list[dict[str, Any]]]):
    html = shown(executed, "campaign = ", "text/html")
    assert "2 of 2" in html
    assert "0 of 2" in html


def test_steps_and_episodes_end(executed: dict[str, list[dict[str, Any]]]):
    assert "m after" in printed(executed, "with handover.open(")
    assert printed(executed, "env = ").split()[0] in ("0.0", "1.0")
