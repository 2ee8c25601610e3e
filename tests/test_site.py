"""What the site looks up is declared with a description, and its build stops where something is not as it says."""

import ast
import dataclasses
import importlib
import json
import re
import shutil
import subprocess
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any
from unittest.mock import Mock
from xml.etree import ElementTree

import click
import cv2
import numpy as np
import pytest
from support.commands import call
from support.documentation import ROOT

import handover
from handover.cosim.blocks.description import describe
from handover.fmus.catalog import UNITS, import_class
from handover.scenarios.catalog import SCENARIOS, SYSTEMS
from handover.scenarios.cli.command import main
from handover.scenarios.published.catalog import EXPERIMENTS
from handover.scenarios.runs.execution import exit_status

DOCS = ROOT / "docs"
SOURCES = [
    f for room in ("controllers", "cosim", "fmus", "plants", "scenarios") for f in (ROOT / room).rglob("*.[pc]*")
]


@pytest.fixture(autouse=True)
def _makers_are_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(DOCS))


def maker(name: str) -> ModuleType:
    """Return a module of the site's build."""
    return importlib.import_module(name)


def test_every_public_name_is_in_the_reference():
    reference = (DOCS / "reference" / "python.md").read_text(encoding="utf-8")
    assert [name for name in handover.__all__ if f":: handover.{name}\n" not in reference] == []


def test_every_environment_variable_of_the_source_is_in_the_reference():
    read = re.compile(r'"((?:HANDOVER|FMU)_[A-Z_]+)"')
    built = [ROOT / "setup.py", *(ROOT / "tests" / "support").glob("*.py")]
    in_source = {n for f in [*SOURCES, *built] if f.suffix in (".py", ".c") for n in read.findall(f.read_text("utf-8"))}
    pages = maker("declared_pages")
    text = (DOCS / "templates" / "run_folder.md").read_text(encoding="utf-8")
    assert "HANDOVER_CACHE" in in_source
    assert in_source - set(pages.environment_variables()) - set(re.findall(r"`([A-Z_]+)`", text)) == set()


def test_exit_statuses_in_the_reference_are_those_that_commands_end_with():
    constants = {value for name, value in vars(exit_status).items() if name.isupper()}
    ((command, listed), *_) = maker("declared_pages").statuses()
    assert (command, {int(status) for status, _ in listed}) == ("", {0, *constants})


def test_everything_declared_has_a_description():
    assert maker("undocumented").undocumented() == []


def test_every_metric_is_made_with_a_description():
    """In the source, since a run makes only those that apply to it; the build asks the metrics of its runs."""
    lacking = [
        f"{file.relative_to(ROOT)}:{node.lineno}"
        for file in SOURCES
        if file.suffix == ".py" and "Metric(" in (text := file.read_text(encoding="utf-8"))
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "Metric"
        if len(node.args) < 3 and "description" not in {k.arg for k in node.keywords}
    ]
    assert lacking == []


@pytest.mark.parametrize("what", ["port", "option", "name", "member", "scenario", "metric"])
def test_what_has_no_description_is_named(what: str, monkeypatch: pytest.MonkeyPatch):
    lists, pages = maker("undocumented"), maker("declared_pages")
    monkeypatch.setattr(lists, "UNITS", {"Push": UNITS["Push"]})
    monkeypatch.setattr(lists, "SCENARIOS", {"ir_sensor": SCENARIOS["ir_sensor"]})
    if what == "port":
        declared = lists.describe(import_class(UNITS["Push"].block))
        silent = [dataclasses.replace(v, description="") if v.name == "axis" else v for v in declared.variables]
        shown = SimpleNamespace(doc=declared.doc, variables=silent)
        monkeypatch.setattr(lists, "describe", Mock(return_value=shown))
        expected = "parameter axis of Push"
    elif what == "option":
        monkeypatch.setitem(main.commands, "run", click.Command("run", help="Run.", params=[click.Option(["--fast"])]))
        expected = "option --fast of handover run"
    elif what == "name":
        monkeypatch.setattr(handover.run, "__doc__", None)
        expected = "handover.run"
    elif what == "member":
        monkeypatch.setattr(handover.Run.plot, "__doc__", "")
        expected = "handover.Run.plot"
    elif what == "scenario":
        monkeypatch.setattr(SCENARIOS["ir_sensor"], "__doc__", None)
        expected = "scenario ir_sensor"
    else:
        row = maker("gallery").MetricRow("speed", "m/s", "")
        assert lists.undocumented_metrics({"ir_sensor": [row]}) == ["metric speed of ir_sensor"]
        monkeypatch.setattr(pages, "undocumented", list)
        monkeypatch.setattr(pages, "SCENARIOS", {"ir_sensor": SCENARIOS["ir_sensor"]})
        with pytest.raises(lists.Undocumented, match="metric speed of ir_sensor"):
            pages.write(Path(), {"ir_sensor": SimpleNamespace(metrics=[row])}, {})
        return
    assert lists.undocumented() == [expected]


