"""Invented calibrations: fixtures for reports, no result of any simulation."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from mfopt.arrays import Array, frozen
from mfopt.campaign.store import RunDirectory, create, open_run
from mfopt.records.calibration import (
    FILE,
    FIT_COST,
    Advice,
    Compared,
    Direction,
    EmulatorCheck,
    Found,
    LeftOut,
    Measured,
    Offset,
    Recorded,
    Summary,
    as_json,
    fit_cost_as_json,
)
from mfopt.records.evaluation import Candidate, Evaluation, Purpose
from mfopt.records.outcome import Outcome

TIMES = np.linspace(0.0, 1.2, 40)
PURPOSES: tuple[Purpose, ...] = ("design", "design", "refine", "predict")


def parameter(name: str, unit: str = "-", **changed: Any) -> Found:
    its = Found(
        name, unit, 0.1, 0.8, 0.36, 0.37, (0.33, 0.41), 0.13,
        determined=True, asked=True, log=False, edge=None,
    )  # fmt: skip
    return replace(its, **changed)


def series(recording: str, channel: str, unit: str, size: float, *, held_out: bool) -> Compared:
    rng = np.random.default_rng(len(recording) + len(channel))
    mean = size * np.exp(-2.0 * TIMES)
    sd = np.full(len(TIMES), 0.02 * size)
    recorded = mean + sd * rng.normal(size=len(TIMES))
    return Compared(
        recording, held_out, channel, unit, TIMES.tolist(), recorded.tolist(), mean.tolist(),
        (mean - 0.03 * size).tolist(), (mean + 0.03 * size).tolist(), sd.tolist(), 1.04,
    )  # fmt: skip


def number(recording: str, channel: str, unit: str, size: float, *, held_out: bool) -> Compared:
    return Compared(
        recording, held_out, channel, unit, None, [size], [1.02 * size], [0.95 * size],
        [1.1 * size], [0.03 * size], 0.67,
    )  # fmt: skip


def summary(**changed: Any) -> Summary:
    """Three parameters, one of them not determined, one fitted along; two recordings."""
    parameters = (
        parameter("friction"),
        parameter("restitution", low=0.3, high=0.95, interval=(0.35, 0.9), share=0.85,
                  mean=0.6, best=0.62, determined=False),
        parameter("young_modulus", "Pa", low=3e5, high=1.2e7, interval=(7e5, 5e6), share=0.6,
                  mean=2e6, best=1.1e6, determined=False, asked=False, log=True),
    )  # fmt: skip
    rng = np.random.default_rng(5)
    its = Summary(
        name="invented-beads",
        parameters=parameters,
        directions=(Direction({"friction": 1.0, "restitution": 0.0, "young_modulus": 0.0}, 0.1),),
        combinations=["The combination restitution - young_modulus is not determined"],
        trade_offs=[],
        correlation=[[1.0, 0.2, -0.1], [0.2, 1.0, -0.5], [-0.1, -0.5, 1.0]],
        draws=draws(rng, parameters),
        log_evidence=-18.4, misfit=23.0, freedom=25, probability=0.58, fits=True,
        recordings=(
            Recorded("slot 30 mm", False, {"opening_mm": 30.0}, 3, 1.2,
                     {"discharged_fraction": 180, "level": 177}),
            Recorded("slot 40 mm", True, {"opening_mm": 40.0, "scene": "discharge"}, 1),
        ),
        compared=(
            series("slot 30 mm", "discharged_fraction", "-", 0.9, held_out=False),
            series("slot 30 mm", "level", "m", 0.06, held_out=False),
            number("slot 30 mm", "angle_of_repose", "rad", 0.4, held_out=False),
            series("slot 40 mm", "level", "m", 0.06, held_out=True),
        ),
        noise=(Measured("level", "m", 5e-4, (4e-4, 6e-4), 0.03, "from 3 repeats"),),
        runs=4, failed=1, cpu_s=8.0,
        emulators=(EmulatorCheck("slot 30 mm", False, 40, 0.93, 0.8, 1.2, 1.1),
                   EmulatorCheck("slot 30 mm", True, 6, 0.88, 1.1, 1.6, 1.3)),
        without=(),
        notes=("all 4 repeats: Columns are separated by tabs.", "a.csv: It had a gap."),
        offsets=(Offset("slot 30 mm", "zero of level", "m", 1e-3, -1.4e-3, 3e-4),),
        advice=(),
        further=["To determine restitution, record next: a heap"], warnings=[],
        check=["The emulators know their errors"], words=["friction = 0.37"],
    )  # fmt: skip
    its = replace(its, **changed)
    more = {"advice": advice(its.parameters), "without": without(its.parameters)}
    return replace(its, **{key: value for key, value in more.items() if key not in changed})


def without(parameters: tuple[Found, ...]) -> tuple[LeftOut, ...]:
    """A fit without one error."""
    return (LeftOut("clock", {p.name: p.interval for p in parameters}, 77.0),)


def advice(parameters: tuple[Found, ...]) -> tuple[Advice, ...]:
    """Of two further recordings, of which one tells much."""
    return (
        Advice("a heap", {p.name: 0.31 for p in parameters}, 0),
        Advice("half the portion", {p.name: 0.92 for p in parameters}, 2),
    )


def draws(rng: np.random.Generator, parameters: tuple[Found, ...]) -> list[list[float]]:
    """Draws from the interval of each parameter."""
    columns = [rng.uniform(*p.interval, 200) for p in parameters]
    return np.array(columns).T.tolist()


def calibration(path: Path, its: Summary | None = None) -> RunDirectory:
    """A run directory that holds a calibration, its last run failed."""
    found = summary() if its is None else its
    run = create(path, '[case]\nname = "invented"\n', header(found))
    for index, purpose in enumerate(PURPOSES):
        run.add_evaluation(evaluation(index, purpose, failed=index == len(PURPOSES) - 1))
    run.add_end("all planned runs are made")
    (path / FILE).write_text(as_json(found))
    (path / FIT_COST).write_text(fit_cost_as_json(41.0))
    return open_run(path)


def evaluation(index: int, purpose: Purpose, *, failed: bool) -> Evaluation:
    x: Array = frozen([0.3, 0.6, 2e6])
    candidate = Candidate(index, x, "slot 30 mm", index + 1, 0, purpose)
    status, why = ("crashed", "the bottom fell out") if failed else ("finished", None)
    outcome = Outcome(x, "slot 30 mm", index + 1, status, why, {}, 1.0, 2.0)
    return Evaluation(candidate, outcome, np.inf if failed else 0.0)


def header(its: Summary) -> dict[str, Any]:
    return {
        "mfopt_version": "0.2.0", "study": its.name, "created": "2020-02-03T04:05:06+00:00",
        "seed": 1, "method": "calibrate", "versions": {"python": "3.11.2"},
        "platform": "Linux x86_64", "workers": 2, "objective": "none",
        "baseline": [p.best for p in its.parameters],
        "variables": [
            {"name": p.name, "lower": p.low, "upper": p.high, "unit": p.unit}
            for p in its.parameters
        ],
        "levels": [{"name": r.name, "work": 1.0} for r in its.recordings],
    }  # fmt: skip
