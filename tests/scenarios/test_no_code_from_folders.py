"""No code is run because a folder of somebody else names it: planted wherever a run, a campaign or a study names code.

As for pickles (`tests/test_no_pickle.py`); for studies see `study/test_study_command.py`. That the planted code would
run is shown by `--trust`, which runs it.
"""

import json
import py_compile
import sys
from collections.abc import Callable, Generator
from importlib.util import cache_from_source
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner, Result
from support.campaigns import campaign_metadata, folder_of, table_of

import handover
from handover.scenarios import catalog
from handover.scenarios.cli.command import main
from handover.scenarios.live.watched_run import WatchedRun
from handover.scenarios.pages.film.film_page import film_content
from handover.scenarios.runs.results.run_folder import RunFolder, versions

PLANTED = """
from pathlib import Path
from fractions import Fraction

Path({marker!r}).write_text("it was run")

from handover.scenarios.experiment.experiment import Experiment
from handover.scenarios.experiment.time_plot import Curve, TimeFigure, TimePlot


class Scene(Experiment):
    units = {{}}
    headline = ("fall",)

    def build(self, parameters, seed, fmu): raise NotImplementedError
    def evaluator(self, parameters): raise NotImplementedError
    def stop_time(self, parameters): return Fraction(1)

    def time_figures(self, parameters, record):
        curve = Curve(label="height", values=record["mass.x"])
        plot = TimePlot(title="Height by the planted code", quantity="height", unit="m", curves=[curve])
        return [TimeFigure(name="1", caption="", plots=[plot])]
"""


@pytest.fixture
def marker(tmp_path: Path) -> Generator[Path, None, None]:
    """The file that planted code writes; modules, path and what is trusted are as before after the test."""
    modules, path, trusted = set(sys.modules), [*sys.path], set(catalog._TRUSTED)  # type: ignore
    yield tmp_path / "marker"
    for name in set(sys.modules) - modules:
        if name.startswith("foreign"):
            del sys.modules[name]
    sys.path[:] = path
    catalog._TRUSTED.clear()  # type: ignore
    catalog._TRUSTED.update(trusted)  # type: ignore


NAMED = {
    "foreign_scene:Scene": "foreign_scene.py",
    "foreign_package.scene:Scene": "foreign_package/scene.py",
    "foreign_package:Scene": "foreign_package/__init__.py",
    "xmlrpc:Scene": "xmlrpc.py",
    "__main__:Scene": "__main__.py",
}
"""Planted code by its name: modules by themselves and in a package, and one that is named like a library's."""


def plant(folder: Path, marker: Path) -> None:
    """Plant code in a folder."""
    (folder / "foreign_package").mkdir(parents=True)
    for file in NAMED.values():
        (folder / file).write_text(PLANTED.format(marker=str(marker)), encoding="utf-8")


def sources(folder: Path) -> list[dict[str, Any]]:
    """Return what may stand in a folder as the scenario's source, each with the planted code as what it names."""
    return [{"scenario": name, "folder": str(folder), "sha256": "0"} for name in NAMED]


def run_of(path: Path, source: dict[str, Any], scenario: str = "scene") -> Path:
    """Write the folder of a run whose `run.json` names code."""
    path.mkdir(parents=True)
    master = {"algorithm": "jacobi", "tolerance": 1e-6, "iterations": 9, "extrapolation": "hold", "adaptive": None}
    run = {
        "scenario": scenario, "source": source, "parameters": {}, "seed": 0, "files": {}, "units": {}, "formats": [],
        "versions": versions(), "checkpoint": None, "master": {**master, "repeat_discarded": False},
    }  # fmt: skip
    (path / "run.json").write_text(json.dumps(run))
    (path / "summary.json").write_text(json.dumps({"success": True, "reason": "it ended", "metrics": {}}))
    fields: list[Any] = [pa.field(n, pa.float64(), metadata={"unit": u}) for n, u in (("time", "s"), ("mass.x", "m"))]
    table: Any = pa.Table.from_pydict({"time": [0.0, 1.0], "mass.x": [2.0, 1.0]}, schema=pa.schema(fields))
    pq.write_table(table, path / "signals.parquet")
    return path


def campaign_of(path: Path, source: dict[str, Any]) -> Path:
    """Write the folder of a campaign whose `campaign.json` names code, as does the `run.json` of its run."""
    points = [{"height": "1"}, {"height": "2"}]
    plan = campaign_metadata(source["scenario"], points, source=source, headline=["fall"], scenes=[], experiment="")
    plan |= {"versions": versions(), "varied_units": [], "defaults": {"mass": "3"}}
    folder_of(path, plan, table_of(points, fall=[0.1, 0.2, 0.3, 0.4]))
    run_of(path / "runs" / "000_r0000", source)
    return path


