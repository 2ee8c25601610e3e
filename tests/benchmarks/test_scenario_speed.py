"""CPU time of scenarios: their units as FMUs, coupled by the master, without recording; a whole handover of the Helix.

Run with `pytest tests/benchmarks/test_scenario_speed.py --benchmark-enable -s`. Beside it stands what the units' own
steps take of it, by the master's count, and what the master adds.
"""

import json
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture
from support.exchange.disturbed_grasp import DISTURBED, OFF

import handover
from handover.cosim.master.master import Master
from handover.cosim.stepping.options import MasterOptions
from handover.cosim.system.signals import Signals
from handover.fmus.build import cached
from handover.plants.ir_grasp.objects import Thing
from handover.scenarios.catalog import SCENARIOS
from handover.scenarios.experiment.paper import paper_values
from handover.scenarios.experiment.parameters import parse_parameters
from handover.scenarios.runs.execution.runner import experiment_system

RUNS: dict[str, tuple[str, list[str], dict[str, str]]] = {
    **{name: (name, [], {}) for name in ("flyer_impedance", "flyer_robot_to_human", "flyer_collaborative")},
    **{f"grasp of a {thing.name.lower()}": ("ir_grasp", [f"thing={thing.name.lower()}"], {}) for thing in Thing},
    **{
        f"grasp with all amiss, {correction}": ("ir_grasp", [*DISTURBED[1:], f"correction={correction}"], OFF)
        for correction in ("paper", "fast")
    },
}
"""Scenario, its parameters, and those of units; a grasp with all amiss is of an object that is carried and nudged."""


class Clock:
    """Notes the CPU time after the start, so that loading the FMUs does not count, and the simulated time."""

    def __init__(self) -> None:
        self.begin = self.t = 0.0

    def __call__(self, t: float, signals: Signals) -> None:  # noqa: ARG002
        self.begin = self.begin or time.process_time()
        self.t = t


@pytest.mark.parametrize("name", RUNS)
def test_pace(benchmark: BenchmarkFixture, name: str) -> None:
    scenario, entries, values = RUNS[name]
    kind = SCENARIOS[scenario]
    p, options, paces = parse_parameters(kind, entries), MasterOptions(cpu_times=True), list[tuple[float, float]]()
    system = experiment_system(
        kind(), p, 0, {unit: cached(block, 3) for unit, block in kind.units.items()}, values, options
    )

    def run() -> None:
        evaluator, clock = kind().evaluator(p), Clock()
        with Master(system, options) as master:
            master.run(kind().stop_time(p), [evaluator, clock], until=lambda: evaluator.over)
            spent = time.process_time() - clock.begin
        assert evaluator.over
        assert values or evaluator.outcome().success
        paces.append((clock.t / spent, sum(sum(cpu) for cpu in master.cpu.values()) / spent))

    benchmark.pedantic(run, rounds=5, warmup_rounds=1)
    median, share = np.median(paces, axis=0).tolist()
    print(f"\n{name}: {median:.0f} simulated s a CPU s, {max(paces)[0]:.0f} at best; {share:.0%} of it in the units")
    benchmark.extra_info.update(median=median, best=max(paces)[0], share=share)


def test_handover(benchmark: BenchmarkFixture, tmp_path: Path) -> None:
    """The first run loads and imports what a process of its own has to, the others do not, as in a campaign."""
    runs: list[Any] = []

    def run() -> None:
        out = tmp_path / str(len(runs))
        done = handover.run("helix_handover", seed=len(runs), units={"arm": "TendonArmFast"}, out=out, progress=False)
        assert done.success, done.reason
        runs.append(json.loads((out / "summary.json").read_text()))

    benchmark.pedantic(run, rounds=4)
    totals = [float(r["cpu_seconds"]) for r in runs]
    simulated = np.mean([float(r["simulated_seconds"]) for r in runs])
    cycle = float(np.median([r["metrics"]["cpu_per_cycle"]["value"] for r in runs]))
    published = paper_values("helix", "published")["timestep_mean"]
    print(
        f"\nhandover of {simulated:.1f} simulated s: {totals[0]:.2f} CPU s, then {np.median(totals[1:] or totals):.2f} "
        f"s each\ncontrol cycle, vision and servo: {1e3 * cycle:.1f} ms; the thesis's program, on its laptop, "
        f"{min(published):.2f} to {max(published):.2f} s (table 1)"
    )
    benchmark.extra_info.update(first_s=totals[0], cycle_s=cycle)
