"""A page: nothing it is given breaks out of it, it has Plotly where something is drawn, and main metrics come first."""

import re
from pathlib import Path

import plotly.graph_objects as go
import pytest
from markupsafe import Markup

from handover.cosim.exceptions import RecordNotWritten
from handover.scenarios.runs.reporting.html import plot_html
from handover.scenarios.runs.reporting.page import Section, write_page
from handover.scenarios.runs.reporting.run_page import metrics_section
from handover.scenarios.runs.results.run_facts import RunFacts
from handover.scenarios.runs.results.run_folder import RunFolder

EVIL = "</script><script>alert(1)</script>"


def page_of(path: Path, html: Markup) -> str:
    write_page(path / "page.html", EVIL, Markup("<p>lead</p>"), [Section(anchor="a", title=EVIL, html=html)])
    return (path / "page.html").read_text(encoding="utf-8")


def test_names_that_are_html_are_text(tmp_path: Path):
    figure = go.Figure([go.Scatter(x=[1.0], y=[2.0], name=EVIL)])
    page = page_of(tmp_path, plot_html(figure, label=EVIL))
    assert "alert(1)" in page
    assert EVIL not in page
    assert page.count("</script>") == page.count("<script")


def test_a_page_without_plots_is_small_and_forbids_the_browser_to_ask_for_anything(tmp_path: Path):
    page = page_of(tmp_path, Markup("<p>text</p>"))
    assert len(page) < 30_000
    policy = page.partition('Content-Security-Policy" content="')[2].partition('"')[0].replace("&#39;", "'")
    assert policy.startswith("default-src 'none'; script-src 'sha256-")
    assert "http" not in policy


def test_the_folder_of_a_page_is_made_and_a_page_that_cannot_be_written_leaves_nothing(tmp_path: Path):
    assert page_of(tmp_path / "no" / "such", Markup("<p>text</p>"))
    (tmp_path / "file").touch()
    with pytest.raises(RecordNotWritten):
        page_of(tmp_path / "file", Markup(""))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "no"]


def test_the_metrics_of_the_headline_are_open_and_the_others_folded(grasp: Path):
    facts = RunFacts.read(RunFolder.of_run(grasp))
    section = metrics_section(facts)
    assert section is not None
    opened, folded = section.html.split("<details")
    names = re.compile(r'class="soft name">(\w+)<')
    assert names.findall(opened) == [name for name in facts.headline if name in facts.summary["metrics"]]
    assert len(names.findall(folded)) == int(re.findall(r"<summary>(\d+) more", folded)[0]) > 0