def test_a_value_without_an_origin_is_named(monkeypatch: pytest.MonkeyPatch):
    pages, shown = maker("declared_pages"), describe(import_class(UNITS["Push"].block))
    axis = dataclasses.replace(shown.parameters[0], origin=None)
    lacking = dataclasses.replace(shown, parameters=(axis, *shown.parameters[1:]))
    monkeypatch.setattr(pages, "describe", Mock(return_value=lacking))
    with pytest.raises(maker("undocumented").Undocumented, match="origin of axis of Push"):
        pages.unit(UNITS["Push"])


def test_an_equation_that_a_docstring_no_longer_has_is_named():
    equations = maker("equations")
    docs = {unit: equations.with_latex(unit, describe(import_class(e.block)).doc) for unit, e in UNITS.items()}
    assert r"$\ddot z = -g$" in docs["VacuumGripper"]
    with pytest.raises(equations.EquationGone, match="VacuumGripper no longer has"):
        equations.with_latex("VacuumGripper", "Holds an object.")


def test_the_reference_shows_the_options_of_each_command():
    """Those that the program itself answers to, of a command and of one in a group."""
    shown = maker("loaded_commands").main.commands
    for command, called in ((shown["run"], ["run"]), (shown["study"].commands["power"], ["study", "power"])):
        printed = set(re.findall(r"(?<!\S)--[a-z-]+", call(*called, "--help").output))
        options = {o for p in command.params if not getattr(p, "hidden", False) for o in p.opts if o.startswith("--")}
        assert options
        assert options <= printed


def test_the_reference_shows_what_an_option_takes_whole():
    """It leaves out brackets at the ends of an option's metavar, so that one at its beginning has lost the other."""
    options = [o for _, command in maker("undocumented").commands() for o in command.params if o.name != "help"]
    shown = [o.metavar for o in options if isinstance(o, click.Option) and o.metavar]
    assert "NAME=VALUE" in shown
    assert [m for m in shown if m.startswith(("[", "<", "{"))] == []


def test_each_equation_is_mathml_that_browsers_lay_out():
    """No sign of LaTeX is left as text, and a line that ends begins another row of a table."""
    converter = importlib.import_module("latex2mathml.converter")
    written = [e for equations in maker("equations")._equations().values() for e in equations.values()]
    for equation in written:
        mathml = ElementTree.fromstring(converter.convert(equation, display="block"))
        assert not {"&", "\\"} & set("".join(mathml.itertext())), equation
        assert not list(mathml.iter("{*}mspace")) or r"\\" not in equation, equation


def test_a_sentence_that_is_too_long_is_found_where_code_equations_and_numbered_lists_do_not_count():
    sentences = maker("sentences")
    words = " ".join(["word"] * (sentences.MOST_WORDS - 1))
    codes = 60 * "<code class='x'><span>f_G</span></code>, " + "<math><mi>x</mi></math>"
    numbered = ", ".join(f"{i} reason of some kind" for i in range(20))
    short = f"<p>{codes} {words}. Another {words}. lower-case: {words}. Why: {numbered}.</p>"
    assert sentences.long_sentences(f"<p>{words} {words}</p><article>{short}</article>") == []
    for tag in ("figcaption", "td", "li", "dd"):
        assert len(sentences.long_sentences(f"<article>{short}<{tag}>It is a {words}</{tag}></article>")) == 1
    assert len(sentences.long_sentences(f"<article><li><p>It is a {words}</p></li></article>")) == 1


