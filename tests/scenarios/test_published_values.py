"""Published values beside a run's figures: where the paper has them, for runs like the published."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli
from flyer_runs import run

import handover.scenarios
from handover.scenarios.catalog import SCENARIOS
from handover.scenarios.experiment.paper import PublishedValue
from handover.scenarios.experiment.parameters import parse_parameters
from handover.scenarios.reporting.run_page import published_section
from handover.scenarios.results.run_facts import RunFacts
from handover.scenarios.results.run_folder import RunFolder

FAST = {
    "ir_grasp": {(): 3},
    "flyer_impedance": {(): 2},
    "flyer_robot_to_human": {("behaviour=compliant",): 3},
    "flyer_human_to_robot": {(): 1},
}
HELIX = {("alpha=0.4",): 2}


def values_of(scenario: str, given: tuple[str, ...]) -> list[PublishedValue]:
    experiment = SCENARIOS[scenario]
    return list(experiment().published(parse_parameters(experiment, given)))


def check(scenario: str, given: tuple[str, ...], number: int, folder: Path) -> None:
    """Run it, and compare the section's rows with the paper file."""
    run(SCENARIOS[scenario], folder, *given)
    facts = RunFacts.read(RunFolder.of_run(folder))
    values = values_of(scenario, given)
    assert [v.metric for v in values if v.metric not in facts.summary["metrics"]] == []
    assert len(values) == number
    section = published_section(facts)
    assert section is not None
    assert section.html.count("<tr>") == 1 + number


@pytest.mark.parametrize(
    ("scenario", "given", "number"), [(name, given, n) for name, cases in FAST.items() for given, n in cases.items()]
)
def test_a_run_like_the_published_stands_beside_what_was_published(
    scenario: str, given: tuple[str, ...], number: int, tmp_path: Path
):
    check(scenario, given, number, tmp_path / "run")


@pytest.mark.slow
@pytest.mark.parametrize(("given", "number"), HELIX.items())
def test_so_does_a_handover_by_the_helix(given: tuple[str, ...], number: int, tmp_path: Path):
    check("helix_handover", given, number, tmp_path / "run")


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_every_published_value_is_in_the_paper_file(scenario: str):
    for value in values_of(scenario, ()):
        file = Path(handover.scenarios.__file__).parent / value.paper / "paper.toml"
        entry: dict[str, Any] = tomli.loads(file.read_text(encoding="utf-8"))["published"][value.name]
        assert value.status == entry["status"]
        assert value.where == entry["where"]
        assert value.value in np.ravel(entry["value"])


def test_the_times_of_the_thesis_are_those_of_the_step_size():
    first = {v.metric: v for v in values_of("helix_handover", ("alpha=0.2",))}["arm_time"]
    assert (first.value, first.limits) == (39.6, (28.4, 57.6))


def test_what_differs_from_the_published_runs_is_reported():
    note = values_of("helix_handover", ("alpha=0.2", "tuning=thesis"))[0].note
    assert note == "its control period was 1.51 s"
    assert values_of("helix_handover", ("alpha=0.3",)) == []


@pytest.mark.parametrize(
    ("scenario", "given"),
    [
        ("ir_grasp", "strategy=blind"),
        ("flyer_impedance", "force=2"),
        ("flyer_robot_to_human", "p_WG_handover=0,0,0"),
        ("helix_handover", "cover=left"),
        ("vsl_hybrid", "load=0.075"),
    ],
)
def test_a_run_unlike_the_published_stands_for_itself(scenario: str, given: str):
    assert values_of(scenario, (given,)) == []
