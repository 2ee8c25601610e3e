"""What a result gives: numbers with units, arrays by name, tables, figures, pages; and what notebooks show of it."""

import copy
import json
import re
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest
from support.kept_runs import copied_run, kept_run

import handover
from handover.scenarios.api.progress import bar_html


@pytest.fixture
def run() -> handover.Run:
    found = handover.load(kept_run("run", "ir_grasp", "--no-report"))
    assert isinstance(found, handover.Run)
    return found


def test_metrics_are_numbers_with_units(run: handover.Run):
    displacement = run.metrics["displacement"]
    assert displacement + 0.0 == float(displacement)
    assert displacement.unit == "m"
    assert "pushed" in displacement.description
    assert str(handover.Quantity(0.0123, "m")) == "12.3 mm"
    assert copy.copy(displacement).unit == "m"
    with pytest.raises(KeyError, match="did you mean displacement"):
        run.metrics["displacements"]


def test_signals_are_arrays_by_name(run: handover.Run):
    signals = run.signals
    assert signals["scene.p_WH"].shape == (len(signals.time), 2)
    assert signals.unit("scene.p_WH") == "m"
    assert signals.units["scene.yaw"] == "rad"
    assert "reflex.phase" in list(signals)
    assert "REACH" in signals.item_names("reflex.phase").values()
    assert signals["scene.p_WH[2]"].tolist() == signals["scene.p_WH"][:, 1].tolist()
    assert signals.unit("scene.p_WH[2]") == "m"
    for name in ("scene.p_WHH", "scene.p_WH[0]", "scene.p_WH[3]", "scene.yaw[1]"):
        assert name not in signals
        with pytest.raises(KeyError, match=r"did you mean scene\.(p_WH|yaw)"):
            signals[name]


def test_signals_become_a_table(run: handover.Run, monkeypatch: pytest.MonkeyPatch):
    table = run.signals.to_pandas()
    assert table.index.name == "time"
    assert table["scene.p_WH[2]"].tolist() == run.signals["scene.p_WH"][:, 1].tolist()
    assert table.attrs["units"]["scene.p_WH[2]"] == "m"
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(ImportError, match=r"^to_pandas needs pandas: python -m pip install pandas$"):
        run.signals.to_pandas()


def test_plots_have_names_and_units_at_their_axes(run: handover.Run):
    figure = run.plot("scene.p_WH", "reflex.phase")
    above, below = figure.axes
    assert above.get_ylabel() == "scene.p_WH (m)"
    assert below.get_ylabel() == "reflex.phase"
    assert below.get_xlabel() == "time (s)"
    assert [line.get_label() for line in above.get_lines()] == ["scene.p_WH[1]", "scene.p_WH[2]"]
    assert np.array_equal(np.asarray(above.get_lines()[1].get_ydata()), run.signals["scene.p_WH"][:, 1])
    assert "reach" in [label.get_text() for label in below.get_yticklabels()]
    assert figure._repr_png_().startswith(b"\x89PNG")  # type: ignore
    assert not plt.get_fignums()
    (axes,) = run.plot("scene.p_WH[2]").axes
    assert axes.get_ylabel() == "scene.p_WH[2] (m)"
    np.testing.assert_array_equal(axes.lines[0].get_ydata(), run.signals["scene.p_WH"][:, 1])
    figure, axes = plt.subplots()
    assert run.plot("scene.yaw", axes=axes) is figure
    assert axes.get_ylabel() == "scene.yaw (rad)"
    plt.close(figure)
    for names, error, reported in (
        (["scene.p_WH[3]"], KeyError, r"no signal 'scene\.p_WH\[3\]'"),
        (
            ["scene.yav", "reflex.fase"],
            KeyError,
            "no signal 'scene.yav': did you mean scene.yaw.*; no signal 'reflex.f",
        ),
        ([], ValueError, "no signal is named"),
    ):
        with pytest.raises(error, match=reported):
            run.plot(*names)


