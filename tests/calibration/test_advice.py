"""Which further recording tells most, on a simulator whose answer is known."""

from collections.abc import Sequence

import numpy as np
import pytest

from calibration.advice import RUNS, advise
from calibration.posterior import Posterior
from calibration.recordings.case import Case, Measurement, Parameter
from calibration.words import HARDLY
from mfopt.arrays import Array, frozen
from mfopt.records.evaluation import Candidate, Evaluation
from mfopt.records.outcome import Outcome
from mfopt.records.rig import TIME

PARAMETERS = (Parameter("a", 0.0, 1.0), Parameter("b", 0.0, 1.0))
SCATTER = 0.01
TIMES = np.linspace(0.0, 1.0, 30)


def values(name: str, a: float, b: float) -> Array:
    """`sum` sees a + b, `first` sees a alone, `nothing` sees neither."""
    return {"sum": (a + b) * TIMES, "first": a * TIMES, "nothing": 0.0 * TIMES}[name]


def evaluate(candidates: Sequence[Candidate]) -> list[Evaluation]:
    made = []
    for c in candidates:
        noise = SCATTER * np.random.default_rng(c.seed).normal()
        raw = {TIME: TIMES, "level": values(c.level, *c.x) + noise}
        outcome = Outcome(c.x, c.level, c.seed, "finished", None, raw, 1.0, 0.0)
        made.append(Evaluation(c, outcome, 0.0))
    return made


def ridge() -> Posterior:
    """Known: a + b to 0.01; unknown: a - b."""
    rng = np.random.default_rng(1)
    along, across = rng.uniform(-0.3, 0.3, 2000), 0.005 * rng.normal(size=2000)
    draws = np.column_stack([0.5 + along + across, 0.5 - along + across])
    return Posterior(
        PARAMETERS,
        frozen(draws),
        frozen([0.5, 0.5]),
        0.0,
        0.1,
        1,
        frozen(np.array([[0.0, 0.0], [1.0, 1.0]])),
    )


def test_the_recording_that_breaks_the_ridge_is_named() -> None:
    case = Case("ridge", 1, {}, PARAMETERS, Measurement(), ())
    advice, made = advise(case, ["sum", "first", "nothing"], ridge(), {}, evaluate, 10)
    by_name = {a.name: a.narrower for a in advice}
    # Three repeats and the allowance: the end of the series tells a to about 0.01 of 0.17.
    assert by_name["first"]["a"] < 0.2
    assert by_name["first"]["b"] < 0.2
    assert by_name["sum"]["a"] > 0.9
    assert [e.candidate.index for e in made] == list(range(10, 10 + 3 * RUNS))


def test_an_experiment_that_sees_nothing_is_not_advised_by_chance() -> None:
    misled = 0
    for seed in range(20):
        case = Case("ridge", seed, {}, PARAMETERS, Measurement(), ())
        (advice,), _ = advise(case, ["nothing"], ridge(), {}, evaluate, 1000 * seed)
        misled += min(advice.narrower.values()) < HARDLY
    assert misled <= 3


def test_experiments_that_fail_advise_nothing() -> None:
    def failing(candidates: Sequence[Candidate]) -> list[Evaluation]:
        outcomes = [Outcome(c.x, c.level, c.seed, "crashed", "no") for c in candidates]
        return [Evaluation(c, o, 0.0) for c, o in zip(candidates, outcomes, strict=True)]

    case = Case("ridge", 1, {}, PARAMETERS, Measurement(), ())
    (advice,), _ = advise(case, ["first"], ridge(), {}, failing, 0)
    assert advice.failed == RUNS
    assert advice.narrower == pytest.approx({"a": 1.0, "b": 1.0})
