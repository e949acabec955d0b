"""Scores of concealed cases: perfect lines score perfectly, small examples by hand."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from benchmarks.concealed import reduced
from benchmarks.concealed.bic import chosen, deviations
from benchmarks.concealed.distance import differences, distance, rows_of
from benchmarks.concealed.oracle import knowing, oracle_error
from benchmarks.concealed.places import by_window, f1, localised
from benchmarks.concealed.score import out_of_reach, over_oracle, report
from benchmarks.concealed.stated import in_stated_set, intervals_hold, is_true, smallest_set
from calibration.diagnosis.joint import NOTHING, Hypothesis, Joint, Suspect
from calibration.observed import Block, Observed
from mfopt.arrays import Array

BALL = 1  # of the reduced models
DRAG, BUOYANCY = (Suspect(n, i, False, False) for n, i in (("drag_quadratic", 0), ("buoyancy", 2)))
POINT = np.array([0.4, 0.6])  # of the unit cube: base parameter, strength


@pytest.fixture(scope="module")
def ball() -> reduced.Prepared:
    """The falling ball, learned from few runs."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(reduced, "RUNS", 80)
        return reduced.prepared.__wrapped__(BALL)


def recorded(its: reduced.Prepared, rows: list[Array]) -> tuple[Joint, list[Observed]]:
    """Recordings that have these rows (p,)."""
    groups = its.joint.likelihood.groups
    scores = [
        (row - g.emulator.mean) / g.emulator.scale @ g.basis.T
        for row, g in zip(rows, groups, strict=True)
    ]
    pairs = zip(its.observations, rows, strict=False)
    seen = [replace(o, values=row) for o, row in pairs]
    return its.joint.having(np.concatenate(scores)), seen


def line(kind: str, truth: dict[str, float], **changed: Any) -> dict[str, Any]:
    """A case in which everything is found as it is: the first 8 of 32 cells differ."""
    outside = kind == "outside"
    verdict = {"null": "nothing", "outside": "unknown"}.get(kind, "named")
    best = "other" if outside else " + ".join(truth) or "nothing"
    true = [3.0] * 8 + [0.1] * 24 if truth else [0.0] * 32
    return {
        "kind": kind, "truth": truth, "true_strengths": {} if outside else truth,
        "distance": 7.0 if truth else 0.0, "verdict": verdict,
        "effects": list(truth) if verdict == "named" else [],
        "hypotheses": {best: 1.0},
        "strengths": {n: [s - 0.1, s + 0.1] for n, s in truth.items()},
        "held_out": [5.0, 1.0, 4.0, 2.0], "oracle": 1.0 if truth and not outside else None,
        "true_cells": true, "cells": [["wide", "level", size, 1.0] for size in true],
        "bic": "nothing" if outside or not truth else next(iter(truth)), "cpu_s": 1.0,
        **changed,
    }  # fmt: skip


PERFECT = [
    line("null", {}), line("misjudged", {}, verdict="nothing", effects=[]),
    line("single", {"leak": 0.5}), line("pair", {"leak": 0.4, "foam": 0.6}),
    line("outside", {"bulge": 0.1}),
]  # fmt: skip


def test_perfect_lines_score_perfectly() -> None:
    told = report(PERFECT)
    text = "\n".join(told)
    for part in (
        "null: 0 of 1 false alarms",
        "1 singles, named right 1,",
        "both 1, wrong 0",
        "outside: 1, not named 1",
        "wrong names over all: 0",
        "expected calibration error 0.000",
        "stated 90 % sets hold the truth: 5 of 5 (100 %)",
        "strength in its 90 % interval where named right: 3 of 3 (100 %)",
        "after over that of an oracle, median: 1.00 in 2 singles and pairs",
        "cells, F1 at D >= 5: 1.00 in 3 cases",
        "BIC with independent noise: 0 of 2 false alarms, named right 1 of 1 singles",
        "wrong names over all 0",
        "below D = 5 at full strength: none",
    ):
        assert part in text, part


