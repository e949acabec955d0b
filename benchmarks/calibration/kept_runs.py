"""Runs of a simulator that several fits share: what was run once is not run again."""

from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import lines
from mfopt.arrays import frozen
from mfopt.records.evaluation import Candidate, Evaluation
from mfopt.records.level import Ladder, Level
from mfopt.records.outcome import Outcome

DIGITS = 5  # of a stored value

Key = tuple[str, tuple[float, ...], int]  # recording, parameters, seed


@dataclass(frozen=True, slots=True)
class KeptRuns:
    """A simulator under the conditions of several recordings, with the runs made so far."""

    file: Path
    channels: tuple[str, ...]
    pool: ProcessPoolExecutor
    there: dict[Key, dict[str, Any]]

    def evaluate(self, candidates: Sequence[Candidate], ladder: Ladder) -> list[Evaluation]:
        """The candidates' runs, in that order."""
        waiting = {}
        for candidate in candidates:
            key = _key(candidate)
            if key not in self.there and key not in waiting:
                level = ladder[candidate.level]
                waiting[key] = self.pool.submit(_run, level, candidate)
        for key, future in waiting.items():
            line = _line(key, future.result(), self.channels)
            lines.append(self.file, line)
            self.there[key] = line
        return [_evaluation(c, self.there[_key(c)]) for c in candidates]


@contextmanager
def kept_runs(file: Path, channels: Sequence[str], jobs: int) -> Iterator[KeptRuns]:
    """The runs of `file`, to which new ones are added, `jobs` at a time."""
    there = {}
    for _, line in lines.read(file):
        name, x, seed = line["key"]
        there[name, tuple(x), seed] = line
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        try:
            yield KeptRuns(file, tuple(channels), pool, there)
        finally:
            pool.shutdown(cancel_futures=True)  # after an error nobody waits for the others


def _key(candidate: Candidate) -> Key:
    return candidate.level, tuple(float(f"{v:.12g}") for v in candidate.x), candidate.seed


def _run(level: Level, candidate: Candidate) -> Outcome:
    return level.evaluate(frozen(candidate.x), seed=candidate.seed)


def _line(key: Key, outcome: Outcome, channels: Sequence[str]) -> dict[str, Any]:
    raw = outcome.raw
    series = {c: np.round(raw[c], DIGITS).tolist() for c in ("time", *channels) if c in raw}
    return {
        "key": key, "status": outcome.status, "why": outcome.why,
        "cpu_s": round(outcome.cpu_s, 3), "raw": series,
    }  # fmt: skip


def _evaluation(candidate: Candidate, line: dict[str, Any]) -> Evaluation:
    raw = {name: np.array(values) for name, values in line["raw"].items()}
    outcome = Outcome(
        candidate.x, candidate.level, candidate.seed, line["status"], line["why"], raw,
        1.0, line["cpu_s"],
    )  # fmt: skip
    return Evaluation(candidate, outcome, 0.0 if outcome.finished else np.inf)
