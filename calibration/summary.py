"""What a calibration found, as numbers for reports and JSON, and in words."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from scipy.stats import chi2

from calibration.campaign import Campaign, Fitted
from calibration.posterior import LEVEL, Posterior, prior_transform, to_unit
from calibration.recordings.case import Case
from calibration.recordings.records import Noise
from calibration.runs import Predicted
from mfopt.arrays import Array
from mfopt.records.problem import Problem

DETERMINED = 0.5  # of the prior's interval: a narrower posterior says something
WELL_DETERMINED = 0.25  # of the prior's standard deviation, of a combination
NAMED = 0.2  # of the largest weight: smaller ones are left out of a combination's name
MISFIT = 0.01  # probability of a larger misfit, below which a fit is doubtful
FIT_COUNTS = 10  # runs, as which the scatter of the fitted recordings counts
PRIOR_DRAWS = 4000


@dataclass(frozen=True, slots=True)
class Found:
    """One parameter."""

    name: str
    unit: str
    low: float  # of the range
    high: float
    best: float
    mean: float
    interval: tuple[float, float]  # 90 %
    share: float  # width of the interval over that of the prior
    determined: bool
    asked: bool  # False: left free because nobody knows it exactly


@dataclass(frozen=True, slots=True)
class Direction:
    """A combination of parameters, by how much the recordings narrow it."""

    weights: Mapping[str, float]  # by parameter, in standard deviations of the prior
    ratio: float  # standard deviation of the posterior over that of the prior


@dataclass(frozen=True, slots=True)
class Compared:
    """A channel of a recording beside the simulations of the posterior."""

    recording: str
    held_out: bool
    channel: str
    times: list[float] | None  # [s]; None for a number
    recorded: list[float]
    simulated: list[float]  # mean
    low: list[float]  # 90 % of single runs
    high: list[float]
    error: float  # rms of recorded less simulated, over what noise and packing explain


@dataclass(frozen=True, slots=True)
class Summary:
    """A whole calibration."""

    name: str
    parameters: tuple[Found, ...]
    directions: tuple[Direction, ...]  # the best determined first
    correlation: list[list[float]]
    log_evidence: float
    misfit: float
    freedom: int
    probability: float  # of a larger misfit if the model is right
    compared: tuple[Compared, ...]
    noise: Mapping[str, Mapping[str, Any]]
    runs: int
    failed: int
    cpu_s: float


def summary(
    campaign: Campaign, case: Case, problem: Problem, noises: Mapping[str, Noise]
) -> Summary:
    """Sum up a calibration."""
    fitted = campaign.fitted
    posterior, outcomes = fitted.posterior, [e.outcome for e in campaign.evaluations]
    prior = _prior_draws(case)
    return Summary(
        name=case.name,
        parameters=_found(posterior, problem, prior),
        directions=_directions(posterior, prior),
        correlation=np.corrcoef(to_unit(case.parameters, posterior.draws).T)
        .reshape(problem.dimension, -1)
        .tolist(),
        log_evidence=posterior.log_evidence,
        misfit=fitted.misfit,
        freedom=fitted.freedom,
        probability=float(chi2.sf(fitted.misfit, fitted.freedom)),
        compared=tuple(c for p in campaign.predicted for c in compared(p, _scatter(fitted))),
        noise={name: asdict(noise) for name, noise in noises.items()},
        runs=len(outcomes),
        failed=sum(not outcome.finished for outcome in outcomes),
        cpu_s=sum(outcome.cpu_s for outcome in outcomes),
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


def compared(its: Predicted, scatter: Mapping[str, float]) -> list[Compared]:
    """The channels of a recording beside its runs; `scatter` is the variance of one by channel."""
    seen, n = its.observation, len(its.runs)
    mean = its.runs.mean(axis=0)
    channels = seen.split(its.runs)
    variance = np.concatenate(
        [_variance(channels[b.channel], scatter.get(b.channel)) for b in seen.blocks]
    )
    known = np.diag(seen.measured) + np.sum(seen.constant**2, axis=1)
    expected = variance * (1.0 / seen.repeats + 1.0 / n) + known
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
                None if block.times is None else block.times.tolist(),
                of["recorded"].tolist(),
                of["mean"].tolist(),
                of["low"].tolist(),
                of["high"].tolist(),
                float(error),
            )
        )
    return made


def as_json(its: Summary) -> str:
    """The summary as JSON."""
    return json.dumps(asdict(its), indent=1)


def in_words(its: Summary) -> list[str]:
    """What an engineer wants to know, one sentence a line."""
    lines = []
    for p in its.parameters:
        unit = "" if p.unit == "-" else f" {p.unit}"
        said = (
            f"{p.name} = {p.mean:.3g}{unit}, 90 % from {p.interval[0]:.3g} to {p.interval[1]:.3g}"
        )
        if not p.asked:
            said = f"{said} (left free, for it is not known exactly)"
        elif not p.determined:
            said = f"{said}: not determined by these recordings"
        lines.append(said)
    lines += _combinations(its)
    if its.probability < MISFIT:
        lines.append(
            f"The simulation does not fit: a misfit of {its.misfit:.0f} on {its.freedom} degrees "
            f"of freedom has probability {its.probability:.1g}. The values above are those of a "
            "wrong model."
        )
    lines += [error_in_words(c) for c in its.compared]
    lines.append(f"{its.runs} simulations, {its.failed} failed, {its.cpu_s:.0f} s of CPU")
    return lines


def error_in_words(its: Compared) -> str:
    """How far simulations are from a recording."""
    kind = "held out" if its.held_out else "fitted"
    return (
        f"{its.recording}, {its.channel} ({kind}): error {its.error:.2f} times what noise and "
        "packing explain"
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
