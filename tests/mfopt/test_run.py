from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from fidelity.programs.function import FunctionLevel
from mfopt.arrays import Array
from mfopt.campaign.check import check_levels
from mfopt.campaign.driver import Progress
from mfopt.campaign.executor import Runner, one_thread
from mfopt.campaign.phases import CONFIRM_SEED, Finals, Starts
from mfopt.campaign.run import run_study
from mfopt.campaign.store import RunDirectory, create, open_run
from mfopt.errors import ConfigError
from mfopt.records.evaluation import Evaluation
from mfopt.records.level import Ladder, Level
from mfopt.records.objective import RETURNED, judged
from mfopt.records.problem import Problem, Variable
from mfopt.search.assisted import AssistedCmaEs
from mfopt.search.cmaes import CmaEs
from mfopt.search.search import Rung, Search, Stage
from surrogates.autoregressive import AutoregressiveGp

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
    (why,) = {e.outcome.why for e in run.evaluations()}
    assert why is not None
    assert why.startswith("ValueError: no licence (line ")


def narrow(x: Array, seed: int) -> float:
    """Two valleys, the deep one around (-0.5, -0.5), the other around (0.5, 0.5)."""
    noise = np.random.default_rng(seed).normal(0.0, 0.01)
    deep, flat = (float(np.sum((x - centre) ** 2)) for centre in (-0.5, 0.5))
    return min(20.0 * deep - 1.0, 20.0 * flat) + noise


def with_starts(
    path: Path, make: Callable[[Array], Search], finals: Finals, breaks_after: int = -1
) -> list[Evaluation]:
    ladder = Ladder((FunctionLevel("coarse", narrow), FunctionLevel("fine", narrow, 10.0)))
    designs = {"one": np.full(2, 0.6), "two": np.full(2, -0.4)}
    made = 0

    def watch(progress: Progress) -> None:
        nonlocal made
        made += not progress.replayed
        if made == breaks_after:
            raise KeyboardInterrupt

    run_study(
        PROBLEM, ladder, make, Runner(one_thread),
        open_run(path) if path.exists() else create(path, "", {}), confirm_on=ladder,
        confirm_seeds=2, starts=Starts(designs, "coarse", 2), finals=finals, watch=watch,
    )  # fmt: skip
    return list(open_run(path).evaluations())


def planned(start: Array) -> Search:
    return CmaEs(PROBLEM, STAGES, seed=1, start=start)


def assisted(start: Array) -> Search:
    rungs = [Rung("coarse", 0.1), Rung("fine", 1.0)]
    surrogate = AutoregressiveGp()
    return AssistedCmaEs(PROBLEM, rungs, surrogate, budget=8.0, seed=1, seeds=2, start=start)


@pytest.mark.parametrize("make", [planned, assisted])
def test_the_search_begins_at_the_best_start_which_is_a_finalist_too(
    make: Callable[[Array], Search], tmp_path: Path
) -> None:
    made = with_starts(tmp_path / "run", make, Finals(3, seeds=2))
    by = {
        purpose: [e for e in made if e.candidate.purpose == purpose]
        for purpose in {e.candidate.purpose for e in made}
    }
    assert [e.candidate.index for e in made] == list(range(len(made)))
    assert [e.candidate.x[0] for e in by["start"]] == [0.6, 0.6, -0.4, -0.4]
    searched = np.array([e.candidate.x for e in by["search"]])
    assert np.linalg.norm(searched - (-0.5), axis=1).min() < 0.1
    finalists = {e.candidate.x.tobytes() for e in by["finalist"]}
    assert len(finalists) == 3 + 2
    assert len(by["finalist"]) == 5 * 2 + 2 * 4
    assert PROBLEM.baseline.tobytes() in finalists
    assert np.full(2, -0.4).tobytes() in finalists
    (best,) = {e.candidate.x.tobytes() for e in by["confirm best"]}
    values = {
        x: [e.objective for e in by["finalist"] if e.candidate.x.tobytes() == x] for x in finalists
    }
    last = {x: np.mean(its) for x, its in values.items() if len(its) == 2 + 4}
    assert len(last) == 2
    assert best == min(last, key=lambda x: last[x])
    baseline = by["confirm baseline"][0].candidate.x
    np.testing.assert_array_equal(baseline, PROBLEM.baseline)  # and not the start


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("undisturbed") / "run"
    with_starts(path, assisted, Finals(2, seeds=2))
    return path


@pytest.mark.parametrize("breaks_after", [1, 4, 5, -9, -4])
def test_broken_off_before_or_after_the_search_it_resumes_to_the_undisturbed_run(
    breaks_after: int, undisturbed: Path, tmp_path: Path
) -> None:
    whole = content(undisturbed)
    with pytest.raises(KeyboardInterrupt):
        with_starts(tmp_path / "run", assisted, Finals(2, seeds=2), breaks_after % len(whole))
    with_starts(tmp_path / "run", assisted, Finals(2, seeds=2))
    assert content(tmp_path / "run") == whole


def test_runs_of_starts_count_in_the_budget(tmp_path: Path) -> None:
    made = with_starts(tmp_path / "run", assisted, Finals())
    cost = {"coarse": 0.1, "fine": 1.0}
    spent = sum(cost[e.candidate.level] for e in made if e.candidate.purpose in ("start", "search"))
    assert 7.0 < spent <= 8.0 + 1e-9


def test_what_the_check_ran_is_stored_first_and_used_where_the_search_asks_for_it(
    tmp_path: Path,
) -> None:
    calls: list[tuple[int, bytes]] = []

    def counted(x: Array, seed: int) -> float:
        calls.append((seed, x.tobytes()))
        return noisy(x, seed)

    levels = FunctionLevel("coarse", counted), FunctionLevel("fine", counted, 10.0)
    ladder, run = Ladder(levels), create(tmp_path / "run", "", {})
    checked = check_levels(
        ladder, PROBLEM.baseline, Runner(one_thread), lambda outcome: judged(RETURNED, outcome)
    )
    search = CmaEs(PROBLEM, STAGES, seed=1)
    run_study(
        PROBLEM, ladder, lambda _: search, Runner(one_thread), run,
        confirm_on=ladder, confirm_seeds=1, checked=checked.evaluations,
    )  # fmt: skip
    check_coarse, check_fine, start, *_ = open_run(tmp_path / "run").evaluations()
    assert (check_coarse.candidate.level, check_fine.candidate.level) == ("coarse", "fine")
    assert {check_coarse.candidate.purpose, check_fine.candidate.purpose} == {"check"}
    assert (start.candidate.purpose, start.candidate.index) == ("search", 2)
    assert start.objective == check_coarse.objective
    assert (start.outcome.work, check_coarse.outcome.work) == (0.0, 1.0)  # spent once
    assert calls.count((1, PROBLEM.baseline.tobytes())) == 2  # at either level
