"""Concealed cases: what is drawn, how it is recorded, and that a seal holds."""

from collections import Counter

import numpy as np
import pytest

from benchmarks.concealed.recordings import LENGTHS, NOISE, STEPS, recorded
from benchmarks.concealed.rigs import CHANNELS, SETTINGS
from benchmarks.concealed.sealed import code_digest
from benchmarks.concealed.truth import BLOCK
from calibration.diagnosis.measuring import FULL, WIDEST

TIMES = np.linspace(0.0, 1.1, 111)
RUN = {
    "time": TIMES,
    "discharged_fraction": 1.0 - np.exp(-2.0 * TIMES),
    "level_left": 0.05 * np.exp(-2.0 * TIMES),
    "level_right": 0.05 * np.exp(-2.0 * TIMES),
}
RUNS = {setting.name: [RUN] * setting.repeats for setting in SETTINGS}


def table(measured: dict[str, float], seed: int = 1) -> np.ndarray:
    """Time and channels (n, 4) of the first file."""
    text = recorded(RUNS, measured, seed)["wide-1.csv"]
    return np.array([[float(v) for v in row.split(",")] for row in text.splitlines()[1:]])


def test_the_schedule_is_that_of_220_cases() -> None:
    kinds = Counter(kind.partition(" ")[0] for kind in BLOCK)
    assert {kind: 10 * count for kind, count in kinds.items()} == {
        "clean": 40, "misjudged": 20, "stiffness": 20, "single": 90, "pair": 20, "outside": 30,
    }  # fmt: skip
    assert [10 * sum(kind == f"single {d}" for kind in BLOCK) for d in (7.0, 4.0, 1.5)] == [
        40, 30, 20,
    ]  # fmt: skip


def test_a_recording_is_a_run_with_noise_in_steps() -> None:
    its = table({})
    for column, channel in enumerate(CHANNELS, start=1):
        apart = its[:, column] - np.interp(its[:, 0], TIMES, RUN[channel])
        assert 0.5 * NOISE[channel] < np.std(apart) < 2.0 * NOISE[channel]
        steps = its[:, column] / STEPS[channel]
        assert np.allclose(steps, np.round(steps))


def test_repeats_and_recordings_have_noise_of_their_own() -> None:
    files = recorded(RUNS, {}, 1)
    assert len(set(files.values())) == len(files) == 7
    assert recorded(RUNS, {}, 1) == files
    assert recorded(RUNS, {}, 2) != files


@pytest.mark.parametrize(("name", "at", "factor"), [
    ("clock_rate", lambda t: 1.1 * t, 1.0),
    ("clock_offset", lambda t: t + 0.11, 1.0),
    ("length_scale", lambda t: t, 1.1),
])  # fmt: skip
def test_effects_of_measuring_act_as_a_diagnosis_supposes(name, at, factor) -> None:
    its = table({name: 1.0})  # full strength: a share of 0.1
    assert FULL == 0.1
    for column, channel in enumerate(CHANNELS, start=1):
        expected = np.interp(at(its[:, 0]), TIMES, RUN[channel])
        expected = expected * (factor if channel in LENGTHS else 1.0)
        assert abs(np.mean(its[:, column] - expected)) < 2.0 * NOISE[channel]


def test_a_bias_moves_one_channel_by_a_share_of_its_range() -> None:
    its, plain = table({"sensor_bias.level_left": -1.0}), table({})
    moved = np.mean(its - plain, axis=0)
    size = FULL * np.ptp(RUN["level_left"])
    assert moved[2] == pytest.approx(-size, abs=0.1 * size)
    assert np.allclose(moved[[0, 1, 3]], 0.0, atol=1e-9)


def test_smoothing_flattens_what_is_curved() -> None:
    its, plain = table({"smoothing": 1.0}), table({})
    width = WIDEST * TIMES[-1]
    expected = -(width**2) / 2.0 * 4.0 * np.exp(-2.0 * its[10:-10, 0])
    assert np.mean(its[10:-10, 1] - plain[10:-10, 1]) == pytest.approx(expected.mean(), rel=0.3)


def test_the_digest_of_the_code_stays_the_same() -> None:
    assert code_digest() == code_digest()
    assert len(code_digest()) == 64
