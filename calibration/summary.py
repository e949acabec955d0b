"""What a calibration found, as numbers for reports and JSON."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.stats import chi2

from calibration.campaign import Campaign, Fitted
from calibration.durations import unlike_durations
from calibration.emulator_check import check_emulators
from calibration.missed import missed
from calibration.observed import Observed
from calibration.offsets import offsets
from calibration.posterior import LEVEL, Posterior, prior_transform, to_unit
from calibration.recordings.case import Case
from calibration.recordings.notes import notes_by_files
from calibration.recordings.records import Noise, Recording
from calibration.repeat_scatter import scatter_not_explained
from calibration.runs import Predicted
from calibration.words import (
    DETERMINED,
    MISFIT,
    check_in_words,
    combinations,
    further,
    in_words,
    trade_offs,
    warnings,
)
from mfopt.arrays import Array
from mfopt.records.calibration import (
    Advice,
    Compared,
    Direction,
    Edge,
    EmulatorCheck,
    Found,
    LeftOut,
    Measured,
    Recorded,
    Summary,
)
from mfopt.records.evaluation import Evaluation
from mfopt.records.problem import Problem
from mfopt.records.rig import TIME, Channel

FIT_COUNTS = 10  # runs, as which the scatter of the fitted recordings counts
PRIOR_DRAWS = 4000
NEIGHBOURS = 0.04  # of the points: 1 sd of the weights with which variances are averaged
DRAWS = 500  # of the posterior that the summary keeps
CUT = 0.5  # of the time that recording and most runs last: below, much is not compared
EDGE = 0.05  # of a range: most draws so near to a bound are at the edge
EVENLY = 0.05 / 0.9  # of the interval, from its end to a bound, where draws are even up to there


def summary(
    campaign: Campaign,
    case: Case,
    problem: Problem,
    noises: Mapping[str, Noise],
    channels: Mapping[str, Channel],
    advice: tuple[Advice, ...] = (),
    without: tuple[LeftOut, ...] = (),
    doubts: Sequence[str] = (),
    *,
    possible: bool = True,
) -> Summary:
    """Sum up a calibration.

    Args:
        campaign: its runs and its fit.
        case: with the recordings.
        problem: with the parameters.
        noises: measurement noise by channel.
        channels: of the rig.
        advice: which further recording would tell most.
        without: fits without single errors.
        doubts: why simulations may be wrong.
        possible: whether there are further experiments that `--advise` can choose from.
    """
    fitted = campaign.fitted
    posterior, outcomes = fitted.posterior, [e.outcome for e in campaign.evaluations]
    prior = _prior_draws(case)
    probability = float(chi2.sf(campaign.misfit, campaign.freedom))
    fits = probability >= MISFIT
    beyond = [
        *scatter_not_explained(case, noises, channels, fitted.observations, fitted.emulators),
        *doubts,
        *_of_times(case, campaign.evaluations),
    ]
    beside = tuple(c for p in campaign.predicted for c in compared(p, _scatter(fitted), channels))
    made = Summary(
        name=case.name,
        parameters=_found(posterior, problem, prior, fits=fits),
        directions=_directions(posterior, prior),
        combinations=[],
        trade_offs=[],
        correlation=posterior.correlation.tolist(),
        draws=posterior.draws[:DRAWS].tolist(),
        log_evidence=posterior.log_evidence,
        misfit=campaign.misfit,
        freedom=campaign.freedom,
        probability=probability,
        fits=fits,
        recordings=tuple(map(_recorded, case.recordings)),
        compared=beside,
        noise=tuple(_measured(noise, channels[name].unit) for name, noise in noises.items()),
        runs=len(outcomes),
        failed=sum(not outcome.finished for outcome in outcomes),
        cpu_s=sum(outcome.cpu_s for outcome in outcomes),
        emulators=_checked(campaign, case),
        without=without,
        advice=advice,
        further=[],
        warnings=[],
        check=[],
        words=[],
        notes=tuple(notes_by_files(case.recordings)),
        offsets=offsets(fitted, case, channels),
    )
    made = replace(
        made,
        combinations=combinations(made),
        trade_offs=trade_offs(made),
        further=further(made, possible=possible),
        warnings=[*missed(campaign, case, problem), *warnings(made), *beyond],
        check=check_in_words(made),
    )
    return replace(made, words=in_words(made))


def _checked(its: Campaign, case: Case) -> tuple[EmulatorCheck, ...]:
    return check_emulators(case, its.fitted.observations, its.fitted.emulators, its.fresh)


def _of_times(case: Case, made: Sequence[Evaluation]) -> list[str]:
    return [*cut_short(case, made), *unlike_durations(case.recordings, made)]


def cut_short(case: Case, made: Sequence[Evaluation]) -> list[str]:
    """Fitted recordings of which little is compared, because one run ends long before others."""
    lines = []
    for recording in case.fitted:
        runs = [e.outcome.raw for e in made if e.candidate.level == recording.name]
        ends = [float(raw[TIME][-1]) for raw in runs if TIME in raw]
        last = [float(s.times[-1]) for r in recording.repeats for s in r.series.values()]
        if not ends or not last:
            continue
        first, usual = min(ends), min(float(np.median(ends)), *last)
        if first < CUT * usual:
            lines.append(
                f"{recording.name} is compared until {first:.3g} s only, because a run ends there; "
                f"the recording and most runs last {usual:.3g} s. Let every run last as long"
            )
    return lines


def _recorded(its: Recording) -> Recorded:
    series = [s for repeat in its.repeats for s in repeat.series.values()]
    samples = {
        channel: sum(len(s.times) for s in series if s.channel == channel)
        for channel in its.channels
    } | {name: sum(name in repeat.scalars for repeat in its.repeats) for name in its.scalars}
    duration = max((float(s.times[-1]) for s in series), default=0.0)
    return Recorded(its.name, its.held_out, its.conditions, len(its.repeats), duration, samples)


def _measured(its: Noise, unit: str) -> Measured:
    return Measured(
        its.channel, unit, its.sigma, its.sigma_range, its.autocorrelation_time, its.found
    )


def _prior_draws(case: Case) -> Array:
    """Draws (n, d) of the prior in the unit cube."""
    transform = prior_transform(case.parameters)
    cube = np.random.default_rng(case.seed).random((PRIOR_DRAWS, len(case.parameters)))
    return np.array([transform(u) for u in cube])


def _found(
    posterior: Posterior, problem: Problem, prior: Array, *, fits: bool
) -> tuple[Found, ...]:
    tail = (1.0 - LEVEL) / 2.0
    before = np.diff(np.quantile(prior, [tail, 1.0 - tail], axis=0), axis=0)[0]
    found = []
    z = to_unit(posterior.parameters, posterior.draws)
    after = np.diff(to_unit(posterior.parameters, posterior.interval().T), axis=0)[0]
    for i, (variable, (low, high)) in enumerate(
        zip(problem.variables, posterior.interval(), strict=True)
    ):
        share, edge = float(after[i] / before[i]), edge_of(z[:, i])
        found.append(
            Found(
                variable.name,
                variable.unit,
                variable.lower,
                variable.upper,
                float(posterior.best[i]),
                float(posterior.mean[i]),
                (float(low), float(high)),
                share,
                share < DETERMINED and (fits or edge is None),
                posterior.parameters[i].asked,
                posterior.parameters[i].log,
                edge,
            )
        )
    return tuple(found)


def edge_of(z: Array) -> Edge | None:
    """The end of the range at which draws (n,) in the unit cube pile up, if there is one.

    Most are near it, and the bound cuts them off: they are no rarer there than elsewhere.
    """
    low, high = np.quantile(z, [(1.0 - LEVEL) / 2.0, (1.0 + LEVEL) / 2.0])
    if np.median(z) < EDGE and low <= EVENLY * (high - low):
        return "lower"
    if np.median(z) > 1.0 - EDGE and 1.0 - high <= EVENLY * (high - low):
        return "upper"
    return None


def _directions(posterior: Posterior, prior: Array) -> tuple[Direction, ...]:
    """Principal directions of the posterior in standard deviations of the prior."""
    spread = prior.std(axis=0)
    z = to_unit(posterior.parameters, posterior.draws) / spread
    values, vectors = np.linalg.eigh(np.atleast_2d(np.cov(z.T)))
    names = [p.name for p in posterior.parameters]
    return tuple(
        Direction(
            {n: float(w) for n, w in zip(names, vector, strict=True)}, float(np.sqrt(max(v, 0.0)))
        )
        for v, vector in zip(values, vectors.T, strict=True)
    )


def _scatter(fitted: Fitted) -> dict[str, float]:
    """Mean variance of one run by channel, over the fitted recordings."""
    found: dict[str, list[float]] = {}
    for seen, emulator in zip(fitted.observations, fitted.emulators, strict=True):
        for channel, sd in seen.split(emulator.scatter()).items():
            found.setdefault(channel, []).append(float(np.mean(sd**2)))
    return {channel: float(np.mean(each)) for channel, each in found.items()}


def _variance(rows: Array, other: float | None) -> Array:
    """Variance (p,) of one run: few runs say little of it, so that of the fit counts as well.

    At single points a few runs meet by chance: the variance is a mean over neighbours.
    """
    own = rows.var(axis=0, ddof=1)
    own = gaussian_filter1d(own, NEIGHBOURS * len(own), mode="nearest")
    if other is None or not own.mean() > 0.0:
        return np.asarray(own)
    freedom = len(rows) - 1
    pooled = (freedom * own.mean() + FIT_COUNTS * other) / (freedom + FIT_COUNTS)
    return np.asarray(own * pooled / own.mean())


def _clock(seen: Observed, mean: Array) -> Array:
    """Variance (p,) from the errors of start and clock: slope times the error of the time."""
    slopes = [
        np.zeros(1) if block.times is None else np.gradient(row, block.times)
        for block, row in zip(seen.blocks, seen.split(mean).values(), strict=True)
    ]
    return np.concatenate(slopes) ** 2 * (seen.start_sd**2 + (seen.clock_error * seen.times) ** 2)


def compared(
    its: Predicted, scatter: Mapping[str, float], known: Mapping[str, Channel]
) -> list[Compared]:
    """The channels of a recording beside its runs; `scatter` is the variance of one by channel."""
    seen, n = its.observation, len(its.runs)
    mean = its.runs.mean(axis=0)
    channels = seen.split(its.runs)
    variance = np.concatenate(
        [_variance(channels[b.channel], scatter.get(b.channel)) for b in seen.blocks]
    )
    measured = np.diag(seen.measured) + np.sum(seen.constant**2, axis=1) + _clock(seen, mean)
    expected = variance * (1.0 / seen.repeats + 1.0 / n) + measured
    parts = {
        "recorded": seen.values, "mean": mean, "expected": expected,
        "low": mean - 1.645 * np.sqrt(variance), "high": mean + 1.645 * np.sqrt(variance),
    }  # fmt: skip
    by_channel = {name: seen.split(row) for name, row in parts.items()}
    made = []
    for block in seen.blocks:
        of = {name: rows[block.channel] for name, rows in by_channel.items()}
        error = np.sqrt(np.mean((of["recorded"] - of["mean"]) ** 2) / np.mean(of["expected"]))
        made.append(
            Compared(
                seen.name,
                its.held_out,
                block.channel,
                known[block.channel].unit,
                None if block.times is None else block.times.tolist(),
                of["recorded"].tolist(),
                of["mean"].tolist(),
                of["low"].tolist(),
                of["high"].tolist(),
                np.sqrt(of["expected"]).tolist(),
                float(error),
            )
        )
    return made
