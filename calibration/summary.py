"""What a calibration found, as numbers for reports and JSON, and in words."""

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from scipy.stats import chi2

from calibration.campaign import Campaign, Fitted
from calibration.observed import Observed
from calibration.posterior import LEVEL, Posterior, prior_transform, to_unit
from calibration.recordings.case import Case
from calibration.recordings.records import Noise, Recording
from calibration.runs import Predicted
from mfopt.arrays import Array
from mfopt.records.calibration import (
    Advice,
    Compared,
    Direction,
    Found,
    Measured,
    Recorded,
    Summary,
)
from mfopt.records.problem import Problem
from mfopt.records.rig import Channel

DETERMINED = 0.5  # of the prior's interval: a narrower posterior says something
WELL_DETERMINED = 0.25  # of the prior's standard deviation, of a combination
NAMED = 0.2  # of the largest weight: smaller ones are left out of a combination's name
MISFIT = 0.01  # probability of a larger misfit, below which a fit is doubtful
FIT_COUNTS = 10  # runs, as which the scatter of the fitted recordings counts
PRIOR_DRAWS = 4000
DRAWS = 500  # of the posterior that the summary keeps
HARDLY = 0.85  # of an interval: a recording that leaves more tells hardly anything


def summary(
    campaign: Campaign,
    case: Case,
    problem: Problem,
    noises: Mapping[str, Noise],
    channels: Mapping[str, Channel],
    advice: tuple[Advice, ...] = (),
) -> Summary:
    """Sum up a calibration."""
    fitted = campaign.fitted
    posterior, outcomes = fitted.posterior, [e.outcome for e in campaign.evaluations]
    prior = _prior_draws(case)
    probability = float(chi2.sf(fitted.misfit, fitted.freedom))
    made = Summary(
        name=case.name,
        parameters=_found(posterior, problem, prior),
        directions=_directions(posterior, prior),
        combinations=[],
        correlation=posterior.correlation.tolist(),
        draws=posterior.draws[:DRAWS].tolist(),
        log_evidence=posterior.log_evidence,
        misfit=fitted.misfit,
        freedom=fitted.freedom,
        probability=probability,
        fits=probability >= MISFIT,
        recordings=tuple(map(_recorded, case.recordings)),
        compared=tuple(
            c for p in campaign.predicted for c in compared(p, _scatter(fitted), channels)
        ),
        noise=tuple(_measured(noise, channels[name].unit) for name, noise in noises.items()),
        runs=len(outcomes),
        failed=sum(not outcome.finished for outcome in outcomes),
        cpu_s=sum(outcome.cpu_s for outcome in outcomes),
        advice=advice,
        words=[],
    )
    made = replace(made, combinations=_combinations(made))
    return replace(made, words=in_words(made))


def _recorded(its: Recording) -> Recorded:
    notes = tuple(
        f"{repeat.file}: {note}" if repeat.file else note
        for repeat in its.repeats
        for note in repeat.notes
    )
    return Recorded(its.name, its.held_out, its.conditions, len(its.repeats), notes)


def _measured(its: Noise, unit: str) -> Measured:
    return Measured(
        its.channel, unit, its.sigma, its.sigma_range, its.autocorrelation_time, its.found
    )


def _prior_draws(case: Case) -> Array:
    """Draws (n, d) of the prior in the unit cube."""
    transform = prior_transform(case.parameters)
    cube = np.random.default_rng(case.seed).random((PRIOR_DRAWS, len(case.parameters)))
    return np.array([transform(u) for u in cube])


def _found(posterior: Posterior, problem: Problem, prior: Array) -> tuple[Found, ...]:
    tail = (1.0 - LEVEL) / 2.0
    before = np.diff(np.quantile(prior, [tail, 1.0 - tail], axis=0), axis=0)[0]
    found = []
    after = np.diff(to_unit(posterior.parameters, posterior.interval().T), axis=0)[0]
    for i, (variable, (low, high)) in enumerate(
        zip(problem.variables, posterior.interval(), strict=True)
    ):
        share = float(after[i] / before[i])
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
                share < DETERMINED,
                posterior.parameters[i].asked,
                posterior.parameters[i].log,
            )
        )
    return tuple(found)


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
    """Variance (p,) of one run: few runs say little of it, so that of the fit counts as well."""
    own = rows.var(axis=0, ddof=1)
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


