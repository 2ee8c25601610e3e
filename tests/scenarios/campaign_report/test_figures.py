"""Figures of a campaign: PNG and SVG of success and metrics, for few points and many."""

from itertools import pairwise
from pathlib import Path
from typing import Any

import matplotlib as mpl
import pytest
from matplotlib.figure import Figure as Canvas
from matplotlib.transforms import Bbox
from support.campaigns import results_of

from handover.scenarios.campaign_report.figures import draw_campaign
from handover.scenarios.experiment.plotting import figure
from handover.scenarios.results.tolerated_faults import ToleratedFaults


@pytest.mark.parametrize("n", [2, 30])
def test_success_and_the_metrics_that_matter_are_drawn(n: int, tmp_path: Path):
    points = [{"forward": f"{0.001 * k:g}"} for k in range(n)]
    results = results_of("ir_grasp", points, moved=[0.01 * k for k in range(2 * n)], unheard_of=[1.0] * (2 * n))
    drawn = draw_campaign(results, tmp_path / "figures", ToleratedFaults())
    assert [f.name for f in drawn] == ["success_by_point", "moved_by_point"]
    assert all((tmp_path / "figures" / f"{f.name}.{kind}").stat().st_size for f in drawn for kind in ("png", "svg"))


@pytest.mark.parametrize("succeed", [True, False, None])
def test_a_legend_names_medians_and_runs_that_failed(
    succeed: bool | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    found: list[list[str]] = []

    def look(canvas: Canvas, _path: Path) -> None:
        legend = canvas.axes[0].get_legend()
        found.append([] if legend is None else [text.get_text() for text in legend.get_texts()])

    monkeypatch.setattr("handover.scenarios.experiment.plotting._save", look)
    success = [k % 2 == 0 if succeed is None else succeed for k in range(8)]
    results = results_of("ir_grasp", [{"forward": f} for f in ("0.02", "0.055")], 4, moved=[0.01] * 8, success=success)
    draw_campaign(results, tmp_path, ToleratedFaults())
    expected = {
        True: ["run that succeeded"],
        False: ["run that failed"],
        None: ["run that failed", "run that succeeded"],
    }
    assert found[1] == ["median, 95 % interval", *expected[succeed]]


@pytest.mark.parametrize(
    "points",
    [
        [{"forward": f} for f in ("0.02", "0.055")],
        [{"thing": t} for t in ("cylinder", "baby_cup_a", "baby_cup_b", "paper_box_a", "paper_box_b", "none")],
        [{"forward": f"{0.001 * k:g}"} for k in range(30)],
        [{"thing": f"thing_{k}", "strategy": s, "perturbed": f"{k == 0}"} for k in range(15) for s in ("blind", "all")],
    ],
    ids=["two", "six names", "thirty numbers", "a list of thirty"],
)
def test_names_of_points_do_not_overlap(points: list[dict[str, str]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    boxes: list[list[Bbox]] = []

    def look(canvas: Canvas, _path: Path) -> None:
        canvas.draw_without_rendering()
        labels = (axis.get_ticklabels() for axis in (canvas.axes[0].xaxis, canvas.axes[0].yaxis))
        boxes.extend([each.get_window_extent() for each in along if each.get_text()] for along in labels)

    monkeypatch.setattr("handover.scenarios.experiment.plotting._save", look)
    draw_campaign(results_of("ir_grasp", points), tmp_path, ToleratedFaults())
    assert len(boxes) == 2
    assert max(map(len, boxes)) >= min(len(points), 6)
    for along in boxes:
        assert not any(a.overlaps(b) for a, b in pairwise(along))


@pytest.mark.parametrize("letters", [10, 70, 240])
def test_names_of_a_list_are_not_cut_off_and_leave_room_for_what_is_drawn(
    letters: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    found: list[tuple[Bbox, float, float]] = []

    def look(canvas: Canvas, _path: Path) -> None:
        canvas.draw_without_rendering()
        labels = [label.get_window_extent() for label in canvas.axes[0].yaxis.get_ticklabels() if label.get_text()]
        drawn = canvas.axes[0].get_window_extent()
        assert not any(a.overlaps(b) for a, b in pairwise(labels))
        found.append((Bbox.union(labels), drawn.width / canvas.bbox.width, drawn.width / canvas.dpi))

    monkeypatch.setattr("handover.scenarios.experiment.plotting._save", look)
    names = ("word " * 60)[: letters - 3].strip()
    points = [{"thing": f"{names} {k}", "strategy": f"s{k}", "perturbed": str(k)} for k in range(12)]
    draw_campaign(results_of("ir_grasp", points), tmp_path, ToleratedFaults())
    ((labels, share, width),) = found
    assert labels.x0 >= 0.0
    assert labels.y0 >= 0.0
    assert share > 0.35
    assert width > 3.0


def test_of_more_points_than_a_figure_has_room_for_there_is_none(tmp_path: Path):
    points = [{"thing": f"thing_{k}", "strategy": f"s{k}", "perturbed": str(k)} for k in range(81)]
    assert draw_campaign(results_of("ir_grasp", points), tmp_path / "figures", ToleratedFaults()) == []
    assert not (tmp_path / "figures").exists()


def test_a_figure_that_cannot_be_drawn_is_a_line_and_the_others_are_drawn(tmp_path: Path):
    results = results_of("unknown", [{"forward": "0.1"}], 2, **{"$a^$": [1.0, 2.0], "moved": [1.0, 2.0]})
    faults = ToleratedFaults()
    drawn = draw_campaign(results, tmp_path / "figures", faults)
    assert [f.name for f in drawn] == ["success_by_point", "moved_by_point"]
    assert [line.partition(":")[0] for line in faults.lines] == ["figure $a^$_by_point could not be drawn"]


def test_no_metrics_name_leads_out_of_the_folder(tmp_path: Path):
    results = results_of("unknown", [{"forward": "0.1"}], 2, **{"../../x": [1.0, 2.0], "/tmp/../x": [1.0, 2.0]})
    (tmp_path / "of" / "campaign").mkdir(parents=True)
    drawn = draw_campaign(results, tmp_path / "of" / "campaign" / "figures", ToleratedFaults())
    written = [p for p in tmp_path.rglob("*") if p.is_file()]
    assert len(drawn) == 3
    assert len(written) == 6
    assert {p.parent for p in written} == {tmp_path / "of" / "campaign" / "figures"}


def test_a_folder_of_figures_that_is_a_link_is_replaced_and_so_are_files(tmp_path: Path):
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "figures").symlink_to(tmp_path / "elsewhere")
    results = results_of("ir_grasp", [{"forward": "0.1"}])
    draw_campaign(results, tmp_path / "figures", ToleratedFaults())
    assert [*(tmp_path / "elsewhere").iterdir()] == []
    file = tmp_path / "figures" / "success_by_point.svg"
    assert file.is_file()
    file.unlink()
    file.symlink_to(tmp_path / "elsewhere" / "made")
    draw_campaign(results, tmp_path / "figures", ToleratedFaults())
    assert [*(tmp_path / "elsewhere").iterdir()] == []


def test_settings_of_matplotlib_from_outside_have_no_part_in_a_figure(tmp_path: Path):
    foreign: dict[Any, Any] = {"axes.facecolor": "red", "lines.linewidth": 20, "font.size": 3}
    for name, settings in (("own", {}), ("other", foreign)):
        with mpl.rc_context(settings), figure(tmp_path / name, 1) as [axes]:
            axes.plot([0.0, 1.0], [0.0, 1.0])
    assert (tmp_path / "own.svg").read_bytes() == (tmp_path / "other.svg").read_bytes()
