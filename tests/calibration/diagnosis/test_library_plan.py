"""The plan of a library: what is run, and that more runs and experiments change nothing made."""

import numpy as np
import pytest
from toy_diagnosis import EFFECTS, PARAMETERS, library

from calibration.diagnosis.suspects import RigEffect, effect_of
from mfopt.records.effect import Effect, EffectParameter
from mfopt.records.evaluation import Evaluation
from mfopt.records.outcome import Outcome


def test_a_smaller_library_is_the_beginning_of_a_larger_one() -> None:
    few, many = (library().planned(["one"], n) for n in (40, 90))
    assert [(c.seed, tuple(c.x)) for c in few] == [(c.seed, tuple(c.x)) for c in many[:40]]


def test_further_experiments_leave_the_runs_of_others_as_they_are() -> None:
    alone = {(c.seed, tuple(c.x)) for c in library().planned(["one"], 30)}
    both = library().planned(["two", "one"], 30)
    assert {(c.seed, tuple(c.x)) for c in both if c.level == "one"} == alone


def test_each_run_has_one_effect_or_none_and_all_are_tried_alike() -> None:
    x = np.array([c.x for c in library().planned(["one"], 120)])
    effects = x[:, len(PARAMETERS) :] != 0.0
    assert set(effects.sum(axis=1)) == {0, 1}
    assert np.ptp(effects.sum(axis=0)) <= 1
    nulls = x[~effects.any(axis=1)]
    assert 15 < len(nulls) < 50
    assert len(np.unique(nulls, axis=0)) < len(nulls)  # some run twice


def test_runs_tell_effect_and_strength() -> None:
    planned = library().planned(["one"], 20)
    made = [
        Evaluation(c, Outcome(c.x, "one", c.seed, "finished", None, {}, 1.0, 0.0), 0.0)
        for c in planned
    ]
    runs = library().runs(made)
    for row, effect, strength in zip(
        [c.x for c in planned], runs.effect, runs.strength, strict=True
    ):
        if effect < 0:
            assert strength == 0.0
        else:
            assert row[2 + effect] == pytest.approx(EFFECTS[effect].value(strength))


@pytest.mark.parametrize(
    ("low", "null", "high"), [(0.0, 0.0, 2.0), (-3.0, 0.0, 1.0), (0.2, 1.0, 1.0)]
)
def test_strength_and_value_are_inverse(low: float, null: float, high: float) -> None:
    its = RigEffect("e", "e", null, low, high, "-", "", {})
    for strength in (-0.7, 0.0, 0.3, 1.0) if its.signed else (0.0, 0.3, 1.0):
        value = its.value(strength)
        assert low <= value <= high
        assert its.strength(value) == pytest.approx(strength)


def test_an_effect_with_several_parameters_varies_the_first() -> None:
    its = effect_of(
        Effect(
            "shake",
            {
                "size": EffectParameter(0.0, 0.0, 2.0, "m", "how far"),
                "rate": EffectParameter(0.0, 0.0, 50.0, "Hz", "how often"),
            },
            "apparatus", "", "",
        )
    )  # fmt: skip
    assert its.varies == "shake.size"
    assert its.absent == {"shake.size": 0.0, "shake.rate": 25.0}