def test_a_sentence_says_how_many_runs_there_are():
    """In the number's grammar, and in thousands."""
    made = maker("gallery").GalleryExperiment
    one, many = (made("", "", "", runs, 2, 1280, (), (), {}, ()).extent for runs in (1, 5))
    assert (one.split(";")[0], many.split(";")[0]) == ("Shown: 1 run of its 1,280", "Shown: 5 runs of its 1,280")


def test_a_report_in_the_gallery_links_what_lies_beside_it_alone(tmp_path: Path):
    page, (there, missing) = tmp_path / "report.html", ("run.json", "figures")
    linked = '<td><a href="{0}"><code>{0}</code></a></td>'
    page.write_text(linked.format(there) + linked.format(missing))
    (tmp_path / there).touch()
    maker("gallery").drop_broken_links(page)
    assert page.read_text() == linked.format(there) + "<td><code>figures</code></td>"


def test_every_published_experiment_is_run_for_the_gallery():
    points = maker("gallery")._POINTS
    assert points.keys() == EXPERIMENTS.keys()
    assert all(max(points[name]) < len(EXPERIMENTS[name]().plan(quick=False).points) for name in points)


def test_a_table_of_the_gallery_without_a_value_is_named():
    gallery = maker("gallery")
    sound = [[], [("a", "", "1"), ("b", "", "")]]
    tables = [SimpleNamespace(title=f"table {len(rows)}", rows=rows) for rows in (*sound, [("a", "", "")])]
    gallery.check_tables("ir-table", tables[:2])
    with pytest.raises(gallery.EmptyTable, match="ir-table: no value in the table table 1"):
        gallery.check_tables("ir-table", tables)


