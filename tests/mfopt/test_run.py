from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from mfopt.arrays import Array
from mfopt.cmaes import CmaEs
from mfopt.errors import ConfigError
from mfopt.executor import Runner, one_thread
from mfopt.function_level import FunctionLevel
from mfopt.level import Ladder, Level
from mfopt.phases import CONFIRM_SEED
from mfopt.problem import Problem, Variable
from mfopt.run import Progress, run_study
from mfopt.search import Stage
from mfopt.store import RunDirectory, create, open_run

PROBLEM = Problem((Variable("a", -1.0, 1.0), Variable("b", -1.0, 1.0)), np.array([0.8, 0.8]))
STAGES = [
    Stage("coarse", 4, 5, objective="returned", seeds=2),
    Stage("fine", 2, 4, objective="returned"),
]


def noisy(x: Array, seed: int) -> float:
    return float(np.sum(x**2) + np.random.default_rng(seed).normal(0.0, 0.01))


def study(
    run: RunDirectory,
    function: Callable[[Array, int], float],
    seed: int = 1,
    reference: Level | None = None,
    breaks_after: int = -1,
) -> None:
    """Run or resume; interrupted, as by Ctrl-C, after so many runs."""
    made = 0

    def watch(progress: Progress) -> None:
        nonlocal made
        made += not progress.replayed
        if made == breaks_after:
            raise KeyboardInterrupt

    ladder = Ladder((FunctionLevel("coarse", function), FunctionLevel("fine", function, 10.0)))
    search = CmaEs(PROBLEM, STAGES, seed=seed)
    run_study(
        PROBLEM, ladder, lambda _: search, Runner(one_thread), run,
        confirm_on=ladder, confirm_seeds=2, reference=reference, watch=watch,
    )  # fmt: skip


def content(path: Path) -> list[tuple[object, ...]]:
    return [
        (e.candidate.index, e.candidate.x.tobytes(), e.candidate.seed, e.candidate.purpose,
         e.candidate.generation, e.objective)
        for e in open_run(path).evaluations()
    ]  # fmt: skip


def test_the_plan_is_carried_out_and_confirmed_on_fresh_seeds(tmp_path: Path) -> None:
    study(create(tmp_path / "run", "", {}), noisy)
    run = open_run(tmp_path / "run")
    evaluations = list(run.evaluations())
    assert [e.candidate.index for e in evaluations] == list(range(4 * 5 + 2 * 4 + 4))
    assert run.end == "the planned generations on every level are done"
    assert [g.number for g in run.generations] == [1, 2, 3, 4, 5, 6]
    confirmed = evaluations[-4:]
    assert [e.candidate.purpose for e in confirmed] == ["confirm best", "confirm baseline"] * 2
    seeds = [e.candidate.seed for e in confirmed]
    assert seeds == [CONFIRM_SEED] * 2 + [CONFIRM_SEED + 1] * 2
    assert not set(seeds) & {e.candidate.seed for e in evaluations[:-4]}
    best = min(evaluations[20:28], key=lambda e: e.objective)
    np.testing.assert_array_equal(confirmed[0].candidate.x, best.candidate.x)
    np.testing.assert_array_equal(confirmed[1].candidate.x, PROBLEM.baseline)


@pytest.mark.parametrize("stop_after", [1, 3, 11, 20, 26, 29, 31])
def test_broken_off_anywhere_it_resumes_to_the_undisturbed_run(
    stop_after: int, tmp_path: Path
) -> None:
    study(create(tmp_path / "whole", "", {}), noisy)
    with pytest.raises(KeyboardInterrupt):
        study(create(tmp_path / "broken", "", {}), noisy, breaks_after=stop_after)
    assert len(open_run(tmp_path / "broken")) == stop_after
    made = 0

    def counting(x: Array, seed: int) -> float:
        nonlocal made
        made += 1
        return noisy(x, seed)

    study(open_run(tmp_path / "broken"), counting)
    assert content(tmp_path / "broken") == content(tmp_path / "whole")
    assert made == 32 - stop_after


def test_best_and_baseline_run_once_more_on_the_reference(tmp_path: Path) -> None:
    path = tmp_path / "run"
    study(create(path, "", {}), noisy, reference=FunctionLevel("fine-other", noisy, 100.0))
    *before, best, baseline = open_run(path).evaluations()
    assert [best.candidate.index, baseline.candidate.index] == [32, 33]
    for its, purpose, alike in (
        (best, "reference best", before[28]), (baseline, "reference baseline", before[29]),
    ):  # fmt: skip
        assert (its.candidate.purpose, its.candidate.level) == (purpose, "fine-other")
        assert its.candidate.seed == alike.candidate.seed == CONFIRM_SEED
        np.testing.assert_array_equal(its.candidate.x, alike.candidate.x)
        assert its.objective == alike.objective  # the same function


@pytest.mark.parametrize("made_before", [1, 2])
def test_a_reference_is_added_to_a_run_that_has_ended(made_before: int, tmp_path: Path) -> None:
    path, calls = tmp_path / "run", []

    def counted(x: Array, seed: int) -> float:
        calls.append(seed)
        return noisy(x, seed)

    study(create(path, "", {}), noisy)
    why = open_run(path).end
    if made_before < 2:
        with pytest.raises(KeyboardInterrupt):
            study(
                open_run(path), noisy, reference=FunctionLevel("fine-other", counted),
                breaks_after=made_before,
            )  # fmt: skip
        assert len(open_run(path)) == 32 + made_before
    study(open_run(path), noisy, reference=FunctionLevel("fine-other", counted))
    study(open_run(path), noisy, reference=FunctionLevel("fine-other", counted))
    assert len(open_run(path)) == 34
    assert set(calls) == {CONFIRM_SEED}
    assert len(calls) <= 4 - made_before  # one may have been in flight
    assert open_run(path).end == why


def test_resuming_with_another_search_is_refused(tmp_path: Path) -> None:
    study(create(tmp_path / "run", "", {}), noisy)
    with pytest.raises(ConfigError, match="another design"):
        study(open_run(tmp_path / "run"), noisy, seed=2)


def test_a_run_where_everything_fails_ends_with_its_reasons(tmp_path: Path) -> None:
    def broken(x: Array, seed: int) -> float:
        raise ValueError("no licence")

    study(create(tmp_path / "run", "", {}), broken)
    run = open_run(tmp_path / "run")
    assert run.end is not None
    assert {e.outcome.why for e in run.evaluations()} == {"ValueError: no licence"}
