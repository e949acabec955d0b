"""Real recordings, which are no part of this repository, are read with the right size and notes."""

import os
from pathlib import Path

import pytest
from recordings_corpus import read_case

from calibration.recordings.case import Known
from calibration.recordings.noise import measurement_noise
from mfopt.records.rig import Channel

ROOT = Path(
    os.environ.get("MFOPT_RECORDINGS", Path(__file__).parents[2] / ".." / "shared" / "data")
)
CHANNELS = {
    c.name: c
    for c in (
        Channel("height", "m", 50.0),
        Channel("discharged_fraction", "-", 1.0),
        Channel("angle", "rad", 3.0),
        Channel("rate", "rad/s", 10.0),
    )
}
HEAD = '[case]\nname = "c"\n[rig]\n[parameters.p]\nrange = [0.0, 1.0]\n'


@pytest.fixture(scope="module")
def data() -> Path:
    if not ROOT.is_dir():
        if os.environ.get("CI") == "true":
            pytest.fail(f"{ROOT} is missing; set MFOPT_RECORDINGS to the folder of recordings")
        pytest.skip(f"{ROOT} is missing; set MFOPT_RECORDINGS to the folder of recordings")
    return ROOT.resolve()


def case(folder: Path, text: str) -> Path:
    path = folder / "case.toml"
    path.write_text(HEAD + text)
    return path


def test_drops_of_a_ball(data: Path, tmp_path: Path) -> None:
    text = f"""[csv]
rename = {{ h_m = "height [m]" }}
ignore = ["v_mps"]
[[recording]]
name = "golf ball"
files = ["{data}/ball_drops/ball_drops.csv"]
rows = [{{ ball = "Golf Ball", drop = 1 }}, {{ ball = "Golf Ball", drop = 2 }}]
"""
    (drops,) = read_case(case(tmp_path, text), CHANNELS).recordings
    for repeat in drops.repeats:
        height = repeat.series["height"]
        assert 40 <= height.times.size <= 60
        assert 45.0 < height.values[0] < 50.0
        assert height.values[-1] < 16.0
        assert not height.clipped.any()
    noise = measurement_noise([drops], "height", Known())
    assert 0.005 < noise.sigma < 0.5  # a film of 47 m: below a ball's diameter or two


def test_digitised_discharge(data: Path, tmp_path: Path) -> None:
    text = f"""[csv]
rename = {{ discharged_pct = "discharged_fraction [%]" }}
[[recording]]
name = "spheres"
files = ["{data}/hopper_discharge_digitised/hopper_discharge_fraction.csv"]
rows = [{{ series = "plastic_ball" }}]
"""
    case_of = read_case(case(tmp_path, text), CHANNELS)
    share = case_of.recordings[0].repeats[0].series["discharged_fraction"]
    assert share.times.size == 23
    assert share.values[[0, -1]] == pytest.approx([0.0, 0.9445])
    noise = measurement_noise(case_of.recordings, "discharged_fraction", Known())
    assert noise.found == "bounded from one recording"
    assert noise.sigma_range[0] < 0.005 < noise.sigma_range[1]  # stated by those who digitised it


def test_swings_of_a_pendulum(data: Path, tmp_path: Path) -> None:
    text = f"""[csv]
rename = {{ theta = "angle [rad]", omega = "rate [rad/s]" }}
[[recording]]
name = "segment 3"
files = ["{data}/pendulum_multiarm/single_pendulum.csv.gz"]
rows = [{{ seg = 3 }}]
"""
    case_of = read_case(case(tmp_path, text), CHANNELS)
    (repeat,) = case_of.recordings[0].repeats
    assert repeat.series["angle"].times[0] == 0.0
    assert any("the start of the experiment is unknown" in note for note in repeat.notes)
    assert not repeat.series["angle"].clipped.any()
    noise = measurement_noise(case_of.recordings, "angle", Known())
    assert noise.sigma < 0.01  # an encoder
