from collections.abc import Callable

import numpy as np
import pytest

from mfopt.arrays import Array
from mfopt.errors import ConfigError
from mfopt.records.problem import Problem, Variable
from mfopt.search.assisted import AssistedCmaEs
from mfopt.search.search import Rung
from surrogates.autoregressive import AutoregressiveGp

Function = Callable[[Array], float]


def problem(d: int = 6, start: float = 3.0) -> Problem:
    variables = tuple(Variable(f"x{i}", -5.0, 5.0) for i in range(d))
    return Problem(variables, np.full(d, start))


def sphere(x: Array) -> float:
    return float(((x - 1.0) ** 2).sum())


def run(search: AssistedCmaEs, levels: dict[str, Function]) -> list[tuple[str, float]]:
    """Level of every run, and the target's value of the recommendation after it."""
    target, path = list(levels.values())[-1], []
    while search.should_stop() is None:
        candidates = search.ask()
        search.tell(candidates, [levels[c.level](c.x) for c in candidates])
        best = search.recommended()
        assert best is not None
        path += [(c.level, target(best)) for c in candidates]
    return path


def test_a_bowl_takes_about_as_many_runs_as_it_has_coefficients() -> None:
    # 28 coefficients in 6 variables; CMA-ES alone takes more than 200 runs for this.
    search = AssistedCmaEs(problem(), [Rung("f", 1.0)], AutoregressiveGp(), budget=60.0, seed=1)
    assert run(search, {"f": sphere})[-1][1] < 1e-3 * sphere(problem().baseline)


def test_most_of_a_ladder_s_runs_are_cheap_and_its_result_is_the_target_s() -> None:
    levels: dict[str, Function] = {
        "coarse": lambda x: sphere(x + 0.3) + 0.1 * float(np.sin(x).sum()),
        "fine": sphere,
    }
    rungs = [Rung("coarse", 1 / 16), Rung("fine", 1.0)]
    search = AssistedCmaEs(problem(), rungs, AutoregressiveGp(), budget=25.0, seed=2)
    path = run(search, levels)
    names = [level for level, _ in path]
    assert names.count("coarse") > 20
    assert names.count("fine") < 25
    assert path[-1][1] < 0.02 * sphere(problem().baseline)
    assert path[-1][1] < sphere(np.full(6, 0.7))  # better than the coarse optimum


def test_a_level_that_lies_is_left() -> None:
    levels: dict[str, Function] = {"coarse": lambda x: sphere(-x), "fine": sphere}
    rungs = [Rung("coarse", 1 / 8), Rung("fine", 1.0)]
    search = AssistedCmaEs(problem(), rungs, AutoregressiveGp(), budget=60.0, seed=3)
    assert run(search, levels)[-1][1] < 0.02 * sphere(problem().baseline)


def test_noise_is_averaged_out_by_the_surrogate() -> None:
    rng = np.random.default_rng(4)
    noisy: dict[str, Function] = {"f": lambda x: sphere(x) + 3.0 * rng.normal()}
    search = AssistedCmaEs(problem(), [Rung("f", 1.0)], AutoregressiveGp(), budget=150.0, seed=4)
    run(search, noisy)
    best = search.recommended()
    assert best is not None
    assert sphere(best) < 3.0  # the deviation of the noise; the start is at 24
    assert search.insight is not None
    assert 0.0 < search.insight.certainty <= 1.0
    assert abs(search.insight.mean - sphere(best)) < 4.0 * search.insight.deviation + 0.5


def test_intervals_of_the_recommendation_hold_the_truth() -> None:
    held = []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        noisy: dict[str, Function] = {"f": lambda x, rng=rng: sphere(x) + 1.5 * rng.normal()}
        surrogate = AutoregressiveGp()
        search = AssistedCmaEs(problem(3), [Rung("f", 1.0)], surrogate, budget=25.0, seed=seed)
        run(search, noisy)
        best, insight = search.recommended(), search.insight
        assert best is not None
        assert insight is not None
        low, high = insight.interval
        held.append(low < sphere(best) < high)
    assert sum(held) >= 10


