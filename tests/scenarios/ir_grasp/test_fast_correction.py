"""The correction on the move in the scenario, on the built FMUs."""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner
from support.kept_runs import kept_run

from handover.controllers.ir_grasp.ir_reflex import Inputs, IrReflex
from handover.controllers.ir_grasp.parameters import Correction, Strategy
from handover.controllers.ir_grasp.parameters import Params as ReflexParams
from handover.cosim.blocks.ports import Floats
from handover.cosim.master.master import Master
from handover.cosim.record.reader import Record
from handover.cosim.system.signals import Signals
from handover.fmus.build import cached
from handover.scenarios.cli.command import main
from handover.scenarios.experiment.experiment import Outcome
from handover.scenarios.ir_grasp.ir_grasp import IrGrasp
from handover.scenarios.ir_grasp.parameters import Parameters, Situation

_COMMANDS = ("p_WH_cmd", "yaw_cmd", "sigma_cmd", "distance", "cost")


def fmu(unit: str) -> Path:
    return cached(IrGrasp.units[unit], 3)


class Shadow:
    """A block in this process that reads what the FMU reads, and notes both outputs."""

    def __init__(self, p: Parameters, seed: int) -> None:
        drawn = Situation.draw(p, seed)
        self._block = IrReflex(
            ReflexParams(
                strategy=p.strategy,
                correction=p.correction,
                p_WH_pregrasp=drawn.p_WH_pregrasp,
                yaw_pregrasp=drawn.yaw,
            )
        )
        self.own: list[Floats] = []
        self.of_fmu: list[Floats] = []
        self.phases: set[str] = set()

    def __call__(self, t: float, signals: Signals) -> None:
        u = Inputs(
            ticks=signals["scene.ticks"],
            p_WH=signals["scene.p_WH_meas"],
            yaw=float(signals["scene.yaw_meas"]),
            sigma=float(signals["scene.sigma_meas"]),
            tension=float(signals["scene.tension_meas"]),
            q=signals["scene.q_meas"],
        )
        y = self._block.step(t, 0.015, u)
        self.own.append(np.concatenate([np.atleast_1d(getattr(y, name)) for name in _COMMANDS]))
        self.of_fmu.append(np.concatenate([np.atleast_1d(signals[f"reflex.{name}"]) for name in _COMMANDS]))
        self.phases.add(signals.text("reflex.phase"))


def grasp(seed: int, **parameters: Any) -> tuple[Outcome, Shadow]:
    p, experiment = Parameters(**parameters), IrGrasp()
    evaluator, shadow = experiment.evaluator(p), Shadow(p, seed)
    with Master(experiment.build(p, seed, fmu)) as master:
        master.run(experiment.stop_time(p), [evaluator, shadow], until=lambda: evaluator.over)
    return evaluator.outcome(), shadow


@pytest.mark.parametrize(
    "given",
    [
        {"correction": Correction.FAST, "shift": np.array([0.05, 0.04])},
        pytest.param({"strategy": Strategy.CONTACT, "perturbed": False}, marks=pytest.mark.slow),
    ],
)
def test_the_fmu_does_what_the_block_does_bit_for_bit(given: dict[str, Any]):
    outcome, shadow = grasp(7, **given)
    assert np.array_equal(np.array(shadow.own), np.array(shadow.of_fmu))
    assert outcome.success
    if "correction" in given:
        assert {"SEARCH", "RECOVER", "TRACK", "CLOSE"} <= shadow.phases


@pytest.mark.slow
def test_an_object_carried_at_15_mm_a_second_is_held():
    outcome, shadow = grasp(8, correction=Correction.FAST, carried_speed=0.015)
    assert outcome.success
    assert outcome.metrics["refinement_time"].value < 3.0
    assert outcome.metrics["displacement"].value < 5e-3
    assert outcome.metrics["steps"].value > 0
    assert "TRACK" in shadow.phases


@pytest.mark.slow
def test_a_run_begins_with_what_the_last_one_learnt_of_the_jacobian(tmp_path: Path):
    given = ("-p", "correction=fast", "-p", "perturbed=false", "--no-report")
    last = kept_run("run", "ir_grasp", *given)
    learnt = Record(last / "signals.parquet")["reflex.jacobian_offset"]
    assert np.max(np.abs(learnt[-1])) > 0.01
    second = ["run", "ir_grasp", *given, "--stop", "0.1", "-p", f"last_grasp={last}", "--out", str(tmp_path / "second")]
    CliRunner().invoke(main, second)
    begun = Record(tmp_path / "second" / "signals.parquet")["reflex.jacobian_offset"]
    assert begun[0] == pytest.approx(learnt[-1], abs=1e-12)  # to rounding: the design is added and taken off
    assert np.array_equal(learnt[0], np.zeros((3, 4)))


def test_a_last_grasp_that_is_none_is_refused(tmp_path: Path):
    fast = Parameters(correction=Correction.FAST, last_grasp=str(tmp_path))
    assert fast.faults() == [
        f"last_grasp: there is no record {tmp_path / 'signals.parquet'}; name the folder of a run of ir_grasp"
    ]
    pq.write_table(pa.table({"time": [0.0], "reflex.steps": [0]}), tmp_path / "signals.parquet")
    (fault,) = fast.faults()
    assert "has no signal reflex.jacobian_offset" in fault
    (fault,) = dataclasses.replace(fast, correction=Correction.PAPER).faults()
    assert fault == "last_grasp: its Jacobian is what correction=fast of strategy=reflex begins with"
