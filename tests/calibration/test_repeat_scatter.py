"""Repeats that differ by more than simulation and noise explain are named, and no others."""

from collections.abc import Sequence

import numpy as np
import pytest

from calibration.observed import observed
from calibration.recordings.case import Case, Known, Measurement, Parameter
from calibration.recordings.records import Noise, Recording, Repeat, Series
from calibration.repeat_scatter import scatter_not_explained
from mfopt.arrays import Array
from mfopt.records.rig import TIME, Channel
from surrogates.series import fit_series

CHANNELS = {"y": Channel("y", "m", 1.0)}
NOISES = {"y": Noise("y", 0.003, 0.0, (0.003, 0.003), "stated")}
T = np.linspace(0.0, 1.0, 51)
FALLING = np.exp(-2.0 * T)
RUNS = 30


def series(values: Array) -> Repeat:
    return Repeat("a.csv", {"y": Series("y", T, values, 0.0, np.zeros(len(T), np.bool_))})


def said(repeats: Sequence[Repeat], *, scatter: float, known: Known | None = None) -> list[str]:
    """What is said of repeats beside runs of a parameter that scatter by a share of the values."""
    rng = np.random.default_rng(1)
    measurement = Measurement(channels={"y": known or Known()})
    recording = Recording("r", {}, tuple(repeats))
    case = Case("c", 1, {}, (Parameter("a", 0.5, 2.0),), measurement, (recording,))
    seen = observed(recording, measurement, NOISES, 1.0)
    a = np.repeat(np.linspace(0.5, 2.0, RUNS // 2), 2)
    size = FALLING if recording.channels else np.array(1.0)
    rows = [seen.row({TIME: T, "y": (v + scatter * rng.standard_normal()) * size}) for v in a]
    blocks = [block.size for block in seen.blocks]
    emulator = fit_series((a[:, None] - 0.5) / 1.5, np.array(rows), blocks)
    return scatter_not_explained(case, NOISES, CHANNELS, [seen], [emulator])


def falling(sizes: Sequence[float], seed: int = 0) -> list[Repeat]:
    rng = np.random.default_rng(seed)
    return [series(a * FALLING + 0.003 * rng.standard_normal(len(T))) for a in sizes]


def numbers(values: Sequence[float]) -> list[Repeat]:
    return [Repeat("", {}, {"y": value}) for value in values]


@pytest.mark.parametrize("repeats", [falling([1.16, 1.2, 1.25]), numbers([1.0, 1.1, 1.2, 1.05])])
def test_a_simulation_that_does_not_scatter_explains_no_scatter(repeats: list[Repeat]) -> None:
    (line,) = said(repeats, scatter=0.0)
    assert line.startswith("The repeats of r differ in y by 0.0")
    assert said(repeats, scatter=0.06) == []


def test_noise_and_stated_errors_explain_their_part() -> None:
    assert said(falling([1.2, 1.2, 1.2]), scatter=0.0) == []
    assert said(falling([1.16, 1.2, 1.25]), scatter=0.0, known=Known(scale=0.04)) == []
    assert said(numbers([1.0, 1.1, 1.2, 1.05]), scatter=0.0, known=Known(noise=0.08)) == []


def test_one_repeat_says_nothing() -> None:
    assert said(falling([1.2]), scatter=0.0) == []


@pytest.mark.parametrize("n", [2, 4])
def test_repeats_that_scatter_as_the_simulation_are_hardly_ever_named(n: int) -> None:
    rng = np.random.default_rng(2)
    drawn = [falling([*(1.2 + 0.04 * rng.standard_normal(n))], seed) for seed in range(40)]
    assert sum(bool(said(repeats, scatter=0.04)) for repeats in drawn) <= 1
