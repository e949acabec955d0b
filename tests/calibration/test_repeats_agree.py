"""Repeats agree up to noise, scatter of packing and a later start; anything else is refused."""

from dataclasses import replace

import numpy as np
import pytest

from calibration.recordings.agreement import agreeing, best_shift, check_scalars, roughness
from calibration.recordings.case import Known
from calibration.recordings.records import Repeat, Series
from mfopt.arrays import Array
from mfopt.errors import ConfigError
from mfopt.records.rig import Channel

LEVEL = Channel("level", "m", 0.1)
ANGLE = Channel("angle", "rad", 0.5)
T = np.linspace(0.0, 2.0, 160)


def fall(t: Array, rate: float = 0.045) -> Array:
    """A level [m] that falls to a rest of 10 mm after a smooth end."""
    return 0.01 + np.logaddexp(0.0, 100.0 * (0.09 - rate * np.maximum(t, 0.0) - 0.01)) / 100.0


def repeat(name: str, values: Array, t: Array = T) -> Repeat:
    return Repeat(name, {"level": Series("level", t, values, 0.0, np.zeros(t.size, bool))})


def noise(seed: int, sd: float) -> Array:
    return sd * np.random.default_rng(seed).standard_normal(T.size)


@pytest.mark.parametrize("sd", [0.0, 2e-4, 5e-3])
@pytest.mark.parametrize("faster", [0.97, 1.03, 1.08])
def test_noise_and_packing_are_no_contradiction(sd: float, faster: float) -> None:
    repeats = [
        repeat("a", fall(T) + noise(0, sd)),
        repeat("b", fall(T, 0.045 * faster) + noise(1, sd)),
    ]
    agreeing(repeats, LEVEL, 0.05, "case")


@pytest.mark.parametrize("late", [-0.4, -0.05, 0.2, 0.5])
def test_a_later_start_is_said_and_not_refused(late: float) -> None:
    repeats = [repeat("a", fall(T) + noise(0, 2e-4)), repeat("b", fall(T - late) + noise(1, 2e-4))]
    a, b = agreeing(repeats, LEVEL, 0.05, "case")
    assert a.notes == ()
    assert "later" in b.notes[0] if late > 0.0 else "earlier" in b.notes[0]
    assert best_shift(a.series["level"], b.series["level"]) == pytest.approx(late, abs=0.01)


def test_an_unknown_start_is_shifted_before_repeats_are_compared() -> None:
    late = fall(T - 0.3, 0.045 * 1.25)
    known = [repeat("a", fall(T)), repeat("b", late)]
    with pytest.raises(ConfigError, match="differs"):
        agreeing(known, LEVEL, 0.08, "case")
    agreeing([replace(r, start_sd_s=np.inf) for r in known], LEVEL, 0.08, "case")


def test_repeats_on_other_times_agree() -> None:
    t = np.sort(np.random.default_rng(3).uniform(0.1, 1.8, 37))
    agreeing([repeat("a", fall(T)), repeat("b", fall(t), t)], LEVEL, 0.02, "case")


@pytest.mark.parametrize("n", [2, 3, 5])
def test_the_odd_one_out_is_named(n: int) -> None:
    repeats = [repeat(f"r{i}", fall(T) + noise(i, 2e-4)) for i in range(n)]
    repeats[1] = repeat("r1", np.maximum(fall(T), 0.06) + noise(1, 2e-4))  # jams half-way
    with pytest.raises(ConfigError, match=r"level of r1 differs" if n > 2 else r"level of r. "):
        agreeing(repeats, LEVEL, 0.05, "case")


def test_the_tolerance_is_the_users() -> None:
    repeats = [repeat("a", fall(T)), repeat("b", fall(T, 0.03))]
    with pytest.raises(ConfigError, match="above the limit of 5%"):
        agreeing(repeats, LEVEL, 0.05, "case")
    agreeing(repeats, LEVEL, 0.5, "case")


def test_a_stated_error_of_the_zero_is_no_contradiction() -> None:
    repeats = [repeat("a", fall(T)), repeat("b", fall(T) + 0.01 * np.sin(np.pi * T))]
    with pytest.raises(ConfigError, match="differs"):
        agreeing(repeats, LEVEL, 0.05, "case")
    agreeing(repeats, LEVEL, 0.05, "case", Known(offset=0.003))


def test_half_of_a_contradiction_is_said() -> None:
    repeats = [
        repeat(f"r{i}", fall(T) + noise(i, 1e-4) + 0.008 * (i == 2) * np.sin(np.pi * T))
        for i in range(3)
    ]
    made = agreeing(repeats, LEVEL, 0.1, "case")
    assert [bool(its.notes) for its in made] == [False, False, True]
    assert "7% of the range" in made[2].notes[0]


def test_roughness_is_the_noise_of_a_smooth_series() -> None:
    its = repeat("a", fall(T) + noise(5, 3e-4)).series["level"]
    assert roughness(its) == pytest.approx(3e-4, rel=0.25)
    assert roughness(repeat("a", fall(T)).series["level"]) < 1e-5


@pytest.mark.parametrize("values", [[0.52, 0.49], [0.5, 0.55, 0.48, 0.51], [0.3, 0.38]])
def test_numbers_that_scatter_agree(values: list[float]) -> None:
    check_scalars([Repeat("", {}, {"angle": v}) for v in values], ANGLE, 0.1, "case")


@pytest.mark.parametrize("values", [[0.5, 0.2], [0.5, 0.52, 0.9], [0.5, 0.5, 0.5, 0.5, 0.1]])
def test_numbers_that_contradict_are_refused(values: list[float]) -> None:
    with pytest.raises(ConfigError, match=r"angle = .* differs from the other repeats"):
        check_scalars([Repeat("", {}, {"angle": v}) for v in values], ANGLE, 0.1, "case")


def test_numbers_agree_within_the_noise_that_is_stated() -> None:
    repeats = [Repeat("", {}, {"angle": v}) for v in (0.116, 0.16, 0.179)]
    check_scalars(repeats, ANGLE, 0.1, "case", Known(noise=0.02))
    with pytest.raises(ConfigError, match="differs from the other repeats"):
        check_scalars(repeats, ANGLE, 0.1, "case", Known(noise=0.01))


def test_series_agree_within_the_noise_that_is_stated() -> None:
    repeats = [repeat(f"r{i}", fall(T) + 0.05 * i * np.sin(np.pi * T)) for i in range(3)]
    with pytest.raises(ConfigError, match="these are no repeats"):
        agreeing(repeats, LEVEL, 0.1, "case", Known(noise=0.001))
    agreeing(repeats, LEVEL, 0.1, "case", Known(noise=0.03))


def test_small_numbers_that_can_vanish_agree() -> None:
    repeats = [Repeat("", {}, {"left": share}) for share in (0.01, 0.03, 0.0)]
    check_scalars(repeats, Channel("left", "-", 1.0, can_vanish=True), 0.1, "case")
    with pytest.raises(ConfigError, match="differs from the other repeats"):
        check_scalars(repeats, Channel("left", "-", 1.0), 0.1, "case")
