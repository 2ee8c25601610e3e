"""Metrics of the controllers' closed loops, of those controllers that give them."""

import numpy as np
import pytest

from handover.cosim.blocks.variable import Causality, Kind
from handover.cosim.fmu.description import FmuPort
from handover.cosim.system.signals import Signals
from handover.scenarios.free_flyer.robot_wiring import stability_metrics


def test_a_controller_that_does_not_give_its_poles_has_no_metrics_of_them():
    poles = {"pole_radius": 0.9, "damping_ratio": 0.7, "pole_frequency": 2.0}
    given = {"pose": poles, "impedance": {"pole_radius": 0.9}}
    views = {unit: {name: (np.array([x]),) for name, x in values.items()} for unit, values in given.items()}
    ports = {
        unit: {
            name: FmuPort(name=name, kind=Kind.REAL, causality=Causality.OUTPUT, fmi_type="", references=())
            for name in values
        }
        for unit, values in given.items()
    }
    metrics = stability_metrics(Signals(views, ports, views), ("impedance", "pose"))
    assert set(metrics) == {f"{m}_pose" for m in ("pole_margin", "slowest_decay", "damping_ratio", "frequency")}
    assert metrics["pole_margin_pose"].value == pytest.approx(0.1)
