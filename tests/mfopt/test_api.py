from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

import mfopt
from mfopt.arrays import Array
from mfopt.commands.app import app


def shifted_sphere(x: Array, seed: int) -> float:
    return float(np.sum((x - np.array([0.3, -1.0])) ** 2))


BOUNDS = {"a": (0.0, 1.0), "b": (-2.0, 2.0)}


def test_finds_the_known_minimum_on_a_ladder() -> None:
    levels = {"coarse": lambda x, seed: shifted_sphere(x + 0.02, seed), "fine": shifted_sphere}
    best = mfopt.minimize(levels, BOUNDS, generations={"coarse": 20, "fine": 15})
    np.testing.assert_allclose(best.x, [0.3, -1.0], atol=0.02)
    assert best.level == "fine"
    assert best.f == shifted_sphere(best.x, 0)


def test_processes_give_what_one_process_gives() -> None:
    runs = [mfopt.minimize({"f": shifted_sphere}, BOUNDS, generations=4, workers=n) for n in (1, 2)]
    np.testing.assert_array_equal(runs[0].x, runs[1].x)
    assert [e.objective for e in runs[0].evaluations] == [e.objective for e in runs[1].evaluations]


def test_a_kept_directory_is_not_run_again(tmp_path: Path) -> None:
    calls = []

    def counted(x: Array, seed: int) -> float:
        calls.append(seed)
        return shifted_sphere(x, seed)

    for _ in range(2):
        best = mfopt.minimize({"f": counted}, BOUNDS, generations=3, directory=tmp_path / "run")
    assert len(calls) == sum(e.outcome.work > 0.0 for e in best.evaluations)


def test_a_kept_directory_has_a_report(tmp_path: Path) -> None:
    mfopt.minimize({"f": shifted_sphere}, BOUNDS, budget=25, directory=tmp_path)
    done = CliRunner().invoke(app, ["report", str(tmp_path)])
    assert done.exit_code == 0, done.output
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "So the design of the best run was chosen" in " ".join(text.split())
    assert "None" not in text


def test_a_budget_that_is_left_out_follows_from_the_variables() -> None:
    best = mfopt.minimize({"f": shifted_sphere}, BOUNDS)
    assert len(best.evaluations) <= 10 * (2 + 2)
    assert best.f < 1e-3


def test_doubtful_candidates_run_again_within_the_plan() -> None:
    def noisy(x: Array, seed: int) -> float:
        return float(np.random.default_rng([seed, *np.frombuffer(x.tobytes(), np.uint32)]).normal())

    best = mfopt.minimize({"f": noisy}, BOUNDS, generations=4, reevaluate="ranks")
    designs = [tuple(e.candidate.x) for e in best.evaluations if e.candidate.purpose == "search"]
    assert len(designs) <= 4 * 6
    assert len(set(designs)) < len(designs)


def test_failing_function_says_why() -> None:
    def broken(x: Array, seed: int) -> float:
        raise RuntimeError("licence expired")

    with pytest.raises(
        mfopt.MfoptError, match=r"level 'f' cannot run: its first 3 runs.*\s.*licence expired"
    ):
        mfopt.minimize({"f": broken}, BOUNDS, generations=1)


def test_a_function_that_exits_ends_no_script() -> None:
    def leaving(x: Array, seed: int) -> float:
        raise SystemExit(0)

    with pytest.raises(mfopt.MfoptError, match="SystemExit: 0"):
        mfopt.minimize({"f": leaving}, BOUNDS, generations=1)


@pytest.mark.parametrize("name", ["coarse", "fine"])
def test_a_level_that_never_runs_stops_the_search_before_it_spends(name: str) -> None:
    calls = []

    def broken(x: Array, seed: int) -> float:
        calls.append(seed)
        raise RuntimeError("licence expired")

    functions = {"coarse": shifted_sphere, "fine": shifted_sphere} | {name: broken}
    with pytest.raises(mfopt.MfoptError, match=rf"'{name}' cannot run[^\n]*\n.*licence expired"):
        mfopt.minimize(**ASSISTED | {"levels": functions})  # type: ignore[arg-type]
    assert calls == [1, 2, 3]


