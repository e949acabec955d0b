from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import mfopt
from mfopt.arrays import Array
from mfopt.commands.app import app
from surrogates.autoregressive import AutoregressiveGp


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
    assert len(calls) == len(best.evaluations)


def test_a_kept_directory_has_a_report(tmp_path: Path) -> None:
    mfopt.minimize(
        {"f": shifted_sphere}, BOUNDS, surrogate=AutoregressiveGp(), budget=25, directory=tmp_path
    )
    done = CliRunner().invoke(app, ["report", str(tmp_path)])
    assert done.exit_code == 0, done.output
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "So the best run there was chosen" in " ".join(text.split())
    assert "None" not in text


def test_doubtful_candidates_run_again_within_the_plan() -> None:
    def noisy(x: Array, seed: int) -> float:
        return float(np.random.default_rng([seed, *np.frombuffer(x.tobytes(), np.uint32)]).normal())

    best = mfopt.minimize({"f": noisy}, BOUNDS, generations=4, reevaluate="ranks")
    designs = [tuple(e.candidate.x) for e in best.evaluations]
    assert len(designs) <= 4 * 6
    assert len(set(designs)) < len(designs)


def test_failing_function_says_why() -> None:
    def broken(x: Array, seed: int) -> float:
        raise RuntimeError("licence expired")

    with pytest.raises(mfopt.MfoptError, match="licence expired"):
        mfopt.minimize({"f": broken}, BOUNDS, generations=1)


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
        ({"reevaluate": "all"}, "reevaluate = 'all' is none of none, ranks, elite"),
    ],
)
def test_wrong_arguments_are_named(change: dict[str, object], words: str) -> None:
    arguments: dict[str, object] = {"levels": {"f": shifted_sphere}, "bounds": BOUNDS, **change}
    with pytest.raises(mfopt.ConfigError, match=words):
        mfopt.minimize(**arguments)  # type: ignore[arg-type]


LADDER = {"coarse": lambda x, seed: shifted_sphere(x + 0.05, seed), "fine": shifted_sphere}
ASSISTED: dict[str, object] = {
    "levels": LADDER, "bounds": BOUNDS, "surrogate": AutoregressiveGp(), "budget": 12,
    "costs": {"coarse": 1, "fine": 20},
}  # fmt: skip


def test_with_a_surrogate_it_keeps_to_its_budget_and_corrects_the_coarse_level() -> None:
    best = mfopt.minimize(**ASSISTED)  # type: ignore[arg-type]
    assert best.f < shifted_sphere(np.array([0.25, -1.05]), 0)  # the minimiser of the coarse one
    assert best.level == "fine"
    assert best.f == shifted_sphere(best.x, 0)
    spent = sum(20 if e.candidate.level == "fine" else 1 for e in best.evaluations)
    assert 11 * 20 < spent <= 12 * 20
    assert {e.outcome.work for e in best.evaluations} == {1, 20}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"budget": None}, "a surrogate needs a budget"),
        ({"budget": 0.5}, "budget = 0.5 is below the cost of one run at 'fine'"),
        ({"generations": 3}, "and no generations"),
        ({"reevaluate": "ranks"}, 'reevaluate = "ranks" is for the search without a surrogate'),
        ({"surrogate": None}, "budget = 12 needs a surrogate"),
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