@pytest.fixture
def pictured(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The pictures of a repository that has two, as it made them, and a kept run that is as then."""
    pictures = maker("pictures")
    figure = np.full((40, 60, 3), 255, dtype=np.uint8)
    figure[10:30, 20:40] = (180, 90, 30)
    run = tmp_path / "run"
    (run / "figures").mkdir(parents=True)
    cv2.imwrite(str(run / "figures" / "scene.png"), figure)
    cv2.imwrite(str(tmp_path / "ir_grasp.png"), figure)
    metrics = {"displacement": {"value": 0.02}, "cpu_scene": {"value": 1.0}}
    (run / "summary.json").write_text(json.dumps({"metrics": metrics}))
    monkeypatch.setattr(pictures, "kept_run", Mock(return_value=run))
    monkeypatch.setattr(pictures, "DOCS", tmp_path)
    monkeypatch.setattr(pictures, "MADE_OF", tmp_path / "pictures.json")
    page = tmp_path.parent / "scenarios" / "runs" / "reporting" / "page"
    page.mkdir(parents=True, exist_ok=True)
    (page / "page.css").write_text("p {}")
    every = {"ir_grasp.png": ("ir_grasp", "scene"), "report.jpg": ("helix_handover", "")}
    monkeypatch.setattr(pictures, "_EVERY", every)
    made_of: dict[str, Any] = {name: pictures._sources(name) for name in every}
    (tmp_path / "pictures.json").write_text(json.dumps(made_of))
    return pictures


def test_pictures_of_what_there_is_are_current(pictured: ModuleType):
    pictured.check()


@pytest.mark.parametrize("changed", ["metric", "figure", "style"])
def test_a_picture_that_is_older_than_what_it_shows_is_named(changed: str, pictured: ModuleType):
    run, page = pictured.kept_run(), pictured.DOCS.parent / "scenarios" / "runs" / "reporting" / "page"
    if changed == "metric":
        (run / "summary.json").write_text(json.dumps({"metrics": {"displacement": {"value": 0.03}}}))
    elif changed == "figure":
        cv2.imwrite(str(run / "figures" / "scene.png"), np.full((40, 60, 3), 200, dtype=np.uint8))
    else:
        (page / "page.css").write_text("p { color: red }")
    names = {"metric": "ir_grasp.png report.jpg", "figure": "ir_grasp.png", "style": "report.jpg"}[changed]
    with pytest.raises(pictured.OldPictures, match=f"pictures.py {names}$"):
        pictured.check()


@pytest.mark.slow
def test_pages_of_units_and_scenarios_have_what_these_declare():
    pages = maker("declared_pages")
    for entry in UNITS.values():
        facts = pages.unit(entry)
        assert {r.name for r, _ in facts["parameters"]} == {v.name for v in facts["declared"].parameters}
        assert [row[0] for row in facts["hosts"][1]] in ([], ["FMI 2", "FMI 3", "scalar FMI 3", "standalone"])
    for system in SYSTEMS:
        for name in system.scenarios:
            facts = pages.scenario(SCENARIOS[name])
            assert [r.name for r, _ in facts["parameters"]] == [v.name for v in SCENARIOS[name].parameters()]
            assert {place for place, _, _ in facts["places"]} <= set(SCENARIOS[name].units)
    origins = {r.name: origin for r, origin in pages.unit(UNITS["Thrusters"])["parameters"]}
    assert origins["f_max"].startswith("stated: ")
    alpha = {r.name: origin for r, origin in pages.unit(UNITS["VisualServo"])["parameters"]}["alpha"]
    assert alpha.startswith("assumed: with control_period")


_PAGE = """---
file_format: mystnb
kernelspec:
  name: tutorial
---

# Page

{text}

```{{code-cell}} python
{code}
```
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "code", "named"),
    [
        ("[A heading](page.md#page) that there is.", "1 / 2", []),
        ("[A page](nowhere.md) and [a heading](page.md#nobody) that are not.", "1 / 2", ["nowhere.md", "nobody"]),
        ('<a href="page.html">One</a>, <img src="nothing.png">', "1 / 2", ["page.html: nothing.png"]),
        ("A cell that fails.", "1 / 0", ["page.md", "ExecutionError"]),
        (f"{'Word ' * 41}.", "1 / 2", ["page.html: Word Word"]),
    ],
    ids=["sound", "links", "file", "cell", "sentence"],
)
def test_the_build_stops_at_a_link_or_a_cell_that_fails(text: str, code: str, named: list[str], tmp_path: Path):
    """By the site's own settings and the command of `make docs`, on a site of one page that this Python executes."""
    for name in ("conf.py", "equations.py", "equations.toml", "sentences.py"):
        shutil.copyfile(DOCS / name, tmp_path / name)
    shutil.copytree(DOCS / "static", tmp_path / "static")
    (tmp_path / "build" / "files").mkdir(parents=True)
    kernel = tmp_path / "build" / "tutorials" / "jupyter" / "kernels" / "tutorial"
    kernel.mkdir(parents=True)
    argv = [sys.executable, "-m", "ipykernel_launcher", "-f", "{connection_file}"]
    (kernel / "kernel.json").write_text(json.dumps({"argv": argv, "display_name": "x", "language": "python"}))
    (tmp_path / "index.md").write_text("# Site\n\n```{toctree}\npage\n```\n")
    (tmp_path / "page.md").write_text(_PAGE.format(text=text, code=code))
    (options,) = re.findall(r"-m sphinx (.*) docs docs/build/html", (ROOT / "Makefile").read_text())
    call = [sys.executable, "-m", "sphinx", *options.split(), str(tmp_path), str(tmp_path / "html")]
    done = subprocess.run(call, capture_output=True, text=True, check=False)
    assert (done.returncode != 0) == bool(named), done.stderr
    assert [name for name in named if name not in done.stderr] == [], done.stderr


def test_types_of_ports_are_those_that_are_declared():
    types = maker("declared_pages").port_types()
    assert (types["units"]["NewtonMetre"], types["arrays"]["Matrix3x4"]) == ("N.m", "3 × 4")
    assert "UInt16" in types["integers"]
    assert "Single" not in types["arrays"]