def test_a_clean_case_is_a_null() -> None:
    its = line("clean", {}, verdict="named", effects=["leak"], bic="leak")
    text = "\n".join(report([its]))
    assert "clean: 1 of 1 false alarms" in text
    assert "BIC with independent noise: 1 of 1 false alarms" in text


def test_the_stated_set_is_the_smallest_that_is_likely_enough() -> None:
    assert smallest_set({"a": 0.3, "b": 0.55, "c": 0.1, "d": 0.05}) == {"a", "b", "c"}
    assert smallest_set({"a": 0.95, "b": 0.05}) == {"a"}


@pytest.mark.parametrize(("kind", "hypothesis", "holds"), [
    ("null", "nothing", True), ("null", "leak", False),
    ("single", "leak", True), ("single", "leak + other", False), ("single", "foam", False),
    ("pair", "leak", True), ("pair", "foam + leak", True), ("pair", "viscosity", False),
    ("outside", "other", True), ("outside", "leak + other", True), ("outside", "leak", False),
])  # fmt: skip
def test_what_hypothesis_is_true(kind: str, hypothesis: str, holds: bool) -> None:
    names = {"null": (), "single": ("leak",), "pair": ("leak", "foam"), "outside": ("bulge",)}
    assert is_true(hypothesis, line(kind, dict.fromkeys(names[kind], 0.5))) == holds


def test_stated_sets_hold_the_truth_as_often_as_they_say() -> None:
    # A calibrated source: the truth is drawn with the stated probabilities.
    rng, stated = np.random.default_rng(1), {"leak": 0.6, "foam": 0.31, "viscosity": 0.09}
    drawn = rng.choice(list(stated), 4000, p=list(stated.values()))
    held = [in_stated_set(line("single", {n: 0.5}, hypotheses=stated)) for n in drawn]
    assert np.mean(held) == pytest.approx(0.91, abs=0.02)


def test_a_strength_counts_where_its_effect_is_in_the_likeliest_hypothesis() -> None:
    made = [
        line("single", {"leak": 0.5}),
        line("single", {"leak": 0.5}, strengths={"leak": [0.6, 0.7]}),
        line("single", {"leak": 0.5}, strengths={}),
        line("single", {"leak": 1.0}, strengths={"leak": [0.9, 0.99]}),
    ]
    assert intervals_hold(made) == [True, False, False, False]
    assert intervals_hold(made, below_full=True) == [True, False, False]


def test_f1_by_hand() -> None:
    # Two hits, one cell missed, one flagged in vain: precision and recall are 2/3.
    there = np.array([True, True, True, False, False])
    flagged = np.array([True, True, False, True, False])
    assert f1(there, flagged) == pytest.approx(2.0 / 3.0)
    assert f1(there, np.ones(5, dtype=bool)) == pytest.approx(0.75)