def test_a_function_that_works_at_the_start_alone_gives_the_start() -> None:
    def once(x: Array, seed: int) -> float:
        if (x != [0.5, 0.0]).any():
            raise RuntimeError("licence expired")
        return 0.0

    best = mfopt.minimize({"f": once}, BOUNDS, generations=5)
    assert best.f == 0.0
    assert "failed" in str(best)


def test_an_array_of_one_number_is_a_value() -> None:
    def of_one(x: Array, seed: int) -> Array:
        return np.array([shifted_sphere(x, seed)])

    assert mfopt.minimize({"f": of_one}, BOUNDS, generations=8).f < 0.5


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"bounds": {"a": (1.0, 0.0)}}, "exchange them"),
        ({"bounds": {}}, "no variables"),
        ({"levels": {}}, "ladder is empty"),
        ({"generations": {"g": 3}}, "unknown level 'g'"),
        ({"start": [0.5]}, "baseline has 1 values"),
        ({"start": [0.5, float("nan")]}, "outside its bounds"),
        ({"sigma": 0.0}, "sigma = 0 must be at least 1e-06"),
        ({"population_size": 1}, "population_size = 1"),
        ({"population_size": 0}, "population_size = 0 must be at least 2"),
        ({"population_size": 10**10}, "population_size = 10000000000 must be at most 1000"),
        ({"seeds": 0}, "seeds = 0 must be at least 1"),
        ({"seed": -1}, "seed = -1 must be at least 0"),
        ({"seed": 1.5}, r"seed = 1\.5 must be a whole number"),
        ({"workers": 0}, "workers = 0 must be at least 1"),
        ({"workers": 10**12}, "workers = 1000000000000 must be at most 4096"),
        ({"generations": 10**9}, "generations = 1000000000 must be at most"),
        ({"generations": {}}, "generations = {} plans nothing"),
        ({"bounds": [(0, 1), (0, 1)]}, "must give lower and upper bound by name"),
        ({"bounds": {"a": 3}}, r"bounds: a = 3 must be a pair \(lower, upper\)"),
        ({"bounds": {"a": ("0", "1")}}, "lower bound = '0' must be a number"),
        ({"bounds": {3: (0, 1)}}, "name of a variable = 3 must be a text"),
        ({"start": "middle"}, "start = 'middle' must be a list of one number a variable"),
        ({"start": [[0.5, 0.5]]}, "must be a list of one number a variable"),
        ({"start": [0.5, "0.5"]}, "must be a list of one number a variable"),
        ({"constraint": "x > 1"}, "constraint = 'x > 1' must be a function of x"),
        ({"constraint": lambda x: "too wide"}, "is impossible: too wide"),
        ({"directory": 3}, "directory = 3 must be a path"),
        ({"levels": shifted_sphere}, "must be functions by name"),
        ({"levels": [shifted_sphere]}, "is no Level: it needs a name"),
        ({"levels": {"f": 3}}, "level 'f' = 3 cannot be called"),
        ({"costs": [1]}, r"costs = \[1\] must give a number by level"),
        (
            {"reevaluate": "all", "generations": 3},
            "reevaluate = 'all' is none of none, ranks, elite",
        ),
    ],
)
def test_wrong_arguments_are_named(change: dict[str, object], words: str) -> None:
    arguments: dict[str, object] = {"levels": {"f": shifted_sphere}, "bounds": BOUNDS, **change}
    with pytest.raises(mfopt.ConfigError, match=words):
        mfopt.minimize(**arguments)  # type: ignore[arg-type]


LADDER = {"coarse": lambda x, seed: shifted_sphere(x + 0.05, seed), "fine": shifted_sphere}
ASSISTED: dict[str, object] = {
    "levels": LADDER, "bounds": BOUNDS, "budget": 12,
    "costs": {"coarse": 1, "fine": 20},
}  # fmt: skip


@pytest.fixture(scope="module")
def found() -> mfopt.Minimum:
    """What the assisted search finds."""
    return mfopt.minimize(**ASSISTED)  # type: ignore[arg-type]


