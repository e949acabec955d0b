import numpy as np

from mfopt.search.archive import Archive
from mfopt.search.belief import FURTHEST, learn
from mfopt.search.distribution import Distribution
from surrogates.autoregressive import AutoregressiveGp


def distribution() -> Distribution:
    return Distribution(np.full(3, 0.5), 0.05, 8, np.random.default_rng(1))


def archive(n: int, spread: float = 0.05, failed: bool = False) -> Archive:
    rng, its = np.random.default_rng(2), Archive.empty(3)
    for _ in range(n):
        z = np.clip(0.5 + spread * rng.normal(size=3), 0.0, 1.0)
        value = np.inf if failed else float(((z - 0.52) ** 2).sum())
        its = its.added(z, 0, 1, value, np.empty(0))
    return its


def test_too_few_finished_runs_teach_nothing() -> None:
    for its in (archive(2), archive(20, failed=True)):
        assert learn(its, distribution(), AutoregressiveGp(), None, working=0, lowest=0) is None


def test_the_best_is_near_the_bottom_of_a_bowl() -> None:
    belief = learn(archive(40), distribution(), AutoregressiveGp(), None, working=0, lowest=0)
    assert belief is not None
    best = belief.best(0, 16, (distribution().mean, np.zeros(3)))
    values = ((belief.z - 0.52) ** 2).sum(axis=1)
    assert ((best - 0.52) ** 2).sum() <= np.sort(values)[2]


def test_under_noise_the_best_is_the_centre_unless_a_design_surely_beats_it() -> None:
    rng, centre = np.random.default_rng(4), (np.full(3, 0.5), np.zeros(3))
    noise = rng.normal(size=60)
    chosen = {}
    for bottom in (0.5, 0.6):
        its = Archive.empty(3)
        for extra in noise:
            z = np.clip(0.5 + 0.05 * rng.normal(size=3), 0.0, 1.0)
            value = float(((z - bottom) ** 2).sum() / 0.05**2 + extra)
            its = its.added(z, 0, 1, value, np.empty(0))
        belief = learn(its, distribution(), AutoregressiveGp(), None, working=0, lowest=0)
        assert belief is not None
        chosen[bottom] = belief.best(0, 16, centre)
        among = its.z[:5]
        assert any((belief.best(0, 16, centre, among) == z).all() for z in among)
    np.testing.assert_array_equal(chosen[0.5], centre[0])
    assert np.linalg.norm(chosen[0.6] - 0.6) < np.linalg.norm(centre[0] - 0.6)


def test_what_lies_far_outside_is_left_out_and_never_best() -> None:
    its = archive(40).added(np.array([1.0, 1.0, 1.0]), 0, 1, -100.0, np.empty(0))
    belief = learn(its, distribution(), AutoregressiveGp(), None, working=0, lowest=0)
    assert belief is not None
    away = np.linalg.norm(belief.u, axis=1)
    assert away.max() <= FURTHEST * np.sqrt(3.0)
    assert not (belief.z == 1.0).all(axis=1).any()


def test_levels_below_the_lowest_are_not_learnt_from() -> None:
    its = archive(20)
    for k in range(10):
        its = its.added(np.full(3, 0.5 + 0.002 * k), 1, 1, 5.0 + k, np.empty(0))
    belief = learn(its, distribution(), AutoregressiveGp(), None, working=1, lowest=1)
    assert belief is not None
    assert belief.posterior.hyperparameters.levels == (1,)
    assert len(belief.z) == 10


def test_hyperparameters_are_kept_until_there_are_more_runs() -> None:
    gp, where = AutoregressiveGp(), distribution()
    first = learn(archive(40), where, gp, None, working=0, lowest=0)
    soon = learn(archive(41), where, gp, first, working=0, lowest=0)
    later = learn(archive(60), where, gp, first, working=0, lowest=0)
    assert first is not None
    assert soon is not None
    assert later is not None
    np.testing.assert_array_equal(
        soon.posterior.hyperparameters.lengthscales, first.posterior.hyperparameters.lengthscales
    )
    assert (soon.runs_at_fit, later.runs_at_fit) == (40, 60)
