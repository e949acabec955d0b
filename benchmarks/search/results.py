"""Results on disk: one JSON line a run, a file for each suite and peer; what is there is kept."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from benchmarks import lines
from benchmarks.search.case import FIRST_REPORTED, TUNING, Trace


@dataclass(frozen=True, slots=True)
class Result:
    """One run of one method on one instance of a case."""

    peer: str
    case: str
    instance: int
    seed: int
    budget: float
    trace: Trace


def kind_of(instance: int) -> str:
    """Whether an instance is for tuning or reported.

    Raises:
        ValueError: if it is neither.
    """
    if instance in TUNING:
        return "tuning"
    if instance >= FIRST_REPORTED:
        return "reported"
    raise ValueError(
        f"instance {instance} is neither for tuning ({TUNING.start}-{TUNING.stop - 1}) "
        f"nor reported ({FIRST_REPORTED} and above)"
    )


def result_file(directory: Path, suite: str, peer: str, instance: int) -> Path:
    """Where the results of a peer on a suite are kept; tuning apart from reported."""
    return directory / kind_of(instance) / suite / f"{peer}.jsonl"


def append(path: Path, result: Result) -> None:
    """Add one line."""
    lines.append(path, _as_json(result))


def read(path: Path) -> Iterator[Result]:
    """The results in a file; a torn line is left out."""
    for _, content in lines.read(path):
        try:
            yield _from_json(path.stem, content)
        except KeyError:
            continue


def read_suite(directory: Path, kind: str, suite: str) -> dict[str, list[Result]]:
    """All results of a suite by peer; `kind` is "tuning" or "reported"."""
    files = sorted((directory / kind / suite).glob("*.jsonl"))
    return {file.stem: list(read(file)) for file in files}


def done(results: Iterable[Result]) -> set[tuple[str, int, int, float]]:
    """What need not run again: case, instance, seed and budget."""
    return {(r.case, r.instance, r.seed, r.budget) for r in results}


def _as_json(result: Result) -> dict[str, object]:
    t = result.trace
    return {
        "case": result.case, "instance": result.instance, "seed": result.seed,
        "budget": result.budget, "cost": t.cost, "runs": t.runs, "cpu_s": round(t.cpu_s, 2),
        "slowest_s": round(t.slowest_s, 3), "why": t.why,
        "costs": [int(c) if c == int(c) else c for c in t.costs], "cells": t.cells,
        "levels": t.levels if len(t.runs) > 1 else [],
    }  # fmt: skip


def _from_json(peer: str, d: dict[str, object]) -> Result:
    row: dict[str, list[int]] = d  # type: ignore[assignment]
    levels = tuple(row["levels"]) or (0,) * len(row["costs"])
    trace = Trace(
        tuple(map(float, row["costs"])), tuple(row["cells"]), levels, tuple(row["runs"]),
        float(str(d["cost"])), float(str(d["cpu_s"])), float(str(d["slowest_s"])), str(d["why"]),
    )  # fmt: skip
    return Result(
        peer, str(d["case"]), int(str(d["instance"])), int(str(d["seed"])),
        float(str(d["budget"])), trace,
    )  # fmt: skip