@pytest.mark.parametrize("seed", [1, 2, 3, 4])
def test_what_is_recommended_in_the_end_was_run_at_the_target_and_is_what_the_insight_says(
    seed: int,
) -> None:
    rungs = [Rung("coarse", 1 / 20), Rung("fine", 1.0)]
    search = AssistedCmaEs(problem(3), rungs, AutoregressiveGp(), budget=4.0, seed=seed)
    fine = []
    while search.should_stop() is None:
        candidates = search.ask()
        search.tell(candidates, [sphere(c.x + 0.1 * (c.level == "coarse")) for c in candidates])
        fine += [c.x for c in candidates if c.level == "fine"]
    best, insight = search.recommended(), search.insight
    assert best is not None
    assert insight is not None
    assert any(np.array_equal(best, x) for x in fine)
    assert insight.level == "fine"
    np.testing.assert_array_equal(insight.best, best)


def test_a_lying_level_whose_validations_fail_is_left_too() -> None:
    fine_runs = 0

    def fine(x: Array) -> float:
        nonlocal fine_runs
        fine_runs += 1
        return np.inf if 1 < fine_runs <= 6 else sphere(x)  # the first is the start's

    levels: dict[str, Function] = {"coarse": lambda x: sphere(-x), "fine": fine}
    rungs = [Rung("coarse", 1 / 8), Rung("fine", 1.0)]
    search = AssistedCmaEs(problem(), rungs, AutoregressiveGp(), budget=40.0, seed=3)
    while search.should_stop() is None:
        candidates = search.ask()
        search.tell(candidates, [levels[c.level](c.x) for c in candidates])
    best = search.recommended()
    assert best is not None
    assert sphere(best) < sphere(problem().baseline)


@pytest.mark.parametrize("budget", [1.05, 2.2, 4.0])
@pytest.mark.parametrize("finish", [1, 2, 1000])
def test_a_small_budget_is_kept_to_and_ends_at_the_target(budget: float, finish: int) -> None:
    cost = {"coarse": 0.05, "fine": 1.0}
    rungs = [Rung(level, c) for level, c in cost.items()]
    search = AssistedCmaEs(problem(3), rungs, AutoregressiveGp(), budget=budget, seed=1)
    spent, coarse, fine = 0.0, 0, []
    while search.should_stop() is None:
        for c in search.ask():
            spent += cost[c.level]
            coarse += c.level == "coarse"
            failed = c.level == "coarse" and coarse > finish
            search.tell([c], [np.inf if failed else sphere(c.x)])
            fine += [c.x] if c.level == "fine" else []
    best = search.recommended()
    assert best is not None
    assert spent <= budget + 1e-9
    assert any(np.array_equal(best, x) for x in fine)


@pytest.mark.parametrize("budget", [1.0, 2.0, 7.0])
def test_one_level_keeps_to_a_budget_below_a_generation(budget: float) -> None:
    search = AssistedCmaEs(problem(), [Rung("f", 1.0)], AutoregressiveGp(), budget=budget, seed=1)
    assert len(run(search, {"f": sphere})) == budget


def discus(x: Array) -> float:
    return float(1e6 * (x[0] - 1.0) ** 2 + sphere(x[1:]))


def test_without_scatter_the_best_run_is_recommended() -> None:
    search = AssistedCmaEs(problem(), [Rung("f", 1.0)], AutoregressiveGp(), budget=80.0, seed=1)
    best, value = np.inf, np.nan
    while search.should_stop() is None:
        candidates = search.ask()
        values = [discus(c.x) for c in candidates]
        search.tell(candidates, values)
        best = min(best, *values)
        recommended = search.recommended()
        assert recommended is not None
        value = discus(recommended)
        assert value == best or search.generation.number == 2  # not known before
    assert value == best


@pytest.mark.parametrize(
    ("coarse_noise", "repeated"), [(0.0, ["coarse", "fine"]), (1.0, ["coarse"])]
)
def test_one_design_is_run_again_where_nothing_is_known_of_scatter(
    coarse_noise: float, repeated: list[str]
) -> None:
    rungs = [Rung("coarse", 1 / 4), Rung("fine", 1.0)]
    search = AssistedCmaEs(
        problem(3), rungs, AutoregressiveGp(), budget=20.0, seed=1, seeds=2, first_seed=7
    )
    rng, asked = np.random.default_rng(1), []
    while search.should_stop() is None:
        candidates = search.ask()
        asked += candidates
        noise = [coarse_noise * rng.normal() * (c.level == "coarse") for c in candidates]
        search.tell(candidates, [sphere(c.x) + n for c, n in zip(candidates, noise, strict=True)])
    again = [c for c in asked if c.seed not in (7, 8)]
    assert [(c.level, c.seed) for c in again] == [(level, 9) for level in repeated]
    for c in again:
        assert any((c.x == o.x).all() and c.seed != o.seed and c.level == o.level for o in asked)
    assert asked[-1].level == "fine"