def test_cells_are_pooled_and_doubtful_ones_do_not_count() -> None:
    # 4 true cells, of which 3 are flagged; 1 of 5 others is; 1 is doubtful.
    true = [2.0, 2.0, 2.0, 2.0, 1.2, 0.1, 0.1, 0.1, 0.1, 0.1, 0.0, 0.0, 0.0]
    flagged = [2.0, 2.0, 2.0, 0.5, 9.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    cells = [["wide", "level", size, 1.0] for size in flagged]
    its = line("single", {"leak": 0.5}, true_cells=true, cells=cells)
    weak, whole = {**its, "distance": 4.9}, {**its, "true_cells": [2.0] * 13}
    found = localised([its, weak, whole, line("null", {})])
    assert found.cases == 1
    assert found.f1 == pytest.approx(2 * 3 / (4 + 4))
    assert found.everything == pytest.approx(2 * 4 / (4 + 12))


def test_windows_are_eighths_of_each_channel() -> None:
    times = np.linspace(0.0, 1.0, 16)
    blocks = (Block("level", times), Block("mass", None))
    empty = np.zeros((17, 17))
    seen = Observed("wide", blocks, np.zeros(17), 2, empty, empty[:, :0], 0.0, 0.0)
    row = np.append(np.repeat(np.arange(8.0), 2), -5.0)
    assert by_window([seen], [row]) == [*map(float, range(8)), 5.0]


def test_only_clear_cases_are_compared_with_an_oracle() -> None:
    made = [
        line("single", {"leak": 0.5}, held_out=[5.0, 3.0, 4.0, 2.0], oracle=2.0),
        line("single", {"leak": 0.5}, distance=4.0),
        line("outside", {"bulge": 0.1}),
    ]
    assert over_oracle(made) == [1.5]


def test_effects_out_of_reach_are_told_with_their_largest_distance() -> None:
    made = [
        line("single", {"smoothing": 1.0}, distance=3.0),
        line("single", {"smoothing": -1.0}, distance=4.0),
        line("single", {"leak": 1.0}), line("single", {"foam": 0.3}, distance=1.5),
    ]  # fmt: skip
    assert out_of_reach(made) == {"smoothing": 4.0}
    assert "below D = 5 at full strength: smoothing (4.0)" in report(made)


def test_the_library_of_the_ball_has_the_effects_of_these_tests(ball: reduced.Prepared) -> None:
    names = [effect.name for effect in ball.library.effects]
    assert (names[DRAG.number], names[BUOYANCY.number]) == (DRAG.name, BUOYANCY.name)


def test_bic_names_an_effect_where_errors_are_independent(ball: reduced.Prepared) -> None:
    joint, rng = ball.joint, np.random.default_rng(1)
    sd = np.split(deviations(joint, ball.observations[: ball.fitted]), ball.fitted)
    for which, point, name in (
        (NOTHING, POINT[:1], "nothing"), (Hypothesis((DRAG,)), POINT, DRAG.name),
    ):  # fmt: skip
        exact = rows_of(joint, which, point)
        rows = [row + s * rng.standard_normal(len(row)) for row, s in zip(exact, sd, strict=True)]
        its, seen = recorded(ball, rows)
        assert chosen(its, seen, (DRAG, BUOYANCY), 1) == name


def test_an_oracle_predicts_a_recording_without_noise(ball: reduced.Prepared) -> None:
    rows = rows_of(ball.joint, Hypothesis((DRAG,)), POINT)
    whole, seen = recorded(ball, rows)
    true, wrong = (oracle_error(whole, seen, 2, [effect], 1) for effect in (DRAG, BUOYANCY))
    assert true < 0.3 < 3.0 < wrong


def test_an_oracle_fits_both_effects_of_a_pair(ball: reduced.Prepared) -> None:
    point = np.array([*POINT, 0.5])
    whole, _ = recorded(ball, rows_of(ball.joint, Hypothesis((DRAG, BUOYANCY)), point))
    found = knowing(whole, [DRAG, BUOYANCY], POINT[:1], 1)
    strengths = {s.name: found.best[1 + i] for i, s in enumerate(found.which.suspects)}
    assert strengths == pytest.approx({DRAG.name: 0.6, BUOYANCY.name: 0.5}, abs=0.1)


def test_cells_of_an_effect_are_as_far_as_its_distance_says(ball: reduced.Prepared) -> None:
    rows = rows_of(ball.joint, Hypothesis((DRAG,)), POINT)
    apart = differences(ball.joint, rows, 1)
    true = by_window(ball.observations[: ball.fitted], apart)
    far = distance(ball.joint, rows, 1)
    assert 0.5 * far < max(true) <= far + 1e-3
    plain = differences(ball.joint, rows_of(ball.joint, NOTHING, POINT[:1]), 1)
    assert max(by_window(ball.observations[: ball.fitted], plain)) < 0.1
