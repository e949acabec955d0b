from collections.abc import Callable
from pathlib import Path

import cma
import numpy as np
import pytest

from fidelity.programs.function import FunctionLevel
from mfopt.arrays import Array
from mfopt.campaign.driver import Progress
from mfopt.campaign.executor import Runner, one_thread
from mfopt.campaign.run import run_study
from mfopt.campaign.store import create, open_run
from mfopt.errors import ConfigError
from mfopt.records.evaluation import Candidate, Insight
from mfopt.records.level import Ladder
from mfopt.records.problem import Problem, Variable
from mfopt.search.cmaes import CmaEs
from mfopt.search.noise_share import NoiseShare, belief, believed_values
from mfopt.search.ranking import recombination_weights
from mfopt.search.reevaluation import (
    ALPHA_T,
    MOST_RUNS,
    THETA,
    EliteDoubt,
    Reevaluation,
    UncertaintyHandling,
    gains,
    uncertainty,
)
from mfopt.search.search import Reevaluate, Stage
from mfopt.study.file import SearchSettings

RULES: list[Reevaluate] = ["ranks", "elite"]
Measure = Callable[[Candidate], float]


PROBLEM = Problem(tuple(Variable(f"x{i}", -5.0, 5.0) for i in range(4)), np.full(4, 3.0))


def search(rule: Reevaluate, generations: int = 20) -> CmaEs:
    stage = Stage("l", generations, 10, seeds=2, objective="returned", reevaluate=rule)
    return CmaEs(PROBLEM, [stage], seed=7)


def sphere(candidate: Candidate) -> float:
    return float(np.sum(candidate.x**2))


def chance(candidate: Candidate) -> float:
    """A value that says nothing, but is the same whenever the candidate is told."""
    return float(np.random.default_rng(candidate.index).normal())


def drive(
    its: CmaEs, measure: Measure, order: int | None = None
) -> tuple[list[Candidate], list[Insight]]:
    """Run to the end; with `order` one result at a time, in an order by chance."""
    rng = np.random.default_rng(order)
    asked: list[Candidate] = []
    insights: dict[int, Insight] = {}
    while its.should_stop() is None:
        out = its.ask() if order is None else [c for _ in range(99) for c in its.ask(1)]
        asked += out
        if order is None:
            its.tell(out, [measure(c) for c in out])
        else:
            for i in rng.permutation(len(out)):
                its.tell([out[i]], [measure(out[i])])
        if its.insight is not None:
            insights[its.insight.generation] = its.insight
    return asked, list(insights.values())


def first_runs(asked: list[Candidate]) -> Array:
    """Designs without the replicates, which follow in the generation."""
    seen: set[tuple[int, bytes]] = set()
    fresh = []
    for c in asked:
        if (c.generation, c.x.tobytes()) not in seen:
            fresh.append(c.x)
        seen.add((c.generation, c.x.tobytes()))
    return np.array(fresh)


@pytest.mark.parametrize("seed", range(5))
def test_rank_changes_and_uncertainty_are_those_of_pycma(seed: int) -> None:
    # pycma averages both limits and does not double the rank change: s is twice its measure.
    rng = np.random.default_rng(seed)
    old = rng.normal(size=12)
    again = [0, 3, 4]
    new = old.copy()
    new[again] += rng.normal(size=3)
    handler = cma.NoiseHandler(4)
    handler.theta, handler.cum = THETA, 1.0
    handler.fit, handler.fitre, handler.idx = list(old), list(new), np.array(again)
    measure, single = handler.update_measure()
    change, s = uncertainty(old, new, again)
    assert s == pytest.approx(2.0 * measure, rel=1e-12, abs=1e-12)
    alone = [uncertainty(old, new, [i])[1] for i in again]
    np.testing.assert_allclose(alone, 2.0 * single, atol=1e-12)
    assert np.all(change[np.setdiff1d(np.arange(12), again)] == 0.0)


def test_rank_change_counts_the_values_strictly_between() -> None:
    old = np.array([1.0, 2.0, 3.0, 4.0])
    new = np.array([3.5, 2.0, 3.0, 4.0])  # the first passes 2, 2, 3 and 3
    change, _ = uncertainty(old, new, [0])
    np.testing.assert_array_equal(change, [4.0, 0.0, 0.0, 0.0])