def test_a_noisy_target_above_an_exact_level_is_not_taken_to_be_exact() -> None:
    rng = np.random.default_rng(5)
    levels: dict[str, Function] = {
        "exact": lambda x: sphere(x + 0.3), "noisy": lambda x: sphere(x) + 2.0 * rng.normal(),
    }  # fmt: skip
    rungs = [Rung("exact", 1 / 4), Rung("noisy", 1.0)]
    search = AssistedCmaEs(problem(3), rungs, AutoregressiveGp(), budget=30.0, seed=5)
    told = []
    while search.should_stop() is None:
        candidates = search.ask()
        values = [levels[c.level](c.x) for c in candidates]
        told += [f for c, f in zip(candidates, values, strict=True) if c.level == "noisy"]
        search.tell(candidates, values)
    insight = search.insight
    assert insight is not None
    assert not insight.exact
    assert insight.mean > min(told)  # the lowest of many noisy values is luck


@pytest.mark.parametrize("workers", [1, 4])
def test_the_budget_is_never_exceeded_and_no_worker_waits(workers: int) -> None:
    rungs = [Rung("coarse", 0.3), Rung("fine", 1.0)]
    search = AssistedCmaEs(problem(4), rungs, AutoregressiveGp(), budget=12.0, seed=5)
    cost, out, idle = {r.level: r.cost for r in rungs}, [], 0
    spent = 0.0
    while True:
        if search.should_stop() is None:
            out += (new := search.ask(workers - len(out)))
            spent += sum(cost[c.level] for c in new)
            idle += workers - len(out)
        if not out:
            break
        ended = out.pop()  # the last asked ends first
        search.tell([ended], [sphere(ended.x)])
    assert spent <= 12.0 + 1e-9
    assert idle <= workers  # at the very end, when no budget is left for another run


def test_the_exchange_leads_out_of_the_wrong_order() -> None:
    def valley(x: Array) -> float:
        """Two minima, at (2, -2) and, much lower, at (-2, 2)."""
        a, b = np.array([2.0, -2.0, 0.0]), np.array([-2.0, 2.0, 0.0])
        return float(min(((x - a) ** 2).sum() + 5.0, ((x - b) ** 2).sum()))

    variables = tuple(Variable(name, -5.0, 5.0) for name in ("y1", "y2", "z"))
    start = Problem(variables, np.array([2.5, -2.5, 1.0]))
    search = AssistedCmaEs(
        start, [Rung("f", 1.0)], AutoregressiveGp(), budget=60.0, seed=6, sigma=0.05,
        exchange=("y1", "y2"),
    )  # fmt: skip
    assert run(search, {"f": valley})[-1][1] < 0.5


def best_value(search: AssistedCmaEs, f: Function) -> float:
    best = search.recommended()
    assert best is not None
    return f(best)


@pytest.mark.parametrize(
    ("budget", "seed"), [*((budget, seed) for budget in (2.5, 4.0) for seed in range(4)), (8.0, 0)]
)
def test_without_noise_the_best_run_at_the_target_is_recommended(budget: float, seed: int) -> None:
    rungs = [Rung("coarse", 1 / 20), Rung("fine", 1.0)]
    search = AssistedCmaEs(problem(3), rungs, AutoregressiveGp(), budget=budget, seed=seed)
    measured = []
    while search.should_stop() is None:
        candidates = search.ask()
        values = [discus(c.x + 0.2 * (c.level == "coarse")) for c in candidates]
        search.tell(candidates, values)
        measured += [f for c, f in zip(candidates, values, strict=True) if c.level == "fine"]
    assert best_value(search, discus) == min(measured)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("budget", [3.0, 4.0])
