import dataclasses

import numpy as np
import pytest

from fidelity.scenes.dosing.design import Design, design, dosing_problem, starting_designs
from fidelity.scenes.dosing.reduced import Flow, ReducedDosing, discharge, passage, quantiles, queue
from fidelity.scenes.dosing.settings import DosingSettings
from mfopt.arrays import Array
from mfopt.records.outcome import Outcome

SETTINGS = DosingSettings()
PROBLEM = dosing_problem(SETTINGS)
LEVEL = ReducedDosing("reduced", SETTINGS)
GRAIN = LEVEL.grain_diameter


def with_values(**values: float) -> Array:
    return np.array([{**PROBLEM.named(PROBLEM.baseline), **values}[n] for n in PROBLEM.names])


SLOW = with_values(x1=0.3, y1=0.4, x2=0.7, y2=0.5, v=1.2)


def run(x: Array, **settings: float) -> Outcome:
    level = dataclasses.replace(LEVEL, settings=SETTINGS.model_copy(update=settings))
    return level.evaluate(x, seed=0)


def test_every_grain_is_accounted_for_at_random_designs() -> None:
    rng = np.random.default_rng(2)
    finished = 0
    for x in PROBLEM.to_x(rng.random((60, PROBLEM.dimension))):
        outcome = LEVEL.evaluate(x, seed=0)
        assert outcome.finished == (PROBLEM.impossible(x) is None)
        if not outcome.finished:
            assert outcome.status == "invalid_design"
            continue
        finished += 1
        raw = outcome.raw
        counts = [int(raw[n]) for n in ("passed", "left_in_cup", "left_in_hopper", "lost")]
        assert min(counts) >= 0
        assert sum(counts) == LEVEL.grains
        assert raw["passage_times"].size == counts[0]
        assert np.all(np.diff(raw["passage_times"]) >= 0)
    assert finished > 20


def test_nothing_flows_if_the_cup_never_comes_over_the_hole() -> None:
    machine = dataclasses.replace(design(SETTINGS, PROBLEM.baseline), stroke=4.0, cycle=1e3)
    stream, left = discharge(machine, Flow(), GRAIN, 1.0)  # 2 m away, and hardly moves
    assert stream.share.size == 0
    assert left == 1.0


def test_discharged_and_left_make_the_portion() -> None:
    for x in (PROBLEM.baseline, SLOW):
        stream, left = discharge(design(SETTINGS, x), Flow(), GRAIN, 1.2)
        assert stream.share.sum() + left == pytest.approx(1.0, rel=1e-9)


def test_cup_that_lingers_over_the_hole_leaves_less() -> None:
    designs = (starting_designs(PROBLEM)["constant"], SLOW)
    constant, slow = (int(run(x).raw["left_in_cup"]) for x in designs)
    assert slow < constant


def test_slower_cycle_leaves_no_more_in_the_cup() -> None:
    left = [
        int(run(PROBLEM.baseline, cycle_ms=c, duration_ms=4000).raw["left_in_cup"])
        for c in (300, 600, 1200, 2400)
    ]
    assert left == sorted(left, reverse=True)
    assert left[0] > left[-1]


def test_no_grain_passes_sooner_than_in_free_fall() -> None:
    rng = np.random.default_rng(4)
    for x in PROBLEM.to_x(rng.random((30, PROBLEM.dimension))):
        times = LEVEL.evaluate(x, seed=0).raw.get("passage_times")
        if times is not None and times.size:
            assert times[0] > np.sqrt(2 * 0.56 / 9.81)


def test_free_fall_without_walls_queue_and_brake() -> None:
    # A prism as wide as can be, with an unlimited opening and neck: every column falls freely,
    # and its top and bottom are as far apart as sqrt(2 h / g) says.
    wide = {"l0": 900, "w0": 500, "r0": 25, "l3": 900, "w3": 500, "r3": 25}
    settings = SETTINGS.model_copy(update={"values": wide, "stroke_mm": 1.0})
    machine = design(settings, straight(wide))
    free = Flow(opening=1e3, queue=1e3, stream=1e6, slip=0.0, drop=0.0)
    stream, left = discharge(machine, free, GRAIN, 1.2)
    times = passage(machine, free, GRAIN, stream, friction=0.4)
    assert left == 0.0
    # The discharge advances in steps of 5 ms.
    low, high = (np.sqrt(2 * drop / 9.81) for drop in (0.56, 0.56 + machine.cup.height))
    assert np.ptp(times) == pytest.approx(high - low, abs=8e-3)


def straight(wide: dict[str, float]) -> Array:
    sections = {f"{a}{i}": wide[f"{a}0"] for a in "lwr" for i in (1, 2)}
    return with_values(**sections)


def test_rougher_walls_let_nothing_pass_sooner() -> None:
    # Without a queue: one that forms later may well let more pass at its start.
    machine: Design = design(SETTINGS, with_values(s1=40.0, s2=-30.0))
    flow = Flow(stream=1e6, queue=1e6)
    stream, _ = discharge(machine, flow, GRAIN, 1.2)
    means = [
        float(np.average(passage(machine, flow, GRAIN, stream, mu), weights=stream.share))
        for mu in (0.0, 0.2, 0.5)
    ]
    assert means == sorted(means)
    assert means[0] < means[-1]


def test_smaller_tube_takes_longer() -> None:
    spans = [
        float(np.ptp(run(SLOW, values={"l3": side, "w3": side, "r3": 10.0}).raw["passage_times"]))
        for side in (60.0, 75.0, 95.0)
    ]
    assert spans[0] > spans[1] > spans[2]


def test_queue_serves_one_after_the_other() -> None:
    one = np.full(4, 0.001)
    leaves = queue(np.array([0.0, 0.0, 0.0, 5.0]), one, one)
    assert leaves == pytest.approx([0.001, 0.002, 0.003, 5.001])


def test_a_queue_leaves_at_the_slow_rate() -> None:
    n = 1000
    leaves = queue(np.zeros(n), np.full(n, 1e-3), np.full(n, 3e-3))
    assert np.diff(leaves)[-1] == pytest.approx(3e-3)
    apart = queue(np.arange(n) * 1e-2, np.full(n, 1e-3), np.full(n, 3e-3))
    assert apart == pytest.approx(np.arange(n) * 1e-2 + 1e-3)


def test_quantiles_keep_number_and_order() -> None:
    times, share = np.array([0.5, 0.4, 0.6, 9.0]), np.array([0.25, 0.25, 0.25, 0.25])
    grains = quantiles(times, share, 100, duration=1.0)
    assert grains.size == 75
    assert grains[0] == 0.4
    assert grains[-1] == pytest.approx(0.6, abs=3e-3)
    assert np.all(np.diff(grains) >= 0)


def test_seed_changes_nothing() -> None:
    first, again = (LEVEL.evaluate(SLOW, seed=seed) for seed in (0, 17))
    assert np.array_equal(first.raw["passage_times"], again.raw["passage_times"])
    assert first.work == again.work == LEVEL.work(SLOW)
