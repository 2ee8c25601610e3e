"""Power by simulation beside what is known: the noncentral t distribution, the tests' level, studies too small."""

import json
from pathlib import Path

import pytest
from scipy import stats
from support.commands import call
from support.wording import Wording

from handover.scenarios.study.plan.plan import default_plan, parse_plan
from handover.scenarios.study.statistics.power import PowerAssumptions, fewest_participants, simulated_power

PLAN = parse_plan(default_plan())


@pytest.mark.slow
@pytest.mark.parametrize(("people", "exact"), [(10, 0.616), (18, 0.892)])
def test_the_t_test_agrees_with_the_noncentral_distribution(people: int, exact: float):
    c = stats.t.ppf(0.975, people - 1)
    assert float(stats.nct.sf(c, people - 1, 0.8 * people**0.5)) == pytest.approx(exact, abs=1e-3)
    found = simulated_power(PLAN, people, PowerAssumptions(effect=0.8, spread=30.0, repeats=1000))
    assert found.t_test.low < exact < found.t_test.high
    assert found.single_uncorrected.estimate == pytest.approx(exact - 0.018, abs=0.03)  # ranks lose some 5 %


@pytest.mark.parametrize(("people", "status"), [("8,12", 0), ("ten", 2), ("1", 2)])
def test_the_command_says_what_was_assumed_or_is_wrong(people: str, status: int, tmp_path: Path, wording: Wording):
    (tmp_path / "plan.toml").write_text(default_plan(), encoding="utf-8")
    shown = call("study", "power", tmp_path / "plan.toml", "--participants", people, "--repeat", "100")
    assert shown.exit_code == status, shown.output
    wording.check(shown.output)


def test_ten_find_an_effect_of_08_in_one_half_and_eighteen_in_nine_tenths():
    """Any of nine ratings, all of which have the effect, after Holm: for correlated ratings that hardly tie."""
    assumed = PowerAssumptions(effect=0.8, spread=30.0, correlation=0.7, repeats=1000)
    ten, eighteen = (simulated_power(PLAN, n, assumed).any_of_all_holm for n in (10, 18))
    assert ten.estimate == pytest.approx(0.48, abs=0.05)
    assert eighteen.estimate == pytest.approx(0.89, abs=0.03)


def test_without_an_effect_something_is_found_in_five_of_hundred_at_most():
    found = simulated_power(PLAN, 12, PowerAssumptions(effect=0.0, repeats=1000))
    assert found.familywise_error.low < 0.05
    assert found.single_uncorrected.estimate < 0.06
    assert found.any_of_all_holm.estimate == pytest.approx(found.familywise_error.estimate)


def test_too_few_find_nothing_after_holm():
    assert fewest_participants(9) == 9
    assert fewest_participants(1) == 6
    eight = simulated_power(PLAN, 8, PowerAssumptions(effect=5.0, repeats=100))
    assert eight.one_effect_holm.low == eight.any_of_all_holm.low == 0.0
    assert simulated_power(PLAN, 5, PowerAssumptions(effect=5.0, repeats=100)).single_uncorrected.low == 0.0
    assert simulated_power(PLAN, 9, PowerAssumptions(effect=9.0, repeats=100)).one_effect_holm.low > 0.9


def test_what_all_studies_find_is_100_percent_with_its_interval(tmp_path: Path):
    (tmp_path / "plan.toml").write_text(default_plan(), encoding="utf-8")
    arguments = ("--participants", "12", "--repeat", "100", "--effect", "9", "--json")
    data = json.loads(call("study", "power", tmp_path / "plan.toml", *arguments).output)["power"][0]
    found, error = data["single_uncorrected"], data["familywise_error"]
    assert (found["estimate"], found["successes"], found["repeats"], found["high"]) == (1.0, 100, 100, 1.0)
    assert found["low"] == pytest.approx(0.0250 ** (1 / 100), abs=1e-6)
    assert error["estimate"] == error["successes"] / 100