def test_the_measurement_grows_in_noise_and_shrinks_without() -> None:
    # Algorithm 4: by ALPHA_T up to the longest, then the step size grows; back by the same.
    noisy = [[float(i), 20.0 - i] if i < 2 else [float(i)] for i in range(10)]
    rule: Reevaluation = UncertaintyHandling(4)
    factors: list[float] = []
    for _ in range(8):
        settled = rule.settled(noisy, NoiseShare())
        rule, factors = settled.after, [*factors, settled.sigma_factor]
    assert isinstance(rule, UncertaintyHandling)
    assert rule.length == MOST_RUNS
    assert factors == [1.0] * 6 + [1.0 + 2.0 / 14.0] * 2
    calm = [[float(i), i + 0.1] if i < 2 else [float(i)] for i in range(10)]
    after = rule.settled(calm, NoiseShare()).after
    assert isinstance(after, UncertaintyHandling)
    assert after.length == pytest.approx(MOST_RUNS / ALPHA_T)


def test_replicates_fill_the_measurement_and_stay_within_the_plan() -> None:
    # 3.4 runs are 3 each and 3 more of two; 15 suffice for 2 and 2, of which 14 are needed.
    once = [[float(i)] for i in range(10)]
    rule = UncertaintyHandling(4, length=3.4)
    assert rule.wanted(once, NoiseShare(), 1000) == list(range(10)) * 2 + [0, 1] * 3
    assert rule.wanted(once, NoiseShare(), 15) == list(range(10)) + [0, 1] * 2
    assert rule.wanted(once, NoiseShare(), 1) == [0]


@pytest.mark.parametrize("rule", RULES)
def test_without_noise_it_is_the_same_search_with_few_replicates(rule: Reevaluate) -> None:
    asked, insights = drive(search(rule, 24), sphere)
    plain, none = drive(search("none", 24), sphere)
    designs = first_runs(asked)
    np.testing.assert_array_equal(designs, np.array([c.x for c in plain])[: len(designs)])
    assert not none
    assert all(i.certainty == pytest.approx(1.0) and i.deviation == 0.0 for i in insights)
    assert len(asked) <= 240
    assert len(asked) - len(designs) <= 2 * len(insights)  # the measurement alone
    if rule == "elite":
        assert len(designs) >= 220


@pytest.mark.parametrize("rule", RULES)
def test_pure_noise_leaves_no_certainty(rule: Reevaluate) -> None:
    _, insights = drive(search(rule, 60), chance)
    later = [i.certainty for i in insights[5:]]
    assert np.median(later) < 0.25
    assert all(i.deviation >= 0.0 for i in insights)


@pytest.mark.parametrize("rule", RULES)
def test_any_order_of_tells_gives_the_same_search(rule: Reevaluate) -> None:
    runs = [drive(search(rule), chance, order)[0] for order in (None, 1, 2)]
    told = [[(c.index, c.seed, c.x.tobytes()) for c in asked] for asked in runs]
    assert told[0] == told[1] == told[2]


@pytest.mark.parametrize("rule", RULES)
def test_replicates_have_numbers_and_seeds_of_their_own(rule: Reevaluate) -> None:
    asked, _ = drive(search(rule), chance)
    assert sorted(c.index for c in asked) == list(range(len(asked)))
    runs = [(c.generation, c.x.tobytes(), c.seed) for c in asked]
    assert len(set(runs)) == len(runs)
    assert len(first_runs(asked)) < len(asked)
    seeds = {c.seed for c in asked if c.generation == 1}
    assert {1, 3} <= seeds
    assert 2 not in seeds  # the seed of the next generation's first runs


@pytest.mark.parametrize("rule", RULES)
def test_the_plan_bounds_all_runs(rule: Reevaluate) -> None:
    its = search(rule, 6)
    total = 60
    while its.should_stop() is None:
        candidates = its.ask()
        total -= len(candidates)
        its.tell(candidates, [chance(c) for c in candidates])
        assert sum(n for _, n in its.work_left) in (total, 0)
    assert 0 <= total < 10


def test_a_share_of_noise_is_measured() -> None:
    # Values with half of their variance from noise, whose normal scores are nearly the values.
    rng = np.random.default_rng(3)
    noise, shares = NoiseShare(), []
    for _ in range(600):
        true = rng.normal(size=10)
        runs = [[t + rng.normal()] for t in true]
        for i in range(4):
            runs[i].append(true[i] + rng.normal())
        noise = noise.after(runs)
        shares.append(noise.share)
    assert noise.freedom == pytest.approx(4.0 / (1.0 - 0.9), rel=1e-6)
    # It is the share of a generation's own variance s**2, and E(1 / s**2) = 9 / 7 for 10 normals.
    assert np.mean(shares[50:]) == pytest.approx(0.5 * 9.0 / 7.0, abs=0.05)