def test_it_keeps_to_its_budget_and_corrects_the_coarse_level(found: mfopt.Minimum) -> None:
    assert found.f < shifted_sphere(np.array([0.25, -1.05]), 0)  # the minimiser of the coarse one
    assert found.level == "fine"
    assert found.f == shifted_sphere(found.x, 0)
    spent = sum(20 if e.candidate.level == "fine" else 1 for e in found.evaluations)
    assert 11 * 20 < spent <= 12 * 20
    assert {e.outcome.work for e in found.evaluations} == {1, 20}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"budget": float("nan")}, "budget = nan must be a finite number"),
        ({"budget": "10"}, "budget = '10' must be a number"),
        ({"sigma": 0}, "sigma = 0 must be at least"),
        ({"costs": {"coarse": 20, "fine": 1}}, "a run at level 'coarse' costs 20, more than one"),
        ({"budget": 0.5}, "budget = 0.5 is below the cost of one run at 'fine'"),
        ({"generations": 3}, "budget = 12 and generations = 3 exclude each other"),
        ({"reevaluate": "ranks"}, "reevaluate = 'ranks' is of planned CMA-ES; give generations"),
        ({"costs": {"coarse": 1}}, "costs are given for coarse, the levels are coarse, fine"),
        ({"costs": {"coarse": 0, "fine": 1}}, "costs: coarse = 0 must be at least 1e-12"),
        ({"levels": [mfopt.FunctionLevel("fine", shifted_sphere)]}, "costs are for functions"),
    ],
)
def test_wrong_arguments_of_the_assisted_search_are_named(
    change: dict[str, object], words: str
) -> None:
    with pytest.raises(mfopt.ConfigError, match=words):
        mfopt.minimize(**ASSISTED | change)  # type: ignore[arg-type]


def test_a_budget_of_one_run_is_the_start_s() -> None:
    best = mfopt.minimize(**ASSISTED | {"budget": 1, "costs": {"coarse": 1, "fine": 64}})  # type: ignore[arg-type]
    assert [e.candidate.level for e in best.evaluations] == ["fine"]
    assert best.f == shifted_sphere(np.array([0.5, 0.0]), 0)


def noisy(x: Array, seed: int) -> float:
    draws = np.random.default_rng([seed, *np.frombuffer(x.tobytes(), np.uint32)])
    return shifted_sphere(x, seed) + draws.normal()


def test_under_noise_the_value_is_an_estimate_with_its_interval() -> None:
    best = mfopt.minimize({"f": noisy}, BOUNDS, budget=40, seeds=2, seed=3)
    assert best.interval is not None
    low, high = best.interval
    assert low < shifted_sphere(best.x, 0) < high
    assert low < best.f < high
    assert best.best_run.objective == min(e.objective for e in best.evaluations)
    assert best.best_run.objective < low  # the lowest of many noisy values is luck


def test_without_noise_the_value_is_the_one_measured(found: mfopt.Minimum) -> None:
    fine = [e.objective for e in found.evaluations if e.candidate.level == "fine"]
    assert found.f == found.best_run.objective == min(fine)
    assert found.interval == (found.f, found.f)


def test_where_nothing_is_known_of_scatter_there_is_no_interval() -> None:
    assert mfopt.minimize({"f": noisy}, BOUNDS, generations=4).interval is None


def test_what_was_found_is_said_in_a_few_lines(found: mfopt.Minimum) -> None:
    said = str(found).splitlines()
    assert len(said) == 5
    assert said[0] == f"x: a = {found.x[0]:.6g}, b = {found.x[1]:.6g}"
    assert said[1].startswith(f"f = {found.f:.6g} at level 'fine', as measured")
    assert "at 'coarse'" in said[3]
    assert found.why in said[4]
    assert repr(found) == str(found)


