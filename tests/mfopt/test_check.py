"""The dry run: which levels it starts, what it stops, what it measures, what it keeps."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from fidelity.programs.function import FunctionLevel
from mfopt.arrays import Array
from mfopt.campaign.check import LONG, SHORT, Checked, Probed, check_levels
from mfopt.campaign.executor import Runner, one_thread
from mfopt.errors import SimulationError
from mfopt.records.evaluation import Evaluation
from mfopt.records.level import Ladder, Level
from mfopt.records.outcome import Outcome

X = np.array([0.5])
CPU_PER_WORK, START_S = 0.25, 3.0


@dataclass(frozen=True)
class Engine:
    """A level whose run takes `START_S` and then time by its work; it can be cut short."""

    name: str
    full: float
    fails: Callable[[int], bool] = lambda seed: False
    calls: list[tuple[float, int]] = field(default_factory=list)

    def work(self, x: Array) -> float:
        return self.full

    def evaluate(self, x: Array, *, seed: int) -> Outcome:
        return self.probe(x, seed=seed, share=1.0)

    def probe(self, x: Array, *, seed: int, share: float) -> Outcome:
        self.calls.append((share, seed))
        work = share * self.full
        failed = self.fails(seed)
        return Outcome(
            x, self.name, seed, "crashed" if failed else "finished",
            f"seed {seed}\nlicence missing" if failed else None,
            {"f": np.asarray(1.5)}, work, START_S + CPU_PER_WORK * work,
        )  # fmt: skip


def judge(outcome: Outcome) -> tuple[Outcome, float]:
    if outcome.finished and "f" not in outcome.raw:
        return replace(outcome, status="crashed", why="there is no f"), np.inf
    return outcome, float(outcome.raw["f"]) if outcome.finished else np.inf


def check(
    *levels: Level, reference: Level | None = None, known: Sequence[Evaluation] = ()
) -> Checked:
    stored = {e.candidate.index: e for e in known}
    runner = Runner(one_thread)
    try:
        return check_levels(
            Ladder(levels), X, runner, judge,
            reference=reference, recall=lambda candidate: stored.get(candidate.index),
        )  # fmt: skip
    finally:
        runner.close()


def test_cheap_levels_run_whole_and_dear_ones_their_first_steps() -> None:
    cheap, dear = Engine("cheap", 100.0), Engine("dear", 1000.0)
    found = check(cheap, dear)
    assert cheap.calls == [(1.0, 1)]
    assert dear.calls == [(SHORT, 1), (LONG, 1)]
    (kept,) = found.evaluations
    assert (kept.candidate.level, kept.candidate.purpose, kept.objective) == ("cheap", "check", 1.5)
    assert set(kept.outcome.raw) == {"f"}


def test_the_time_of_a_start_is_no_time_of_work() -> None:
    found = check(Engine("dear", 1000.0))
    assert found.seconds_per_work["dear"] == pytest.approx(CPU_PER_WORK, rel=1e-9)


def test_a_function_runs_whole_however_dear_it_is() -> None:
    seeds: list[int] = []
    level = FunctionLevel("f", lambda x, seed: float(seeds.append(seed) or x[0]), 10.0)
    found = check(level)
    assert seeds == [1]
    assert [e.objective for e in found.evaluations] == [0.5]
    assert not isinstance(level, Probed)
    assert 0.0 <= found.seconds_per_work["f"] < 0.1


def test_evaluations_are_numbered_level_by_level() -> None:
    found = check(Engine("a", 1.0), FunctionLevel("b", lambda x, seed: 0.0), Engine("c", 1e3))
    assert [(e.candidate.index, e.candidate.level) for e in found.evaluations] == [
        (0, "a"), (1, "b"),
    ]  # fmt: skip


def test_a_level_that_always_fails_stops_the_study_with_its_log() -> None:
    broken = Engine("broken", 1.0, fails=lambda seed: True)
    with pytest.raises(SimulationError, match=r"'broken' cannot run: [^\n]*\nseed 3\nlicence"):
        check(broken, Engine("fine", 10.0))
    assert [seed for _, seed in broken.calls] == [1, 2, 3]


def test_a_dear_level_that_always_fails_stops_the_study() -> None:
    with pytest.raises(SimulationError, match="'dear' cannot run"):
        check(Engine("cheap", 1.0), Engine("dear", 1000.0, fails=lambda seed: True))


def test_a_level_that_fails_once_runs_on_and_its_failure_is_kept() -> None:
    shaky = Engine("shaky", 1.0, fails=lambda seed: seed == 1)
    (kept,) = check(shaky, Engine("dear", 1e3)).evaluations
    assert [seed for _, seed in shaky.calls] == [1, 2]
    assert (kept.candidate.seed, kept.outcome.status, kept.objective) == (1, "crashed", np.inf)


def test_of_a_reference_the_first_steps_are_run_however_cheap_it_is() -> None:
    reference = Engine("reference", 1.0)
    found = check(Engine("dear", 1e3), reference=reference)
    assert reference.calls == [(SHORT, 1), (LONG, 1)]
    assert found.evaluations == ()
    assert set(found.seconds_per_work) == {"dear", "reference"}


def test_an_answer_without_objective_is_a_failure() -> None:
    @dataclass(frozen=True)
    class Mute(Engine):
        def evaluate(self, x: Array, *, seed: int) -> Outcome:
            return replace(super().evaluate(x, seed=seed), raw={})

    with pytest.raises(SimulationError, match="there is no f"):
        check(Mute("mute", 1.0), Engine("dear", 1e3))


def test_whole_runs_that_are_stored_are_not_made_again() -> None:
    cheap, dear = Engine("cheap", 1.0), Engine("dear", 1e3)
    first = check(cheap, dear)
    again = check(cheap, dear, known=first.evaluations)
    assert cheap.calls == [(1.0, 1)]
    assert [e.outcome for e in again.evaluations] == [e.outcome for e in first.evaluations]
    assert again.seconds_per_work["cheap"] == pytest.approx(CPU_PER_WORK + START_S)
    assert again.seconds_per_work["dear"] == pytest.approx(CPU_PER_WORK)


def test_what_a_broken_off_check_left_out_is_made_under_the_same_number() -> None:
    levels = (Engine("a", 1.0), Engine("b", 1.0), Engine("c", 1e3))
    whole = check(*levels)
    rest = check(*levels, known=whole.evaluations[:1])
    assert [level.calls for level in levels[:2]] == [[(1.0, 1)], [(1.0, 1), (1.0, 1)]]
    numbered = [(e.candidate.index, e.candidate.level) for e in rest.evaluations]
    assert numbered == [(0, "a"), (1, "b")]
