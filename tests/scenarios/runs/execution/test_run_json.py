"""A run's folder has its title, parameters, units and connections, so that a page can be made of it later."""

from types import SimpleNamespace
from typing import cast

import pytest
from support.commands import data_in
from support.cosim.native_units import native_fmu
from support.kept_runs import kept_run

from handover.cosim.system.system import System
from handover.fmus.build import cached
from handover.scenarios.robots.free_flyer.push.impedance import FlyerImpedance
from handover.scenarios.robots.ir_grasp.ir_grasp import IrGrasp
from handover.scenarios.runs.results.summary import describe_system, parameter_rows
from handover.scenarios.runs.results.task import Task


def test_units_of_parameters_are_written_as_one_reads_them():
    task = SimpleNamespace(experiment=FlyerImpedance(), parameters=FlyerImpedance.parameters_type())
    found = {name: value for name, value, _ in parameter_rows(cast(Task, task))}
    assert found["torque"].endswith(" N·m")


def test_a_scenario_says_how_it_is_presented_and_wired():
    out = kept_run("run", "ir_grasp", "--no-report")
    found, summary = data_in(out, "run"), data_in(out)
    assert found["title"] == IrGrasp.title
    assert found["headline"] == list(IrGrasp.headline)
    names = [name for name, _, _ in found["told_parameters"]]
    assert names == [v.name for v in IrGrasp.parameters()]
    assert ["forward", "0.035 m", "how far the strategy FORWARD goes before it closes"] in found["told_parameters"]
    assert found["told_parameters"][0][1] == IrGrasp.parameters_type().thing.name.lower()
    assert found["system"]["units"] == [
        {"name": "scene", "model": "GraspScene", "fmi": "3", "period": 0.015, "sampled": False},
        {"name": "reflex", "model": "IrReflex", "fmi": "3", "period": 0.015, "sampled": True},
    ]
    assert {"source": "scene.ticks", "target": "reflex.ticks", "unit": "tick", "size": 3, "kind": "real"} in (
        found["system"]["connections"]
    )
    scene, reflex = summary["units"]
    assert (scene["name"], scene["model"], scene["step"]) == ("scene", "GraspScene (FMI 3)", "15 ms")
    assert reflex["steps"] == pytest.approx(summary["simulated_seconds"] / 0.015, abs=1)
    assert 0.0 < reflex["cpu_seconds"] < scene["cpu_seconds"] < summary["cpu_seconds"]


def test_units_are_reported_as_their_sources_have_them_and_pictures_as_binary():
    s = System()
    a, b = s.add("a", native_fmu("workshop", 3)), s.add("b", native_fmu("si", 3))
    s.connect(a.y.length, b.u.length_in)
    camera, vision = s.add("camera", cached("StereoCamera", 3)), s.add("vision", cached("HandoverVision", 3))
    s.connect(camera.y.left, vision.u.left)
    s.check()
    length, picture = describe_system(s, adaptive=False)["connections"]
    assert (length["unit"], length["kind"], length["size"]) == ("mm", "real", 1)
    assert picture == {"source": "camera.left", "target": "vision.left", "unit": "", "size": 1, "kind": "binary"}