def test_runs_of_a_kept_directory_are_said_to_be_used(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    for _ in range(2):
        best = mfopt.minimize(
            {"f": shifted_sphere}, BOUNDS, generations=2, directory=tmp_path / "r"
        )
    assert best.stored == len(best.evaluations) == 12
    (record,) = (r.getMessage() for r in caplog.records)
    assert record.startswith(f"the runs stored in {tmp_path / 'r'} are used")
    assert "12 of all were stored before" in str(best)


def test_a_level_that_soon_fails_is_left_and_the_target_is_searched() -> None:
    calls = 0

    def broken(x: Array, seed: int) -> float:
        nonlocal calls
        calls += 1
        if calls > 1:
            raise OSError("the licence has expired")
        return shifted_sphere(x, seed)

    best = mfopt.minimize(
        {"c": broken, "f": shifted_sphere}, BOUNDS, costs={"c": 1, "f": 100},
        budget=25,
    )  # fmt: skip
    assert calls < 60
    assert best.f < 0.01


def test_a_larger_budget_goes_on_from_what_is_there(tmp_path: Path) -> None:
    calls = 0

    def counted(x: Array, seed: int) -> float:
        nonlocal calls
        calls += 1
        return shifted_sphere(x, seed)

    def spend(budget: float) -> mfopt.Minimum:
        return mfopt.minimize(
            {"f": counted}, BOUNDS, budget=budget,
            directory=tmp_path / "run", sigma=np.float32(0.2),
        )  # fmt: skip

    first = [tuple(e.candidate.x) for e in spend(12).evaluations]
    second = spend(18)
    assert calls == len(second.evaluations) == 18
    assert [tuple(e.candidate.x) for e in second.evaluations][:12] == first
    assert second.stored == 12
    assert spend(18).stored == 18


@pytest.mark.parametrize(
    "change",
    [
        {"bounds": {"a": (0, 1), "b": (-2, 3)}},
        {"bounds": {"a": (0, 1), "c": (-2, 2)}},
        {"levels": {"g": shifted_sphere}},
        {"seed": 2},
        {"sigma": 0.3},
        {"generations": 1},
    ],
)
def test_a_directory_of_another_run_is_refused_and_what_differs_is_named(
    change: dict[str, object], tmp_path: Path
) -> None:
    arguments: dict[str, object] = {
        "levels": {"f": shifted_sphere}, "bounds": BOUNDS, "generations": 2, "directory": tmp_path,
    }  # fmt: skip
    mfopt.minimize(**arguments)  # type: ignore[arg-type]
    (name,) = change
    with pytest.raises(mfopt.ConfigError, match="holds another run than the one given: ") as told:
        mfopt.minimize(**arguments | change)  # type: ignore[arg-type]
    assert {"bounds": "variables"}.get(name, name) in str(told.value)


def test_other_costs_are_refused(tmp_path: Path) -> None:
    mfopt.minimize(**ASSISTED | {"directory": tmp_path, "budget": 1})  # type: ignore[arg-type]
    costs = {"coarse": 2, "fine": 20}
    with pytest.raises(mfopt.ConfigError, match=r"levels.*work"):
        mfopt.minimize(**ASSISTED | {"directory": tmp_path, "budget": 1, "costs": costs})  # type: ignore[arg-type]


def assisted(path: Path, budget: float, **changed: Any) -> mfopt.Minimum:
    given: dict[str, Any] = {
        "levels": {"c": noisy, "f": noisy}, "bounds": BOUNDS, "costs": {"c": 1.0, "f": 8.0},
        "seed": 3,
    }  # fmt: skip
    return mfopt.minimize(**(given | {"budget": budget, "directory": path} | changed))


def places(its: mfopt.Minimum) -> list[tuple[object, ...]]:
    return [(e.candidate.x.tobytes(), e.candidate.level, e.objective) for e in its.evaluations]


def test_on_a_ladder_a_larger_budget_uses_all_that_was_paid(tmp_path: Path) -> None:
    calls: list[int] = []

    def counted(x: Array, seed: int) -> float:
        calls.append(seed)
        return noisy(x, seed)

    small = assisted(tmp_path / "run", 6)
    larger = assisted(tmp_path / "run", 10, levels={"c": counted, "f": counted})
    assert places(larger)[: len(small.evaluations)] == places(small)  # all that was paid is used
    assert len(calls) == len(larger.evaluations) - len(small.evaluations) > 0
    assert (small.stored, larger.stored) == (0, len(small.evaluations))
    work = sum(8.0 if e.candidate.level == "f" else 1.0 for e in larger.evaluations)
    assert 9 * 8.0 < work <= 10 * 8.0
    again = assisted(tmp_path / "run", 10, levels={"c": counted, "f": counted})
    assert places(again) == places(larger)
    assert len(calls) == len(larger.evaluations) - len(small.evaluations)