def call(*arguments: str | Path) -> Result:
    return CliRunner().invoke(main, [str(a) for a in arguments], catch_exceptions=False)


def read_runs(folder: Path, out: Path, source: dict[str, Any]) -> None:
    first, second = run_of(folder / "a", source), run_of(folder / "b", source)
    reported = call("report", first, "--figures")
    assert reported.exit_code == 0, reported.output
    assert "--trust" in reported.output
    assert call("compare", first, second, "--out", out / "compared").exit_code == 0
    film = film_content(RunFolder.of_run(first), ["mass.x"], 720)
    assert any("--trust" in line for line in film.notes)
    loaded = handover.load(first)
    assert loaded.success  # type: ignore
    loaded.report()
    with pytest.raises(handover.InvalidInput, match="import its module"):
        loaded.replay()  # type: ignore
    watched = WatchedRun(first)
    assert (watched.led_hand(), watched.has_verdict) == (None, True)
    watched.recorded_scene()


def read_campaigns(folder: Path, out: Path, source: dict[str, Any]) -> None:
    first, second = campaign_of(folder / "c", source), campaign_of(folder / "d", source)
    reported = call("report", first, "--runs")
    assert reported.exit_code == 0, reported.output
    compared = call("compare", first, second, "--out", out / "compared")
    assert compared.exit_code == 0, compared.output
    assert "fall" in compared.output  # its headline is in the folder
    loaded = handover.load(first)
    loaded.report()
    assert loaded.points  # type: ignore


