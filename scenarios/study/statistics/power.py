"""Power analysis by simulation: the study's own tests on simulated ratings.

Effects are in standard deviations of the participants' differences between the two behaviours, each of means of the
rounds of a task. Ratings come in whole steps, so differences are rounded to them, and there are ties and zeros. They
are not clipped to the ends of the scale: where most ratings are near an end, differences are smaller, ties more
frequent, and the power is below what is simulated.
"""

from dataclasses import dataclass

import numpy as np
from scipy import stats

from handover.cosim.blocks.ports import Floats
from handover.scenarios.runs.campaign.statistics import LEVEL, holm, success_interval
from handover.scenarios.study.plan.plan import StudyPlan
from handover.scenarios.study.statistics.exact_tests import MIN_PARTICIPANTS, signed_rank_p


@dataclass(frozen=True, kw_only=True)
class PowerAssumptions:
    """What is assumed of ratings.

    Attributes:
        effect: mean difference of the behaviours, in standard deviations of the participants' differences.
        spread: that standard deviation, in points of the scale. The thesis gives none: 1.5 of 1 to 9 is assumed.
        correlation: of a participant's differences in all statements and tasks.
        repeats: simulated studies.
        seed: of their random numbers.
    """

    effect: float
    spread: float = 1.5
    correlation: float = 0.6
    repeats: int = 2000
    seed: int = 0


@dataclass(frozen=True)
class Share:
    """Simulated studies that reject, with the interval of Clopper and Pearson at 95 % of the simulation.

    Attributes:
        estimate: successes / repeats.
    """

    successes: int
    repeats: int
    low: float
    high: float

    @property
    def estimate(self) -> float:
        """The share of studies that reject."""
        return self.successes / self.repeats


@dataclass(frozen=True, kw_only=True)
class Power:
    """In how many of all simulated studies the tests find effects.

    Attributes:
        participants: of each study.
        tests: how many ratings are tested: statements x tasks.
        single_uncorrected: of one test that nobody corrects.
        one_effect_holm: of one effect where all tests are corrected by Holm and no other has an effect.
        each_of_all_holm: of each effect where all tests are corrected by Holm and all have the same.
        any_of_all_holm: that any is found there.
        familywise_error: that anything is found after Holm where nothing has an effect.
        t_test: of the paired t-test on the same differences, which nobody corrects: for comparison.
    """

    participants: int
    tests: int
    single_uncorrected: Share
    one_effect_holm: Share
    each_of_all_holm: Share
    any_of_all_holm: Share
    familywise_error: Share
    t_test: Share


def simulated_power(plan: StudyPlan, participants: int, assumed: PowerAssumptions) -> Power:
    """Return what the tests of a plan's ratings find with so many participants.

    The exact signed-rank test at 5 %, two-sided, of participants' means; Holm over all statements and tasks.
    """
    tests = len(plan.statements) * len(plan.tasks)
    rng = np.random.default_rng([assumed.seed, participants])
    shape = (assumed.repeats, tests, participants)
    shared = rng.standard_normal((assumed.repeats, 1, participants))
    own = rng.standard_normal(shape)
    noise: Floats = np.sqrt(assumed.correlation) * shared + np.sqrt(1.0 - assumed.correlation) * own
    with_effect = _rounded(noise + assumed.effect, assumed.spread, plan.repetitions)
    p_effect, p_null = _p_values(with_effect), _p_values(_rounded(noise, assumed.spread, plan.repetitions))
    p_first: Floats = np.concatenate([p_effect[:, :1], p_null[:, 1:]], axis=1)
    all_corrected = _corrected(p_effect)
    return Power(
        participants=participants,
        tests=tests,
        single_uncorrected=_share(p_effect[:, 0]),
        one_effect_holm=_share(_corrected(p_first)[:, 0]),
        each_of_all_holm=_share(all_corrected[:, 0]),
        any_of_all_holm=_share(all_corrected.min(axis=1)),
        familywise_error=_share(_corrected(p_null).min(axis=1)),
        t_test=_share(_t_test(with_effect[:, 0])),
    )


def fewest_participants(tests: int) -> int:
    """Return with how many participants an exact signed-rank test can reject at all after Holm over so many tests."""
    n = MIN_PARTICIPANTS
    while 2.0**-n * 2.0 * tests >= LEVEL:
        n += 1
    return n


def _rounded(standard: Floats, spread: float, repetitions: int) -> Floats:
    """Return differences in points: of means of so many whole ratings."""
    return np.rint(standard * spread * repetitions) / repetitions


def _p_values(differences: Floats) -> Floats:
    if differences.shape[-1] < MIN_PARTICIPANTS:
        return np.ones(differences.shape[:-1])
    return signed_rank_p(differences)


def _t_test(differences: Floats) -> Floats:
    """Return the p-values of paired t-tests, by the last axis; 1 where all participants differ alike."""
    n = differences.shape[-1]
    deviation: Floats = differences.std(axis=-1, ddof=1)
    t: Floats = differences.mean(axis=-1) / np.maximum(deviation, 1e-12) * np.sqrt(n)
    return np.where(deviation > 0.0, 2.0 * stats.t.sf(np.abs(t), n - 1), 1.0)


def _corrected(p: Floats) -> Floats:
    return np.array([holm(row.tolist()) for row in p])


def _share(p: Floats) -> Share:
    """Return the share of p-values that reject."""
    successes = int(np.count_nonzero(p < LEVEL))
    interval = success_interval(successes, len(p))
    return Share(successes, len(p), interval.low, interval.high)
