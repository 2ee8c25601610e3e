"""Published values beside a run's figures: where the paper has them, for runs like the published."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli
from support.kept_runs import copied_run, kept_run

import handover.scenarios
from handover.scenarios.catalog import SCENARIOS
from handover.scenarios.experiment.paper import PublishedValue
from handover.scenarios.experiment.parameters import parse_parameters
from handover.scenarios.runs.reporting.run_page import published_section
from handover.scenarios.runs.results.run_facts import RunFacts
from handover.scenarios.runs.results.run_folder import RunFolder

RUNS = (
    ("ir_grasp", (), 3),
    ("flyer_impedance", (), 2),
    pytest.param("flyer_robot_to_human", (), 3, marks=pytest.mark.slow),
    pytest.param("flyer_human_to_robot", ("behaviour=compliant",), 1, marks=pytest.mark.slow),
)


def values_of(scenario: str, given: tuple[str, ...]) -> list[PublishedValue]:
    experiment = SCENARIOS[scenario]
    return list(experiment().published(parse_parameters(experiment, given)))


@pytest.mark.parametrize(("scenario", "given", "number"), RUNS)
def test_a_run_like_the_published_stands_beside_what_was_published(scenario: str, given: tuple[str, ...], number: int):
    folder = kept_run("run", scenario, *(text for value in given for text in ("-p", value)), "--no-report")
    assert_published(folder, scenario, given, number)


@pytest.mark.slow
def test_so_does_a_handover_by_the_helix(tmp_path: Path):
    """Of another step size than the paper's, which is what it has been changed to."""
    folder = copied_run(tmp_path / "run", "run", "helix_handover", "--seed", "3")
    run = json.loads((folder / "run.json").read_text())
    assert run["parameters"]["alpha"] == 0.25
    run["parameters"]["alpha"] = 0.4
    (folder / "run.json").write_text(json.dumps(run))
    assert_published(folder, "helix_handover", ("alpha=0.4",), 2)


def assert_published(folder: Path, scenario: str, given: tuple[str, ...], number: int) -> None:
    """Assert that a run has what was published, and a section with so many rows."""
    facts = RunFacts.read(RunFolder.of_run(folder))
    values = values_of(scenario, given)
    assert [v.metric for v in values if v.metric not in facts.summary["metrics"]] == []
    assert len(values) == number
    section = published_section(facts)
    assert section is not None
    assert section.html.count("<tr>") == 1 + number


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_every_published_value_is_in_the_paper_file(scenario: str):
    for value in values_of(scenario, ()):
        file = Path(handover.scenarios.__file__).parent / "robots" / value.paper / "paper.toml"
        entry: dict[str, Any] = tomli.loads(file.read_text(encoding="utf-8"))["published"][value.name]
        assert value.status == entry["status"]
        assert value.where == entry["where"]
        assert value.value in np.ravel(entry["value"])


def test_what_was_published_is_of_the_same_step_size_and_what_differs_is_reported():
    values = values_of("helix_handover", ("alpha=0.2",))
    first = {v.metric: v for v in values}["arm_time"]
    assert (first.value, first.limits) == (39.6, (28.4, 57.6))
    note = values_of("helix_handover", ("alpha=0.2", "tuning=thesis"))[0].note
    assert note == "its control period was 1.51 s"


def test_a_run_unlike_the_published_stands_for_itself():
    for scenario, given in (
        ("ir_grasp", "strategy=blind"),
        ("flyer_impedance", "force=2"),
        ("flyer_robot_to_human", "p_WG_handover=0,0,0"),
        ("helix_handover", "cover=left"),
        ("helix_handover", "alpha=0.3"),
        ("vsl_hybrid", "load=0.075"),
    ):
        assert values_of(scenario, (given,)) == [], (scenario, given)