def test_belief_shrinks_by_reliability_and_replicates_undo_it() -> None:
    runs = [[float(i)] for i in range(9)]
    free, half = belief(runs, 0.0), belief(runs, 0.5)
    np.testing.assert_allclose(half.mean, 0.5 * free.mean, atol=1e-12)
    means, deviations = believed_values([[0.0], [1.0, 1.0, 1.0], [2.0]], 0.5)
    np.testing.assert_allclose(means, [0.5, 1.0, 1.5])
    # Variance of a mean of n runs: trust x share / n, trust 1/2 and 3/4, in units of the spread.
    np.testing.assert_allclose(deviations / deviations[0], [1.0, np.sqrt(0.5), 1.0])


def test_a_replicate_gains_nothing_where_all_is_known() -> None:
    runs = [[float(i)] for i in range(8)]
    np.testing.assert_allclose(gains(belief(runs, 0.0), np.arange(8)), 0.0, atol=1e-12)
    assert np.all(gains(belief(runs, 0.5), np.arange(8)) > 0.0)
    assert EliteDoubt().wanted([[*r, *r] for r in runs], NoiseShare(), 100) == []


def test_gain_matches_simulated_replicates() -> None:
    # Nested simulation: draw the replicate, update the normal belief, average the certainty.
    its = belief([[float(i)] for i in range(6)], 0.6)
    decided = recombination_weights(6)
    rng = np.random.default_rng(5)

    def certain(mean: Array, variance: Array) -> float:
        draws = mean + np.sqrt(variance) * rng.standard_normal((4000, 6))
        weights = decided[np.argsort(np.argsort(draws, axis=1), axis=1)].mean(axis=0)
        return float(weights @ weights / (decided @ decided))

    i, after = 1, []
    left = its.variance.copy()
    left[i] = its.variance_after_replicate()[i]
    for _ in range(400):
        mean = its.mean.copy()
        truth = mean[i] + np.sqrt(its.variance[i]) * rng.normal()
        measured = truth + np.sqrt(its.noise_variance) * rng.normal()
        mean[i] += its.variance[i] / (its.variance[i] + its.noise_variance) * (measured - mean[i])
        after.append(certain(mean, left))
    gain = np.mean(after) - certain(its.mean, its.variance)
    assert gains(its, np.array([i]))[i] == pytest.approx(gain, abs=0.012)
    assert gain > 0.015


def test_failed_runs_do_not_stop_it() -> None:
    for rule in RULES:
        asked, _ = drive(search(rule), lambda c: np.inf if c.index % 3 else sphere(c))
        assert len(asked) > 150
        drive(search(rule, 5), lambda c: np.inf)


def test_an_unknown_rule_is_named() -> None:
    with pytest.raises(ConfigError, match="'often' is none of none, ranks, elite"):
        Stage("l", 5, 6, reevaluate="often")  # type: ignore[arg-type]


def test_the_study_file_sets_it_for_every_stage() -> None:
    stages = [{"level": "a", "generations": 2}, {"level": "b", "generations": 3}]
    its = SearchSettings.model_validate(
        {"method": "cma-es", "reevaluate": "elite", "stage": stages}
    )
    assert [s.reevaluate for s in its.stages("dispersion")] == ["elite", "elite"]
    with pytest.raises(ValueError, match='reevaluate is of method = "cma-es"'):
        SearchSettings.model_validate({"budget": 30.0, "reevaluate": "elite"})


@pytest.mark.parametrize("rule", RULES)
def test_a_study_broken_off_among_replicates_resumes(rule: Reevaluate, tmp_path: Path) -> None:
    def noisy(x: Array, seed: int) -> float:
        rng = np.random.default_rng((seed, int(1e6 * (x[0] + 5.0))))
        return float(np.sum(x**2) + 9.0 * rng.normal())

    def run(name: str, breaks_at: int = -1) -> list[tuple[object, ...]]:
        made = 0

        def interrupt(progress: Progress) -> None:
            nonlocal made
            made += 1
            if made == breaks_at:
                raise KeyboardInterrupt

        path, ladder = tmp_path / name, Ladder((FunctionLevel("l", noisy),))
        directory = open_run(path) if path.exists() else create(path, "", {})
        run_study(
            PROBLEM, ladder, lambda _: search(rule, 5), Runner(one_thread), directory,
            confirm_on=ladder, confirm_seeds=0, window=3, watch=interrupt,
        )  # fmt: skip
        return [
            (e.candidate.index, e.candidate.x.tobytes(), e.candidate.seed, e.objective)
            for e in open_run(path).evaluations()
        ]

    whole = run("whole")
    with pytest.raises(KeyboardInterrupt):
        run("broken", breaks_at=12)
    assert run("broken") == whole
    assert len(open_run(tmp_path / "broken").insights) > 1
