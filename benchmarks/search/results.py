"""Results on disk: one JSON line a run, a file for each suite and peer; what is there is kept.

Of a run's trace a result keeps what the reports print: at which cost each target was reached to
stay, and how much of the first gap was left on the way.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from benchmarks import lines
from benchmarks.search.case import CELLS_PER_DECADE, FIRST_REPORTED, TUNING, Trace

FIRST_SHARE = 1.0 / 40.0  # of the budget, from which on what is left of the gap counts


@dataclass(frozen=True, slots=True)
class Result:
    """One run of one method on one instance of a case; the seed is the instance."""

    peer: str
    case: str
    instance: int
    budget: float
    cost: float  # all that was spent
    hits: Mapping[int, float]  # target cell -> cost at which it was reached to stay
    left: float  # decades of the first gap left on the way, see `left_on_the_way`
    cpu_s: float  # the search's own [s]
    slowest_s: float  # longest ask + tell [s], where it was measured
    why: str  # the run ended


def scored(
    peer: str, case: str, instance: int, budget: float, trace: Trace, targets: Sequence[int]
) -> Result:
    """What is kept of a run; `targets` are cells, the hardest last."""
    costs = {target: hit(trace, target) for target in targets}
    return Result(
        peer, case, instance, budget, trace.cost,
        {target: cost for target, cost in costs.items() if cost is not None},
        left_on_the_way(trace, budget, targets[-1]),
        round(trace.cpu_s, 2), round(trace.slowest_s, 3), trace.why,
    )  # fmt: skip


def hit(trace: Trace, target: int) -> float | None:
    """Cost at which the recommendation reached the target to stay; None if it never did.

    A hit that does not last to the end of the trace is none.
    """
    entered: float | None = None
    for cost, cell in zip(trace.costs, trace.cells, strict=True):
        if cell < target:
            entered = None
        elif entered is None:
            entered = cost
    return entered


def left_on_the_way(trace: Trace, budget: float, hardest: int) -> float:
    """Decades of the first gap that are left, on average over the logarithm of the cost.

    Args:
        hardest: target cell; to be better than that does not count.
    """
    costs = np.geomspace(FIRST_SHARE, 1.0, 100) * budget
    cells = np.array(trace.cells)[np.searchsorted(trace.costs, costs, side="right") - 1]
    return round(-float(np.minimum(cells, hardest).mean()) / CELLS_PER_DECADE, 6)


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
    content = asdict(result)
    del content["peer"]  # the file's name
    lines.append(path, content)


def read(path: Path) -> Iterator[Result]:
    """The results in a file; a torn line is left out."""
    for _, content in lines.read(path):
        hits = {int(target): float(cost) for target, cost in content["hits"].items()}
        yield Result(path.stem, **{**content, "hits": hits})


def read_suite(directory: Path, kind: str, suite: str) -> dict[str, list[Result]]:
    """All results of a suite by peer; `kind` is "tuning" or "reported"."""
    files = lines.files_in(directory / kind / suite)
    return {file.stem: list(read(file)) for file in files}


def done(results: Iterable[Result]) -> set[tuple[str, int, float]]:
    """What need not run again: case, instance and budget."""
    return {(r.case, r.instance, r.budget) for r in results}
