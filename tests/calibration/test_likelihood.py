"""The posterior of a linear simulator with Gaussian errors has a closed form."""

from dataclasses import replace

import numpy as np
import pytest
from test_calibrate import PARAMETERS, campaign_of, case_of

from calibration.likelihood import likelihood
from calibration.parts import EVERY_PART, without
from calibration.posterior import Posterior, from_unit, prior_transform, sample, to_unit
from calibration.recordings.case import Known, Measurement, Parameter
from mfopt.arrays import Array, frozen
from mfopt.errors import ConfigError


def test_nested_sampling_finds_a_gaussian_posterior_and_its_evidence() -> None:
    mean, sd = np.array([0.4, 0.6]), np.array([0.03, 0.08])

    def log_likelihood(z: Array) -> float:
        return float(-0.5 * np.sum(((z - mean) / sd) ** 2))

    flat = [Parameter("a", 0.0, 1.0), Parameter("b", 0.0, 1.0)]
    found = sample(log_likelihood, flat, seed=1)
    assert found.mean == pytest.approx(mean, abs=0.01)
    assert found.draws.std(axis=0) == pytest.approx(sd, rel=0.12)
    evidence = np.log(2 * np.pi * np.prod(sd))
    assert found.log_evidence == pytest.approx(evidence, abs=4.0 * found.log_evidence_sd)


def test_a_peak_behind_a_moat_is_found_from_a_box_around_it() -> None:
    # As an emulator with many runs near (0.4, 0.6): sure of itself there, in doubt elsewhere.
    mean, sd, top = np.array([0.4, 0.6]), 1e-3, 40.0

    def log_likelihood(z: Array) -> float:
        away = float(np.max(np.abs(z - mean)))
        inside = top - 0.5 * float(np.sum(((z - mean) / sd) ** 2))
        return max(inside, -1000.0 - away) if away < 0.1 else -away

    flat = [Parameter("a", 0.0, 1.0), Parameter("b", 0.0, 1.0)]
    box = np.array([[0.36, 0.56], [0.44, 0.64]])
    found = sample(log_likelihood, flat, seed=1, around=box)
    assert found.mean == pytest.approx(mean, abs=4e-4)
    assert found.draws.std(axis=0) == pytest.approx([sd, sd], rel=0.15)
    evidence = top + np.log(2.0 * np.pi * sd**2)
    assert found.log_evidence == pytest.approx(evidence, abs=4.0 * found.log_evidence_sd)
    assert np.all((box[0] < found.box[0]) & (found.box[1] < box[1]))


def test_a_box_beside_the_peak_changes_nothing() -> None:
    mean, sd = np.array([0.4, 0.6]), np.array([0.03, 0.08])
    its = [Parameter("a", 0.0, 1.0), Parameter("b", 0.0, 1.0, mean=0.5, sd=0.2)]
    far = np.array([[0.7, 0.1], [0.9, 0.2]])
    plain, mixed = (
        sample(lambda z: float(-0.5 * np.sum(((z - mean) / sd) ** 2)), its, seed=2, around=around)
        for around in (None, far)
    )
    assert mixed.mean == pytest.approx(plain.mean, abs=0.012)
    assert mixed.draws.std(axis=0) == pytest.approx(plain.draws.std(axis=0), rel=0.15)
    assert mixed.log_evidence == pytest.approx(
        plain.log_evidence, abs=4.0 * np.hypot(plain.log_evidence_sd, mixed.log_evidence_sd)
    )


def test_a_normal_prior_is_cut_at_the_range() -> None:
    transform = prior_transform([Parameter("a", 0.0, 2.0, mean=0.2, sd=0.5)])
    draws = np.array([transform(u) for u in np.random.default_rng(1).random((4000, 1))])
    assert 0.0 <= draws.min() <= draws.max() <= 1.0
    assert np.median(draws) > 0.1  # the part below 0 is missing


def test_units_are_inverse() -> None:
    x = np.array([[0.2, 0.01], [0.6, 0.1]])
    assert from_unit(PARAMETERS, to_unit(PARAMETERS, x)) == pytest.approx(x)


def test_errors_are_left_out_by_name() -> None:
    assert without("clock") == replace(EVERY_PART, clock=False)
    with pytest.raises(ConfigError, match="'clok'; choose from packing"):
        without("clok")


def test_a_logarithmic_parameter_is_spread_by_its_logarithm() -> None:
    its = [Parameter("e", 1e5, 1e7, log=True), Parameter("a", 0.0, 2.0)]
    x = from_unit(its, np.array([[0.5, 0.5], [1.0, 0.25]]))
    assert x == pytest.approx(np.array([[1e6, 1.0], [1e7, 0.5]]))
    assert to_unit(its, x) == pytest.approx(np.array([[0.5, 0.5], [1.0, 0.25]]))
    median = prior_transform([replace(its[0], mean=1e6, sd=3e5)])(np.array([0.5]))
    assert median == pytest.approx([0.5])


def test_a_parameter_of_one_value_correlates_with_nothing() -> None:
    draws = np.column_stack([np.linspace(0.0, 1.0, 50), np.full(50, 0.3)])
    flat = (Parameter("a", 0.0, 1.0), Parameter("b", 0.0, 1.0))
    found = Posterior(flat, draws, draws[0], 0.0, 0.1, 1, np.zeros((2, 2))).correlation
    assert found == pytest.approx(np.eye(2))


def test_many_parameters_get_enough_points_for_the_sampler() -> None:
    # dynesty warns of 40 points in 25 dimensions, and warnings are errors here.
    many = tuple(Parameter(f"p{i}", 0.0, 1.0) for i in range(25))
    found = sample(lambda z: -float(z[0]), many, seed=1, live=40)
    assert found.draws.shape[1] == 25
    assert np.all(np.abs(found.mean[1:] - 0.5) < 0.3)


def test_the_directions_that_are_looked_at_do_not_know_the_noise_of_the_recording() -> None:
    # A scale error is the recorded series times a factor; as a direction it would hold its noise.
    campaign = campaign_of(
        case_of(frozen([0.35, 0.03]), 1, Measurement(channels={"level": Known(scale=0.01)}))
    )
    fitted = campaign.fitted
    other = [
        replace(seen, values=noisy, constant=seen.constant * (noisy / seen.values)[:, None])
        for seen in fitted.observations
        for noisy in [seen.values * np.random.default_rng(1).normal(1.0, 0.1, len(seen.values))]
    ]
    for one, two in zip(
        fitted.likelihood.groups, likelihood(other, fitted.emulators).groups, strict=True
    ):
        assert np.array_equal(one.basis, two.basis)


def test_places_that_are_in_doubt_are_not_ruled_out() -> None:
    fitted = campaign_of(case_of(frozen([0.35, 0.03]), 1)).fitted
    near, far = to_unit(PARAMETERS, np.array([[0.35, 0.03], [0.2, 0.09]]))
    assert fitted.likelihood.ruled_out(near) > -1.0
    assert fitted.likelihood.ruled_out(far) < -10.0
    doubtful = replace(
        fitted.likelihood,
        groups=tuple(replace(g, fixed=g.fixed + 1e6 * np.eye(len(g.fixed)))
                     for g in fitted.likelihood.groups),
    )  # fmt: skip
    assert doubtful.ruled_out(far) > -1.0


def test_an_interruption_passes_the_sampler_in_silence(capsys: pytest.CaptureFixture[str]) -> None:
    def interrupted(z: Array) -> float:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        sample(interrupted, [Parameter("a", 0.0, 1.0)], seed=1)
    assert capsys.readouterr() == ("", "")
