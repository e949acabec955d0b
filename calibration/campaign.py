"""The runs of a calibration: which parameters, under which conditions, on which seeds.

First the parameters are spread over their ranges (Sobol); a part of them runs twice, on another
packing. Then they are drawn, in rounds, from what the runs so far leave possible: where the fit
trusts a doubtful emulator, the next runs go. Last, the posterior is run itself: under the
conditions of the fitted recordings to verify the emulators, under those of the others to predict
them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import count

import numpy as np
from scipy.stats import qmc

from calibration.likelihood import Likelihood, likelihood
from calibration.observed import Observed
from calibration.posterior import LIVE, Posterior, prior_transform, sample, to_unit
from calibration.recordings.case import Case
from calibration.recordings.records import Noise
from calibration.runs import (
    Evaluate,
    Predicted,
    See,
    candidates,
    check_times,
    finished,
    flaw,
    predicted,
    predictions_of_each,
    recording_with_runs,
    seeing,
)
from mfopt.arrays import Array
from mfopt.errors import ConfigError, SimulationError
from mfopt.records.evaluation import Candidate, Evaluation
from surrogates.series import SeriesEmulator, fit_series

FIRST = 0.5  # of the runs that the emulators learn from are spread over the ranges
ROUNDS = 5  # in which the others are drawn from what the runs so far leave possible
REPLICATED = 0.2  # of the parameters run twice
FEWEST = 16  # runs that an emulator needs, before the posterior is run
# Runs of an emulator. 1000 take a quarter of an hour to learn from on one core; ten times as many
# would take a week and 30 GB.
MOST = 1000
WIDER = 1.5  # times as wide as the posterior are the later parameters drawn
ROUGH = 40  # points of the sampler that decides where the later runs are


@dataclass(frozen=True, slots=True, eq=False)
class Fitted:
    """What the runs say of the parameters."""

    observations: tuple[Observed, ...]  # of the fitted recordings
    emulators: tuple[SeriesEmulator, ...]
    likelihood: Likelihood
    posterior: Posterior


@dataclass(frozen=True, slots=True, eq=False)
class Campaign:
    """A whole calibration."""

    fitted: Fitted
    misfit: float  # of runs of the posterior: chi-squared
    freedom: int  # its degrees of freedom
    predicted: tuple[Predicted, ...]
    evaluations: tuple[Evaluation, ...]

    @property
    def fresh(self) -> list[Evaluation]:
        """The runs of the posterior, which no emulator saw."""
        return [e for e in self.evaluations if e.candidate.purpose == "predict"]


def calibrate(
    case: Case,
    noises: Mapping[str, Noise],
    evaluate: Evaluate,
    runs: int,
) -> Campaign:
    """Fit the parameters of a case.

    Args:
        case: with at least one recording that is fitted.
        noises: measurement noise by channel.
        evaluate: makes runs, in the order given; the level is the name of the recording.
        runs: to be made in all.

    Raises:
        ConfigError: if the runs are too few or too many, or recording and simulation have no time
            in common.
        SimulationError: if most runs of a recording fail, or no parameter changes anything.
    """
    each = runs_of_each(case, runs)
    spread = round(FIRST * each)
    planned, see = _spread(case, spread), seeing(case, noises)
    made = list(evaluate(planned[: len(case.fitted)]))  # one run of each recording
    for recording in case.fitted:
        fine = [e for e in made if e.candidate.level == recording.name]
        check_times(recording, [e for e in fine if flaw(e, recording) is None])
    made += evaluate(planned[len(case.fitted) :])
    for number in range(ROUNDS):
        so_far = fit(case, see, made, live=ROUGH)
        not_ruled_out = sample(
            so_far.likelihood.ruled_out, case.parameters, seed=case.seed, live=ROUGH
        )
        two = (so_far.posterior, not_ruled_out)
        new = (each - len(made) // len(case.fitted)) // (ROUNDS - number)
        made += evaluate(_refined(case, two, number, new, len(made)))
    fitted = fit(case, see, made, around=so_far.posterior.box)
    z = to_unit(case.parameters, fitted.posterior.draws)
    beside, last = predicted(case, see, evaluate, z, predictions_of_each(case, runs), len(made))
    misfit, freedom = misfit_of(fitted.likelihood, fitted, case, last)
    return Campaign(fitted, misfit, freedom, beside, (*made, *last))


def runs_of_each(case: Case, runs: int) -> int:
    """Runs from which the emulator of each fitted recording learns.

    Raises:
        ConfigError: if there are too few, or too many to learn from.
    """
    if not case.fitted:
        raise ConfigError("all recordings are held out; fit at least one")
    each = _learned_from(case, runs)
    if each < FEWEST:
        least = next(n for n in count(runs + 1) if _learned_from(case, n) >= FEWEST)
        raise ConfigError(
            f"{runs} runs are too few for {_fitted(case)} and "
            f"{len(case.held_out)} held out; give at least {least}"
        )
    if each > MOST:
        most = MOST * len(case.fitted) + predictions_of_each(case, runs) * len(case.recordings)
        raise ConfigError(
            f"{runs} runs are too many for {_fitted(case)}: an emulator "
            f"learns from at most {MOST} runs, because the time grows with their cube; give at "
            f"most {most}"
        )
    return each


def _fitted(case: Case) -> str:
    """How many recordings are fitted, in words."""
    return f"{len(case.fitted)} fitted recording{'s' * (len(case.fitted) > 1)}"


def _learned_from(case: Case, runs: int) -> int:
    """Runs of each fitted recording beside those that predict."""
    return (runs - predictions_of_each(case, runs) * len(case.recordings)) // len(case.fitted)


def fit(
    case: Case,
    see: See,
    made: Sequence[Evaluation],
    live: int = LIVE,
    around: Array | None = None,
) -> Fitted:
    """Emulators, likelihood and posterior from the runs made so far.

    Args:
        case: with the recordings.
        see: puts a recording in a row.
        made: the runs.
        live: points of the sampler.
        around: box of a posterior of fewer runs, around which the later runs are.
    """
    beside = [recording_with_runs(recording, made, see) for recording in case.fitted]
    if not any(np.ptp(rows, axis=0).any() for _, _, rows in beside):
        raise SimulationError(
            f"all {len(made)} runs give the same values, whatever "
            f"{' and '.join(p.name for p in case.parameters)}; let the simulation use them"
        )
    observations, emulators = [], []
    for seen, x, rows in beside:
        observations.append(seen)
        blocks = [block.size for block in seen.blocks]
        emulators.append(fit_series(to_unit(case.parameters, x), rows, blocks))
    likely = likelihood(observations, emulators)
    posterior = sample(likely, case.parameters, seed=case.seed, live=live, around=around)
    return Fitted(tuple(observations), tuple(emulators), likely, posterior)


def misfit_of(
    likely: Likelihood, fitted: Fitted, case: Case, made: Sequence[Evaluation]
) -> tuple[float, int]:
    """Chi-squared of the fitted recordings against runs of the posterior, and its freedom."""
    rows = [
        np.array([seen.row(e.outcome.raw) for e in finished(made, recording)])
        for recording, seen in zip(case.fitted, fitted.observations, strict=True)
    ]
    misfit, scores = likely.misfit(rows)
    return misfit, max(1, scores - len(case.parameters))


def _spread(case: Case, each: int) -> list[Candidate]:
    """Parameters spread over their ranges, for every fitted recording."""
    transform = prior_transform(case.parameters)
    new = max(1, round(each / (1.0 + REPLICATED)))
    points = []
    for number, recording in enumerate(case.fitted):
        sobol = qmc.Sobol(len(case.parameters), rng=np.random.default_rng([case.seed, number]))
        cube = sobol.random(1 << (new - 1).bit_length())[:new]
        z = np.array([transform(u) for u in cube])
        z = np.vstack([z, z[: each - new]])
        points.append((recording, z))
    return candidates(case.parameters, points, 0, "design")


def _refined(
    case: Case, drawn: Sequence[Posterior], round_number: int, each: int, first: int
) -> list[Candidate]:
    """Parameters drawn around each of these in equal parts, somewhat wider."""
    wide = []
    for its in drawn:
        z = to_unit(case.parameters, its.draws)
        wide.append(np.clip(z.mean(axis=0) + WIDER * (z - z.mean(axis=0)), 0.0, 1.0))
    z = np.concatenate(wide)
    points = []
    new = max(1, round(each / (1.0 + REPLICATED)))
    for number, recording in enumerate(case.fitted):
        rng = np.random.default_rng([case.seed, 1000 + number, round_number])
        chosen = z[rng.integers(0, len(z), new)]
        points.append((recording, np.vstack([chosen, chosen[: each - new]])))
    return candidates(case.parameters, points, first, "refine")
