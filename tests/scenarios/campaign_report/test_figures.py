"""Figures of a campaign: PNG and SVG of success and metrics, for few points and many."""

from pathlib import Path
from typing import Any

import matplotlib as mpl
import pytest
from matplotlib.figure import Figure as Canvas
from support.campaigns import results_of

from handover.scenarios.campaign_report.figures import draw_campaign
from handover.scenarios.experiment.plotting import figure
from handover.scenarios.results.tolerated_faults import ToleratedFaults


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> dict[str, Canvas]:
    """Return figures by their names, which are drawn and not saved."""
    kept: dict[str, Canvas] = {}

    def look(canvas: Canvas, path: Path) -> None:
        canvas.draw_without_rendering()
        kept[path.name] = canvas

    monkeypatch.setattr("handover.scenarios.experiment.plotting._save", look)
    return kept


@pytest.mark.parametrize("succeed", [True, False, None])
def test_success_and_the_metrics_that_matter_are_drawn_with_medians_and_runs_that_failed(
    succeed: bool | None, tmp_path: Path, drawn: dict[str, Canvas]
):
    success = [k % 2 == 0 if succeed is None else succeed for k in range(8)]
    points = [{"forward": f} for f in ("0.02", "0.055")]
    results = results_of("ir_grasp", points, 4, moved=[0.01] * 8, unheard_of=[1.0] * 8, success=success)
    draw_campaign(results, tmp_path, ToleratedFaults())
    assert list(drawn) == ["success_by_point", "moved_by_point"]
    legend = drawn["moved_by_point"].axes[0].get_legend()
    assert legend is not None
    runs = {True: ["run that succeeded"], False: ["run that failed"], None: ["run that failed", "run that succeeded"]}
    assert [text.get_text() for text in legend.get_texts()] == ["median, 95 % interval", *runs[succeed]]


def test_of_more_points_than_a_figure_has_room_for_there_is_none(tmp_path: Path):
    points = [{"thing": f"thing_{k}", "strategy": f"s{k}", "perturbed": str(k)} for k in range(81)]
    assert draw_campaign(results_of("ir_grasp", points), tmp_path / "figures", ToleratedFaults()) == []
    assert not (tmp_path / "figures").exists()


def test_a_figure_that_cannot_be_drawn_is_a_line_and_no_metrics_name_leads_out_of_the_folder(tmp_path: Path):
    names = ("$a^$", "../../x", "/tmp/../x")
    results = results_of("unknown", [{"forward": "0.1"}], 2, **{name: [1.0, 2.0] for name in names})
    figures, faults = tmp_path / "of" / "campaign" / "figures", ToleratedFaults()
    figures.parent.mkdir(parents=True)
    assert len(draw_campaign(results, figures, faults)) == 3
    assert [line.partition(":")[0] for line in faults.lines] == ["figure $a^$_by_point could not be drawn"]
    written = [p for p in tmp_path.rglob("*") if p.is_file()]
    assert len(written) == 6
    assert {p.parent for p in written} == {figures}


def test_a_folder_of_figures_that_is_a_link_is_replaced_and_so_are_files(tmp_path: Path):
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "figures").symlink_to(tmp_path / "elsewhere")
    results, file = results_of("ir_grasp", [{"forward": "0.1"}]), tmp_path / "figures" / "success_by_point.svg"
    for _ in range(2):
        draw_campaign(results, tmp_path / "figures", ToleratedFaults())
        assert [*(tmp_path / "elsewhere").iterdir()] == []
        assert file.is_file()
        file.unlink()
        file.symlink_to(tmp_path / "elsewhere" / "made")


def test_settings_of_matplotlib_from_outside_have_no_part_in_a_figure(tmp_path: Path):
    foreign: dict[Any, Any] = {"axes.facecolor": "red", "lines.linewidth": 20, "font.size": 3}
    for name, settings in (("own", {}), ("other", foreign)):
        with mpl.rc_context(settings), figure(tmp_path / name, 1) as [axes]:
            axes.plot([0.0, 1.0], [0.0, 1.0])
    assert (tmp_path / "own.svg").read_bytes() == (tmp_path / "other.svg").read_bytes()