@pytest.mark.parametrize("read", [read_runs, read_campaigns])
def test_what_reads_a_folder_imports_nothing_that_it_names(
    read: Callable[[Path, Path, dict[str, Any]], None], marker: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    theirs = tmp_path / "theirs"
    plant(theirs, marker)
    monkeypatch.chdir(theirs)  # nor from the working directory
    path = [*sys.path]
    read(theirs, tmp_path, sources(theirs)[0])
    assert not marker.exists()
    assert sys.path == path


def test_no_name_of_a_module_is_taken_from_a_folder(marker: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    plant(tmp_path / "theirs", marker)
    monkeypatch.syspath_prepend(str(tmp_path / "theirs"))
    for source in sources(tmp_path / "theirs"):
        assert catalog.scenario_of("scene", source) is None
    assert not marker.exists()


def test_a_campaigns_table_and_links_lead_to_no_folder_outside(tmp_path: Path):
    mine = run_of(tmp_path / "mine", {})
    theirs, linked = (campaign_of(tmp_path / name, sources(tmp_path)[0]) for name in ("theirs", "linked"))
    table: Any = pq.read_table(theirs / "runs.parquet")
    column: Any = pa.array(["../../mine"] * len(table))
    pq.write_table(table.set_column(table.column_names.index("run"), "run", column), theirs / "runs.parquet")
    (linked / "runs" / "linked").symlink_to(mine)
    for campaign, messages in ((theirs, "is not a run's name"), (linked, "runs/linked is a link")):
        refused = call("report", campaign, "--runs")
        assert refused.exit_code == 2, refused.output
        assert messages in refused.output
    assert not (mine / "report.html").exists()


def test_a_file_that_is_named_is_run(marker: Path, tmp_path: Path):
    plant(tmp_path / "theirs", marker)
    run = run_of(tmp_path / "theirs" / "a", sources(tmp_path / "theirs")[0])
    refused = call("report", run, "--trust", tmp_path / "foreign_scene.py")
    assert (refused.exit_code, marker.exists()) == (2, False)
    named = tmp_path / "theirs" / "foreign_scene.py"
    other = tmp_path / "other.py"
    other.write_text(f"open({str(tmp_path / 'bytecode')!r}, 'w')\n", encoding="utf-8")
    py_compile.compile(
        str(other), cache_from_source(str(named)), invalidation_mode=py_compile.PycInvalidationMode.UNCHECKED_HASH
    )
    (run / "report.html.part").symlink_to(tmp_path / "mine.txt")
    done = call("report", run, "--trust", named)
    assert (done.exit_code, marker.exists()) == (0, True), done.output
    assert "Height by the planted code" in (run / "report.html").read_text(encoding="utf-8")
    assert not (tmp_path / "bytecode").exists()  # what runs is what stands in the file
    assert not (tmp_path / "mine.txt").exists()


def repeated(source: dict[str, Any], folder: Path, **more: Any) -> Result:
    """Repeat a run by its `run.json`; nothing is written."""
    run = run_of(folder / "a", source, more.pop("scenario", "scene"))
    content = {**json.loads((run / "run.json").read_text()), **more}
    (run / "run.json").write_text(json.dumps(content))
    result = call("run", "--config", run / "run.json", "--out", folder / "out", "--no-report")
    assert (result.exit_code, (folder / "out").exists()) == (2, False), result.output
    return result


def test_a_run_is_not_repeated_with_other_code_than_it_had(marker: Path, tmp_path: Path):
    plant(tmp_path / "theirs", marker)
    for number, source in enumerate(sources(tmp_path / "theirs")):
        repeated(source, tmp_path / str(number))
    assert not marker.exists()


@pytest.mark.parametrize(
    ("source", "scenario", "files"),
    [
        ({}, "foreign_scene:Scene", {}),
        ({}, "planted.fmu", {}),
        ({"ssp": "foreign_scene:Scene", "sha256": "0", "step": None, "stop": "1"}, "planted", {}),
        ({"fmu": "planted.fmu", "sha256": "0", "step": None, "stop": "1"}, "planted", {}),
        ({}, "unpacked", {}),
        ({"fmu": "unpacked", "sha256": "0", "step": None, "stop": "1"}, "planted", {}),
        ({"ssp": "planted.ssd", "sha256": "0", "step": None, "stop": "1"}, "planted", {}),
        ({}, "ir_grasp", {"scene": "foreign_scene:Scene"}),
        ({}, "ir_grasp", {"scene": "planted.fmu"}),
    ],
)
def test_nor_with_code_that_stands_elsewhere_in_its_run_json(
    source: dict[str, Any], scenario: str, files: dict[str, str], marker: Path, tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
):  # fmt: skip
    plant(tmp_path / "theirs", marker)
    monkeypatch.chdir(tmp_path / "theirs")
    for name in ("foreign_scene:Scene", "planted.fmu", "unpacked/modelDescription.xml", "planted.ssd"):
        Path(name).parent.mkdir(exist_ok=True)
        Path(name).write_bytes(b"of another hash")
    refused = repeated(
        source, tmp_path, scenario=scenario, files=files, units={"scene": {"fmu": "scene.fmu", "sha256": "0"}}
    )
    assert "not the file that the run had" in refused.output
    assert not marker.exists()


@pytest.mark.parametrize("changed", ["scene", "arm", "joint", "helper"])
def test_own_code_is_that_of_its_units_and_of_all_imports_but_those_for_type_checkers(
    changed: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    from handover.fmus.sources import carried_digest

    monkeypatch.syspath_prepend(str(tmp_path))
    name = f"foreign_{changed}"  # modules of each case are other ones
    code = {
        "scene": f'UNITS = {{"arm": "{name}_arm:Arm"}}\nif not TYPE_CHECKING:\n    import {name}_helper\n',
        "arm": f"import {name}_joint\nif TYPE_CHECKING:\n    import {name}_types\n",
        **dict.fromkeys(("joint", "helper", "types"), "x = 1\n"),
    }
    for module, text in code.items():
        (tmp_path / f"{name}_{module}.py").write_text(text)
    source = catalog.ScenarioSource(f"{name}_scene:Scene", str(tmp_path), carried_digest(f"{name}_scene:Scene"))
    (tmp_path / f"{name}_types.py").write_text("x = 2\n")
    assert source.unchanged_file() == tmp_path / f"{name}_scene.py"
    file = tmp_path / f"{name}_{changed}.py"
    file.write_text(code[changed] + "y = 2\n")
    with pytest.raises(catalog.InvalidScenario, match="is not what the run had"):
        source.unchanged_file()
    file.write_text("x = = 1\n")
    with pytest.raises(catalog.InvalidScenario, match=f"{file.name} is not Python source"):
        source.unchanged_file()


def test_code_that_is_what_the_run_had_is_named_before_it_is_run(marker: Path, tmp_path: Path):
    from handover.fmus.sources import carried_digest

    theirs = tmp_path / "theirs"
    plant(theirs, marker)
    sys.path.append(str(theirs))
    digest = carried_digest("foreign_package.scene:Scene")
    assert not marker.exists()  # its packages are not imported either
    source = {**sources(theirs)[1], "sha256": digest}
    result = repeated(source, tmp_path)
    assert (
        f"this runs the code of foreign_package.scene:Scene: {theirs / 'foreign_package' / 'scene.py'}" in result.output
    )
    assert marker.exists()