def test_a_coarse_level_that_lies_leads_to_nothing_worse_than_the_start(
    seed: int, budget: float
) -> None:
    levels: dict[str, Function] = {"coarse": lambda x: sphere(-x), "fine": sphere}
    rungs = [Rung("coarse", 1 / 20), Rung("fine", 1.0)]
    search = AssistedCmaEs(problem(3), rungs, AutoregressiveGp(), budget=budget, seed=seed)
    assert run(search, levels)[-1][1] <= sphere(problem(3).baseline)


def failing(levels: dict[str, Function], budget: float = 9.0) -> tuple[AssistedCmaEs, list[str]]:
    """A search over levels that cost 1/8 each but the last, and the levels of its runs."""
    rungs = [Rung(name, 0.125) for name in list(levels)[:-1]] + [Rung(list(levels)[-1], 1.0)]
    search = AssistedCmaEs(problem(3), rungs, AutoregressiveGp(), budget=budget, seed=1)
    asked = []
    while search.should_stop() is None:
        candidates = search.ask()
        asked += [c.level for c in candidates]
        search.tell(candidates, [levels[c.level](c.x) for c in candidates])
    return search, asked


def test_a_level_whose_runs_all_fail_is_left(caplog: pytest.LogCaptureFixture) -> None:
    search, asked = failing({"broken": lambda x: np.inf, "coarse": sphere, "fine": sphere})
    assert asked.count("broken") < 20
    assert best_value(search, sphere) < 0.01
    (record,) = (r.getMessage() for r in caplog.records)
    assert "level 'broken' is left: all of its first" in record


def test_a_level_whose_runs_mostly_fail_is_left() -> None:
    count = 0

    def flaky(x: Array) -> float:
        nonlocal count
        count += 1
        return sphere(x) if count % 8 == 1 else np.inf

    search, asked = failing({"flaky": flaky, "fine": sphere}, budget=20.0)
    assert asked.count("flaky") < 60
    assert best_value(search, sphere) < 0.05


def test_a_target_whose_first_runs_all_fail_ends_the_search() -> None:
    search, asked = failing({"coarse": lambda x: np.inf, "fine": lambda x: np.inf}, budget=60.0)
    assert len(asked) < 50
    assert "at level 'fine' all of its first" in str(search.should_stop())


def test_a_single_level_whose_first_runs_all_fail_ends_the_search() -> None:
    search, asked = failing({"fine": lambda x: np.inf}, budget=60.0)
    assert 12 <= len(asked) < 25
    assert "at level 'fine' all of its first" in str(search.should_stop())


@pytest.mark.parametrize("levels", [1, 2, 3])
def test_a_budget_of_one_target_run_is_spent_on_the_start(levels: int) -> None:
    search, asked = failing({str(k): sphere for k in range(levels)}, budget=1.0)
    assert asked == [str(levels - 1)]
    assert best_value(search, sphere) == sphere(problem(3).baseline)


def test_bad_input_is_named() -> None:
    gp = AutoregressiveGp()
    with pytest.raises(ConfigError, match="no level"):
        AssistedCmaEs(problem(), [], gp, budget=1.0, seed=1)
    with pytest.raises(ConfigError, match=r"budget = 0\.5 is below the cost of one run"):
        AssistedCmaEs(problem(), [Rung("f", 1.0)], gp, budget=0.5, seed=1)
    with pytest.raises(ConfigError, match="surrogate = AutoregressiveGp is a class; make one"):
        AssistedCmaEs(problem(), [Rung("f", 1.0)], AutoregressiveGp, budget=9.0, seed=1)  # type: ignore[arg-type]
    with pytest.raises(ConfigError, match=r"cannot learn: it has no fit\(\)"):
        AssistedCmaEs(problem(), [Rung("f", 1.0)], 3, budget=9.0, seed=1)  # type: ignore[arg-type]
    with pytest.raises(ConfigError, match="a run at level 'a' costs 2, more than one at 'b'"):
        AssistedCmaEs(problem(), [Rung("a", 2.0), Rung("b", 1.0)], gp, budget=9.0, seed=1)
    with pytest.raises(ConfigError, match="cost = 0 must be at least"):
        Rung("f", 0.0)