def in_words(its: Summary) -> list[str]:
    """What an engineer wants to know, one sentence a line."""
    lines = []
    for p in its.parameters:
        unit = "" if p.unit == "-" else f" {p.unit}"
        mean, low, high = (f"{v:.{_digits(p.interval)}g}" for v in (p.mean, *p.interval))
        said = f"{p.name} = {mean}{unit}, 90 % from {low} to {high}"
        if not p.asked:
            said = f"{said} (left free, for it is not known exactly)"
        elif not p.determined:
            said = f"{said}: not determined by these recordings"
        lines.append(said)
    lines += its.combinations
    lines += _next(its)
    if not its.fits:
        lines.append(
            f"The simulation does not fit: a misfit of {its.misfit:.0f} on {its.freedom} degrees "
            f"of freedom has probability {its.probability:.1g}. The values above are those of a "
            "wrong model."
        )
    lines += [error_in_words(c) for c in its.compared]
    lines.append(f"{its.runs} simulations, {its.failed} failed, {its.cpu_s:.0f} s of CPU")
    return lines


def _digits(interval: tuple[float, float]) -> int:
    """Significant digits, at least 3, with which the width of an interval shows two."""
    low, high = interval
    size = max(abs(low), abs(high))
    if not high > low:
        return 3
    return max(3, 2 + math.floor(math.log10(size)) - math.floor(math.log10(high - low)))


def _next(its: Summary) -> list[str]:
    """Which further recording would narrow what is not determined."""
    open_ones = [p.name for p in its.parameters if p.asked and not p.determined]
    if not open_ones:
        return []
    if not its.advice:
        return ["Which further recording would determine them: mfopt calibrate with --advise"]
    lines = []
    for name in open_ones:
        best = min(its.advice, key=lambda a: a.narrower[name])
        if best.narrower[name] > HARDLY:
            lines.append(f"None of the {len(its.advice)} further recordings tells {name} better")
        else:
            lines.append(
                f"To determine {name}, record next: {best.name}; its interval would shrink to "
                f"{100 * best.narrower[name]:.0f} %"
            )
    return lines


def error_in_words(its: Compared) -> str:
    """How far simulations are from a recording."""
    kind = "held out" if its.held_out else "fitted"
    rms = float(np.sqrt(np.mean(np.subtract(its.recorded, its.simulated) ** 2)))
    unit = "" if its.unit == "-" else f" {its.unit}"
    return (
        f"{its.recording}, {its.channel} ({kind}): error {rms:.2g}{unit} rms, {its.error:.2f} "
        "times what noise, scatter of runs and stated errors explain"
    )


def _combinations(its: Summary) -> list[str]:
    """Combinations that are known much better, or hardly at all, than single parameters say."""
    if all(p.determined for p in its.parameters if p.asked) or len(its.parameters) < 2:
        return []
    lines = []
    for direction in its.directions:
        largest = max(abs(w) for w in direction.weights.values())
        its_names = {n: w for n, w in direction.weights.items() if abs(w) >= NAMED * largest}
        if len(its_names) < 2:
            continue
        sign = 1.0 if max(its_names.values(), key=abs) > 0 else -1.0
        name = " ".join(f"{'+' if sign * w > 0 else '-'} {n}" for n, w in its_names.items())
        name = name.removeprefix("+ ")
        if direction.ratio < WELL_DETERMINED:
            lines.append(f"Determined together: {name}")
        elif direction.ratio > DETERMINED:
            lines.append(f"Not determined together: {name} can change without a visible difference")
    return lines
