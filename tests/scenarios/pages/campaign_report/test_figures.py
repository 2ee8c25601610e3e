"""Figures of a campaign: success and metrics, for few points and many, in the width of a column."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import pytest
from matplotlib.figure import Figure as Canvas
from matplotlib.text import Text
from support.campaigns import results_of

from handover.scenarios.experiment.plotting import figure
from handover.scenarios.pages.campaign_report.figures import draw_campaign
from handover.scenarios.runs.results.tolerated_faults import ToleratedFaults


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> dict[str, Canvas]:
    """Return figures by their names, which are drawn and not saved."""
    kept: dict[str, Canvas] = {}

    def look(canvas: Canvas, path: Path, _formats: Sequence[str]) -> None:
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
    (legend,) = drawn["moved_by_point"].legends
    runs = {True: ["run that succeeded"], False: ["run that failed"], None: ["run that failed", "run that succeeded"]}
    assert [text.get_text() for text in legend.get_texts()] == ["median, 95 % interval", *runs[succeed]]


LIST = [{"thing": t, "strategy": s, "forward": f} for t in ("baby_cup_a", "cylinder") for s in "ab" for f in "01"]


@pytest.mark.parametrize("points", [[{"thing": f"paper_box_{k}"} for k in range(6)], LIST])
def test_in_a_column_all_that_is_drawn_stays_within_the_paper_and_beside_the_legend(
    points: Sequence[Mapping[str, str]], tmp_path: Path, drawn: dict[str, Canvas]
):
    n = 3 * len(points)
    success = [k % 2 == 0 for k in range(n)]
    results = results_of("ir_grasp", points, 3, final_distance_index=[0.01 * k for k in range(n)], success=success)
    draw_campaign(results, tmp_path, ToleratedFaults())
    assert len(drawn) == 2
    for canvas in drawn.values():
        width, _ = canvas.get_size_inches()
        assert width * 25.4 == pytest.approx(88.9)  # a column of IEEE's journals
        (axes,) = canvas.axes
        drawn_box, paper = axes.get_tightbbox(), canvas.bbox.padded(1.0)
        assert drawn_box is not None
        assert paper.x0 <= drawn_box.x0 <= drawn_box.x1 <= paper.x1
        assert paper.y0 <= drawn_box.y0 <= drawn_box.y1 <= paper.y1
        assert all(legend.get_window_extent().y1 <= drawn_box.y0 for legend in canvas.legends)
        assert min(float(text.get_fontsize()) for text in canvas.findobj(Text)) >= 7.0


def test_many_numbers_are_places_on_an_axis_and_not_its_labels(tmp_path: Path, drawn: dict[str, Canvas]):
    results = results_of("ir_grasp", [{"forward": f"{0.001 * k:g}"} for k in range(30)])
    draw_campaign(results, tmp_path, ToleratedFaults())
    (axes,) = drawn["success_by_point"].axes
    assert 2 <= len(axes.get_xticks()) < 30


def test_metrics_that_differ_after_a_dot_have_files_of_their_own_of_which_one_is_a_pdf(tmp_path: Path):
    results = results_of("unknown", [{}], 2, **{"arm.x": [1.0, 2.0], "arm.y": [2.0, 3.0]})
    draw_campaign(results, tmp_path, ToleratedFaults())
    assert {p.name for p in tmp_path.iterdir()} == {
        f"{name}_by_point.{end}" for name in ("success", "arm.x", "arm.y") for end in ("png", "svg", "pdf")
    }
    assert b"/MediaBox [ 0 0 252 " in (tmp_path / "arm.x_by_point.pdf").read_bytes()  # 3.5 in


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
    assert len(written) == 9
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
