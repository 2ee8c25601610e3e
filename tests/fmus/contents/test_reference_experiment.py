"""The default stimulus, and the tolerance of a result: what small changes of the inputs make of the outputs."""

from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from handover.cosim.blocks.ports import Width
from handover.cosim.experiments.experiment_run import stimulus_columns
from handover.cosim.experiments.reference_experiment import ABSOLUTE, Difference, Setup
from handover.cosim.experiments.signal_table import SignalTable
from handover.cosim.fmu.file.description import describe_fmu
from handover.fmus.build import ExperimentRequest, build
from handover.fmus.catalog import Entry
from handover.fmus.contents.reference_experiment import (
    RecordedExperiment,
    Tolerance,
    default_stimulus,
    largest_difference,
    measured,
    perturbed,
    record_experiment,
    relative_tolerance,
)
from handover.fmus.contents.related_files import CannotRecordExperiment

STEP = Fraction(1, 10)
CHAOTIC, RANDOM, EVERY_KIND = (
    Entry(block.rpartition(":")[2], f"support.sample_units.{block}", STEP, "a sample")
    for block in ("chaotic:Chaotic", "chaotic:Random", "every_kind:EveryKind")
)


@pytest.fixture(scope="module")
def chaotic(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build(CHAOTIC, 3, tmp_path_factory.mktemp("unit"), platforms=["host"])


def recorded(fmu: Path, folder: Path, stimulus: str) -> RecordedExperiment:
    given = folder / "given.csv"
    given.write_text(f"time,x\n{stimulus}")
    return record_experiment(fmu, STEP, given)


def text_of(experiment: RecordedExperiment) -> str:
    return " ".join(experiment.text_lines("stimulus.csv", "result.csv"))


@pytest.mark.slow
def test_the_tolerance_is_what_rounding_makes_of_the_outputs(chaotic: Path, tmp_path: Path):
    """A difference of 1e-13 of 0.3 becomes 2^20 times that in 20 steps: 3e-8 of 0.3; in 50 nothing of it is left."""
    experiment = recorded(chaotic, tmp_path, "0.0,0.3\n2.0,0.3\n")
    assert 10 * 3e-14 * 2**20 / 0.95 <= experiment.setup.relative <= 2 * 10 * 3e-14 * 2**20 / 0.3
    assert "It is measured: real" in text_of(experiment)
    with pytest.raises(CannotRecordExperiment, match="output 'y' changes as inputs round"):
        build(CHAOTIC, 3, tmp_path / "out", platforms=["host"], experiment=ExperimentRequest())
    assert not (tmp_path / "out").exists()


def test_an_input_at_0_is_off_it_by_a_share_of_its_range(chaotic: Path, tmp_path: Path):
    """1e-13 of the range of 1 m becomes 2^5 times that in 5 steps, of an output that rests at 0."""
    experiment = recorded(chaotic, tmp_path, "0.0,0.0\n0.5,0.0\n")
    assert experiment.setup.absolute == 4e-11
    assert experiment.setup.relative == 1e-9
    assert experiment.tolerance.is_measured
    assert "those at 0 were off it by 1e-13 of the largest value" in text_of(experiment)


@pytest.mark.slow
def test_inputs_stay_at_0_where_what_comes_of_them_is_more_than_a_tolerance(chaotic: Path, tmp_path: Path):
    """The unit reads its input at the start only: 1e-13 of 0.3 m is 2^20 times that in 20 steps."""
    experiment = recorded(chaotic, tmp_path, "0.0,0.0\n1.0,0.3\n2.0,0.3\n")
    assert (experiment.setup.relative, experiment.setup.absolute) == (1e-9, ABSOLUTE)
    assert experiment.tolerance.is_measured
    at_zero = experiment.tolerance.at_zero
    assert at_zero is not None
    assert at_zero.greatest == pytest.approx(1e-13 * 0.3 * 2**20)
    change = f"as off it they change y by {at_zero.greatest:.2g} from 0"
    assert f"by 1e-7), and those at 0 stayed there, {change}" in text_of(experiment)


def test_a_zero_is_off_by_a_share_of_what_its_input_is_elsewhere(tmp_path: Path):
    d = describe_fmu(build(EVERY_KIND, 2, tmp_path, platforms=["host"]))
    columns = stimulus_columns(d)
    given = {"v[1]": [0.0, 0.0], "v[2]": [0.0, -4.0], "a": [0.0, 0.0], "k": [0, 0], "M[1,1]": [2.0, 0.0]}
    table = SignalTable([Fraction(0), Fraction(1)], given)
    off = perturbed(table, columns, off_zero=True).columns
    assert off["v[1]"] == [4e-13, 4e-13]
    assert off["v[2]"] == [4e-13, -4.0 * (1 - 1e-13)]
    assert off["a"] == [1e-13, 1e-13]
    assert off["M[1,1]"] == [2.0 * (1 - 1e-13), 2e-13]
    assert off["k"] == [0, 0]
    stay = perturbed(table, columns, off_zero=False).columns
    assert stay == {**given, "v[2]": [0.0, off["v[2]"][1]], "M[1,1]": [off["M[1,1]"][0], 0.0]}


OFF: list[tuple[float, dict[str, Any], float]] = [
    (0.0, {"nominal": 500.0}, 5e-11),
    (0.0, {"minimum": -2.0, "maximum": 8.0}, 8e-13),
    (0.0, {"minimum": 0.0}, 1e-13),
    (0.0, {"minimum": -2.0, "maximum": 0.0}, -2e-13),
    (0.0, {"minimum": 0.0, "maximum": 0.0}, 0.0),
    (0.0, {"width": Width.FLOAT32}, 1e-13),
    (0.5, {"minimum": 0.5, "maximum": 1.0}, 0.5 * (1 + 1e-13)),
    (1.0, {"minimum": 0.5, "maximum": 1.0}, 1.0 - 1e-13),
    (-0.5, {"minimum": -1.0, "maximum": -0.5}, -0.5 * (1 + 1e-13)),
    (0.5, {"minimum": 0.5, "maximum": 0.5}, 0.5),
    (0.5, {"width": Width.FLOAT32}, 0.5 - 2**-24),
    (0.5, {"width": Width.FLOAT32, "minimum": 0.5}, 0.5 + 2**-24),
    (0.3, {"width": Width.FLOAT32}, float(np.nextafter(np.float32(0.3), np.float32(0)))),
]
"""An input, what it declares, and what it is off to."""


def test_an_input_is_off_by_what_its_range_and_width_allow(chaotic: Path):
    x = describe_fmu(chaotic).inputs["x"]
    for value, declared, wanted in OFF:
        bounds: dict[str, Any] = {"minimum": None, "maximum": None, **declared}
        table = SignalTable([Fraction(0)], {"x": [value]})
        (found,) = perturbed(table, {"x": (replace(x, **bounds), 0)}, off_zero=True).columns["x"]
        assert found == (wanted if value else pytest.approx(wanted, rel=1e-7)), (value, declared)


def test_a_unit_that_is_random_whatever_its_inputs_is_not_said_to_round(tmp_path: Path):
    fmu = build(RANDOM, 3, tmp_path, platforms=["host"])
    with pytest.raises(CannotRecordExperiment, match=r"output 'y' changes from one run to the next .* a seed alone"):
        recorded(fmu, tmp_path, "0.0,0.3\n0.5,0.3\n")


def test_that_no_input_could_be_off_is_said():
    text = Tolerance(None, ABSOLUTE, is_measured=False).text
    assert text.startswith("It is not measured: there is no real input that could be off within its range.")


def test_the_last_place_of_a_single_precision_output_is_allowed():
    """It is beyond 1e-9 of the value, and what other machines may round the other way."""
    last, second = (Difference("y", n * 2.0**-23, 0.1, 1.0, resolution=2.0**-23) for n in (1, 2))
    setup = Setup(relative=1e-9, absolute=0.0)
    assert last.greatest <= setup.allowed(last)
    assert second.greatest > setup.allowed(second)
    assert setup.allowed(replace(last, resolution=0.0)) == 1e-9
    assert measured([last], is_measured=True).relative == 1e-9
    assert measured([second], is_measured=True).relative == 3e-6


def test_noise_of_an_output_at_rest_hides_no_other():
    resting, apart = Difference("resting", 1e-16, 0.1, 0.0), Difference("apart", 1e-4, 0.2, 1.0)
    assert largest_difference([resting, apart]) is apart
    assert relative_tolerance(apart) == 1e-3
    assert largest_difference([resting]) is None
    assert relative_tolerance(None) == 1e-9


def test_what_rests_at_0_has_an_absolute_tolerance_within_limits():
    apart = Difference("apart", 1e-8, 0.2, 1.0)
    found = measured([Difference("resting", 3.1e-12, 0.1, 0.0), apart], is_measured=True)
    assert found == Tolerance(apart, 4e-11, is_measured=True)
    assert found.relative == 1e-7
    moved = Difference("resting", 1e-7, 0.1, 0.0)
    assert measured([moved, apart], is_measured=True) == Tolerance(moved, ABSOLUTE, is_measured=True)
    assert not measured([moved], is_measured=True).is_useful


def test_the_default_stimulus_moves_what_has_a_unit_or_a_range(tmp_path: Path):
    d = describe_fmu(build(EVERY_KIND, 2, tmp_path, platforms=["host"]))
    columns = default_stimulus(d, Fraction(1, 10)).columns
    moved = {name for name, values in columns.items() if len(set(values)) > 1}
    assert moved == {*(f"v[{i}]" for i in (1, 2, 3)), *(f"M[{i},{j}]" for i in (1, 2, 3) for j in (1, 2, 3))}
    assert columns["v[1]"][9:12] == [0.1, 0.11, 0.11]
    assert columns["v[2]"][10:31:10] == pytest.approx([-0.2, -0.195, -0.19])
    x = default_stimulus(describe_fmu(build(CHAOTIC, 2, tmp_path, platforms=["host"])), Fraction(1, 10)).columns["x"]
    assert x[9:11] == [0.3, 0.4]
