"""`handover info`, `handover list --json` and what they tell of FMUs, SSPs, units and scenarios."""

import base64
import json
import logging
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar

import pytest
from support.commands import call, refusal
from support.cosim.native_units import native_fmu
from support.rewritten_archive import described_otherwise

from handover.cosim.system.system import System
from handover.fmus.build import cached
from handover.fmus.catalog import UNITS, PackageFailure
from handover.fmus.contents.icons import catalog_icon
from handover.scenarios.cli.list import place_data, print_place
from handover.scenarios.experiment.places import Place
from handover.scenarios.robots.ir_grasp.ir_grasp import IrGrasp
from handover.scenarios.runs.execution.errors import UsageError
from handover.scenarios.runs.execution.unit_values import built_system

FEW = ("Push", "IrReflex")


def data_of(*arguments: object) -> Any:
    result = call(*arguments, "--json")
    assert result.exit_code == 0, result.output
    return json.loads(result.output)


def test_an_fmus_ports_steps_and_capabilities():
    file = cached("Thrusters", 3)
    data = data_of("info", file)
    assert (data["name"], data["fmi"], data["step"], data["sampled"]) == ("Thrusters", 3, 0.016, False)
    assert data["capabilities"]["saves_state"]
    parameters = {p["name"]: p for p in data["parameters"]}
    assert parameters["f_max"]["start"] == [0.55, 0.39, 0.45]
    assert parameters["lag"] == {
        "name": "lag",
        "type": "real",
        "shape": [],
        "unit": "s",
        "start": 0.02,
        "minimum": 0.0,
        "maximum": 10.0,
        "items": None,
        "description": "time constant of the first-order lag",
    }
    printed = call("info", file).output
    assert "Thrusters: an FMU of FMI 3.0" in printed
    assert "16 ms is proposed" in printed
    assert "its state can be saved" in printed
    assert "time constant of the first-order lag" in printed


def test_an_ssps_units_and_connections(tmp_path: Path):
    file = tmp_path / "grasp.ssp"
    assert call("export", "ir_grasp", "--ssp", file).exit_code == 0
    data = data_of("info", file)
    assert data["stop"] == 90.0
    assert data["units"]["reflex"]["model"] == "IrReflex"
    assert ["reflex.p_WH_cmd", "scene.p_WH_cmd"] in data["connections"]
    (seed,) = [p for p in data["parameters"] if p["name"] == "scene.seed"]
    assert seed["start"] > 0  # as the file binds it; its FMU starts from 0
    printed = call("info", file).output
    assert "ir_grasp: a system of 2 units, until 90 s" in printed
    assert "reflex.sigma_cmd" in printed
    assert "Parameters, which -p of `handover run` sets" in printed


def test_list_as_data():
    catalog = data_of("list")
    assert catalog["scenarios"]["ir_grasp"].startswith("a soft hand grasps")
    assert "VslArm" in catalog["units"]
    scenario = data_of("list", "ir_grasp")
    assert scenario["units"] == {"scene": "GraspScene", "reflex": "IrReflex"}
    strategy = next(p for p in scenario["parameters"] if p["name"] == "strategy")
    assert (strategy["start"], strategy["items"]) == ("REFLEX", ["REFLEX", "BLIND", "FORWARD", "CONTACT"])
    unit = data_of("list", "Thrusters")
    assert unit["step"] == 0.016
    assert [p["name"] for p in unit["outputs"]] == ["f_B", "tau_B", "saturated", "flapper_angles", "impeller_speeds"]


def test_a_unit_whose_package_is_missing_is_reported_in_one_line(monkeypatch: pytest.MonkeyPatch):
    def lacking(path: str) -> type[Any]:
        raise PackageFailure(path, "exudyn is missing")

    monkeypatch.setattr("handover.scenarios.cli.list.import_class", lacking)
    for as_json in ((), ("--json",)):
        (line,) = refusal("list", "TendonArm", *as_json).splitlines()
        assert line.endswith("exudyn is missing")


class Misplaced(IrGrasp):
    """A scenario that names a port which its own unit does not have."""

    places: ClassVar[Mapping[str, Place]] = {"reflex": Place(required={"sigma_cmt": ""})}


def test_a_place_with_a_port_that_there_is_not_is_reported():
    for show in (place_data, print_place):
        with pytest.raises(UsageError, match="place reflex: 'sigma_cmt' is not a port or parameter of IrReflex"):
            show(Misplaced, "reflex")


def test_an_export_replaces_a_file_only_when_forced(tmp_path: Path):
    file = tmp_path / "grasp.ssp"
    file.write_text("something")
    assert "it is there already; --force replaces it" in refusal("export", "ir_grasp", "--ssp", file)
    assert file.read_text() == "something"
    assert call("export", "ir_grasp", "--ssp", file, "--force").exit_code == 0
    assert file.stat().st_size > 1000


def test_an_export_does_not_replace_a_file_that_comes_to_be_meanwhile(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    file = tmp_path / "grasp.ssp"

    def meanwhile(*arguments: Any) -> System:
        file.write_text("of another process")
        return built_system(*arguments)

    monkeypatch.setattr("handover.scenarios.cli.export.built_system", meanwhile)
    refused = refusal("export", "ir_grasp", "--ssp", file)
    assert "it is there already; --force replaces it" in refused
    assert [p.read_text() for p in tmp_path.iterdir()] == ["of another process"]


def test_the_page_of_all_units_has_each_with_its_icon_and_ports(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("handover.scenarios.cli.units.units_page.UNITS", {n: UNITS[n] for n in FEW})
    monkeypatch.setattr("handover.scenarios.cli.units.units_page.SYSTEMS", ())
    for module in ("handover.scenarios.cli.units.units_page", "handover.fmus.catalog"):
        monkeypatch.setattr(f"{module}.installed_units", lambda: {"Lost": "nowhere:Lost"})
    file = tmp_path / "units.html"
    result = call("list", "--html", file)
    assert (result.exit_code, result.stdout) == (0, f"{file}\n")
    html = file.read_text()
    assert re.findall(r'<article class="unit" id="unit-(.*?)"', html) == [*FEW, "Lost"]
    for name in FEW:
        picture = base64.b64encode(catalog_icon(name).read_bytes()).decode()
        assert f'<img src="data:image/svg+xml;base64,{picture}"' in html
        assert UNITS[name].summary in html
    assert "pulse of force and torque on a gripper" in html
    assert len(re.findall(r"<details><summary>", html)) == len(FEW)
    assert "there is no module &#39;nowhere&#39;" in html
    assert len(html) < 100_000  # without Plotly, which has megabytes


def test_a_start_value_without_a_number_and_a_name_without_end_are_shown(tmp_path: Path):
    def odd(text: str) -> str:
        return text.replace('start="1.0"', 'start=""').replace('modelName="spring"', f'modelName="{"s" * 10**6}"')

    file = described_otherwise(native_fmu("spring", 3), tmp_path / "odd.fmu", odd)
    assert {p["name"]: p["start"] for p in data_of("info", file)["parameters"]} == {"k": [], "d": 0.0}
    printed = call("info", file).output
    assert "characters more" in printed
    assert len(printed) < 20_000


def test_warnings_that_are_logged_steer_no_terminal(capfd: pytest.CaptureFixture[str]):
    call("info", "none.fmu")  # any command does
    assert logging.lastResort is not None
    logging.lastResort.emit(logging.LogRecord("handover", logging.WARNING, "", 0, "of \x1b[31m%s", ("\u202ea",), None))
    assert capfd.readouterr().err == "of \ufffd[31m\ufffda\n"