def test_a_record_that_is_missing_is_named_where_the_run_had_one(tmp_path: Path):
    folder = copied_run(tmp_path / "run", "run", "ir_grasp", "--no-report")
    (folder / "signals.parquet").unlink()
    run = handover.load(folder)
    assert isinstance(run, handover.Run)
    for shows in (lambda: run.signals, lambda: run.report(figures=True)):
        with pytest.raises(handover.InvalidInput, match=r"signals\.parquet is missing"):
            shows()
    for html in (run._repr_html_(), run.report().html):
        assert "signals.parquet is missing" in html


def test_replay_and_report_are_pages(tmp_path: Path):
    run = handover.Run(copied_run(tmp_path / "run", "run", "ir_grasp", "--no-report"))
    replay = run.replay()
    assert 'class="replay"' in replay.html
    saved = replay.save(tmp_path / "replay.html")
    assert saved.path is not None
    assert saved.path.read_text(encoding="utf-8") == replay.html
    report = run.report()
    assert report.path == run.folder / "report.html"
    assert 'class="replay"' in report.html
    assert re.match(r'<iframe srcdoc="&lt;!', report._repr_html_())  # type: ignore


def test_a_notebook_shows_verdict_headline_and_plots_without_what_a_unit_did_not_give(grasp_without_reflex: Path):
    run = handover.Run(grasp_without_reflex)
    assert 'class="replay"' in run.replay().html
    html = run._repr_html_()  # type: ignore
    assert "succeeded</span>" in html
    assert "how far the object was pushed" in html
    assert html.count("data:image/png;base64,") == 2
    assert "Left out: what is drawn from reflex." in html
    assert "object at 0x" not in repr(run)


def test_a_strangers_run_of_another_version_is_shown_without_plots_and_steers_no_terminal(grasp_without_reflex: Path):
    change(grasp_without_reflex / "run.json", parameters={"colour": "red"})
    run = handover.Run(grasp_without_reflex)
    html = run._repr_html_()  # type: ignore
    assert "succeeded</span>" in html
    assert "the figures over time could not be drawn: InvalidParameter" in html
    with pytest.raises(handover.InvalidInput, match="colour"):
        run.replay()
    for name in ("run.json", "summary.json"):
        change(grasp_without_reflex / name, scenario="a\x1b]0;b\u202e")
    assert "<run of a\ufffd]0;b\ufffd: " in repr(handover.load(grasp_without_reflex))
    (grasp_without_reflex / "signals.parquet").write_bytes(b"")
    with pytest.raises(handover.InvalidInput, match=r"signals\.parquet is damaged"):
        handover.Run(grasp_without_reflex)._repr_html_()  # type: ignore


def change(file: Path, **changes: object) -> None:
    file.write_text(json.dumps(json.loads(file.read_text()) | changes))


def test_a_notebook_shows_a_system_as_its_graph_and_a_unit_as_its_ports():
    graph = str(handover.system("ir_grasp")._repr_html_())  # type: ignore
    assert graph.startswith("<svg")
    for text in ("reflex", "IrReflex", "FMI 3, 15 ms, sampled", "scene → reflex", "p_WH_cmd (real [2] m)"):
        assert text in graph
    assert graph.count("<rect") == 2
    assert handover.System()._repr_html_() is None  # type: ignore
    html = handover.describe("IrReflex")._repr_html_()  # type: ignore
    for text in ("<b>Inputs", "<b>Outputs", "<b>Parameters", "p_WH_cmd", "real [2]", "at least 1", ">reflex<"):
        assert text in html
    placed = handover.System().add("push", handover.unit("Push"))
    assert "<b>Parameters" in str(placed._repr_html_())  # type: ignore


def test_progress_is_a_bar():
    bar = bar_html(2.0, 5.0, "2 of 5 <s>")
    assert bar.startswith("<progress value='2' max='5'")
    assert "&lt;s&gt;" in bar


def test_the_folder_of_nothing_is_refused(tmp_path: Path):
    with pytest.raises(handover.InvalidInput, match="the folder of neither a run"):
        handover.load(tmp_path)
