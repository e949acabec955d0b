"""Effects are told from one another, and from nothing."""

import numpy as np
import pytest
from toy_diagnosis import SIZES, joint_of, recorded, seen

from calibration.diagnosis.alike import alike, faint
from calibration.diagnosis.compare import compare
from calibration.diagnosis.linear import around
from calibration.diagnosis.nulls import mismatch_in
from calibration.diagnosis.verdict import judged
from calibration.diagnosis.where import cells
from surrogates.series import SeriesEmulator

BOTH = ["slow", "fast"]
Learned = list[SeriesEmulator]


def test_nothing_is_found_where_nothing_is_missing(learned: Learned) -> None:
    found = []
    for seed in range(6):
        joint, suspects, _ = joint_of(recorded((0.4, 0.6), {}, seed), learned)
        compared = compare(joint, suspects, 2, seed)
        test = mismatch_in(joint, around(joint, suspects, compared.nothing.best), compared, seed)
        found.append(judged(joint, BOTH, compared, test, (), seed).kind)
    assert found.count("nothing") >= 5


def test_an_effect_is_named_with_its_size_and_place(learned: Learned) -> None:
    its = recorded((0.4, 0.6), {"kick": 0.15}, 3)
    joint, suspects, _ = joint_of(its, learned)
    compared = compare(joint, suspects, 2, 1)
    near = around(joint, suspects, compared.nothing.best)
    verdict = judged(joint, BOTH, compared, mismatch_in(joint, near, compared, 1), alike(near), 1)
    assert (verdict.kind, verdict.effects) == ("named", ("kick",))
    assert [vote.against for vote in verdict.votes] == [False, False]
    low, high = (SIZES["kick"] * compared.best.strength(0, q) ** 2 for q in (0.02, 0.98))
    assert low < 0.15 < high < 2.0 * low
    clear = {(c.channel, c.start > 0.5) for c in cells(joint, its, near, compared, 1)
             if c.stands_out}  # fmt: skip
    assert ("share", True) in clear
    assert not any(channel == "level" for channel, _ in clear)


def test_effects_that_look_alike_are_a_class_and_a_set(learned: Learned) -> None:
    joint, suspects, _ = joint_of(recorded((0.4, 0.6), {"bend": 0.1}, 5), learned)
    compared = compare(joint, suspects, 2, 1)
    near = around(joint, suspects, compared.nothing.best)
    assert any({"bend", "twin"} <= set(its) for its in alike(near))
    verdict = judged(joint, BOTH, compared, mismatch_in(joint, near, compared, 1), alike(near), 1)
    assert "bend" in verdict.effects
    assert "kick" not in faint(near)


def test_one_experiment_alone_gives_the_whole_class(learned: Learned) -> None:
    whole, suspects, _ = joint_of(recorded((0.4, 0.6), {"bend": 0.3}, 5), learned)
    joint = whole.of([0])
    compared = compare(joint, suspects, 2, 1)
    near = around(joint, suspects, compared.nothing.best)
    verdict = judged(
        joint, BOTH[:1], compared, mismatch_in(joint, near, compared, 1), alike(near), 1
    )
    assert verdict.kind == "set"
    assert {"bend", "twin"} <= set(verdict.effects)


def test_the_main_part_of_a_mismatch_is_told_beside_what_no_effect_explains(
    learned: Learned,
) -> None:
    made = [recorded((0.4, 0.6), {"kick": 0.28}, seed) for seed in range(25)]
    jagged = 0.002 * np.sign(np.sin(np.arange(48) / 1.5))
    its = [
        seen(name, np.mean([again[place].values for again in made], axis=0) + jagged, 50)
        for place, name in enumerate(BOTH)
    ]
    joint, suspects, _ = joint_of(its, learned)
    compared = compare(joint, suspects, 2, 1)
    near = around(joint, suspects, compared.nothing.best)
    verdict = judged(joint, BOTH, compared, mismatch_in(joint, near, compared, 1), alike(near), 1)
    assert (verdict.kind, verdict.effects) == ("partly", ("kick",))
    assert verdict.explained is not None
    assert 0.9 <= verdict.explained < 1.0


def test_an_error_of_the_scale_is_a_rival_of_full_standing(learned: Learned) -> None:
    joint, suspects, measuring = joint_of(recorded((0.4, 0.6), {}, 7, stretched=0.06), learned)
    compared = compare(joint, suspects, 2, 1)
    assert compared.of("length_scale") > 0.8
    best = compared.likeliest
    (scale,) = (m for m in measuring if m.name == "length_scale")
    assert scale.size(best.strength(0, 0.5)) == pytest.approx(0.06, abs=0.015)


def test_p_values_of_drawn_recordings_are_even(learned: Learned) -> None:
    joint, suspects, _ = joint_of(recorded((0.5, 0.5), {}, 11), learned)
    compared = compare(joint, suspects, 2, 1)
    near = around(joint, suspects, compared.nothing.best)
    rng = np.random.default_rng(1)
    drawn = near.mean + rng.standard_normal((400, len(near.mean))) @ near.factor.T
    best, _ = near.gains(drawn)
    again, _ = near.gains(near.mean + rng.standard_normal((4000, len(near.mean))) @ near.factor.T)
    share = np.mean(best.max(axis=1) > np.quantile(again.max(axis=1), 0.95))
    assert 0.02 < share < 0.09
