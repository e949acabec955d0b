"""Cost to a target as expected running time, and how two methods compare.

The expected running time (ERT) is all that was spent, up to the hit or to the end of a run that
failed, over the number of hits.

Few instances make rough times: one hit more or less halves or doubles them. To decide on a change,
compare what is left of the first gap on the way, run by run (`paired`).

Source: Hansen, Auger, Brockhoff, Tusar & Tusar, COCO: performance assessment, arXiv:1605.03560.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.search.case import CELLS_PER_DECADE, Array
from benchmarks.search.results import Result

RESAMPLES = 1000
LIMIT = 10.0  # of a ratio in a geometric mean

Key = tuple[str, int]  # case, target cell


@dataclass(frozen=True, slots=True)
class Ratio:
    """How many times cheaper ours is than the other, on one case and target."""

    case: str
    target: int
    other: str  # the method compared with
    ratio: float  # above 1: ours is cheaper; 0 or infinite: only one ever hit
    low: float  # 95 % interval, bootstrap over instances
    high: float
    ours: float  # ERT in cost units
    theirs: float
    hits: tuple[int, int]  # of ours and theirs
    instances: int


@dataclass(frozen=True, slots=True)
class Summary:
    """The ratio over cases and targets: their median, or another centre."""

    centre: float
    low: float
    high: float
    ratios: tuple[Ratio, ...]
    unreached: tuple[Key, ...]  # hit by neither

    @property
    def lost(self) -> tuple[Ratio, ...]:
        """Where ours is dearer, worst first."""
        return tuple(sorted((r for r in self.ratios if r.ratio < 1.0), key=lambda r: r.ratio))


def expected_running_time(results: Sequence[Result], target: int) -> float:
    """ERT: all that was spent until a hit or the end, over the number of hits."""
    spent, hits = _spent_and_hits(results, target)
    return float(spent.sum() / hits.sum()) if hits.any() else np.inf


def paired(ours: Sequence[Result], theirs: Sequence[Result]) -> Array:
    """Decades that ours leaves more than theirs on the way, one for each run that both have.

    That is one with the same case, instance and budget.
    """
    mine, other = (
        {(r.case, r.instance, r.budget): r.left for r in results} for results in (ours, theirs)
    )
    return np.array([mine[key] - other[key] for key in sorted(mine.keys() & other.keys())])


def mean_and_error(differences: Array) -> str:
    """Mean of paired differences (n,) with its standard error."""
    if len(differences) < 2:
        return "-"
    error = differences.std(ddof=1) / math.sqrt(len(differences))
    return f"{differences.mean():+.2f} ± {error:.2f}"


def share(target: int) -> str:
    """A target in words: the share of the first gap that may be left."""
    left = 10.0 ** (-target / CELLS_PER_DECADE)
    return f"{100.0 * left:.2g} %" if left >= 1e-3 else f"{left:.0e}"


def times(ratio: float) -> str:
    """A ratio of costs in words."""
    return "never" if ratio == 0.0 else "inf" if math.isinf(ratio) else f"{ratio:.2f}"


def interval(of: Summary | Ratio, instances: int) -> str:
    """The 95 % interval in brackets; one instance has none."""
    return f" ({times(of.low)} to {times(of.high)})" if instances > 1 else ""


def by_case(results: Sequence[Result]) -> dict[str, dict[int, Result]]:
    """Results by case and instance.

    Raises:
        ValueError: if an instance was run twice, with two budgets for example.
    """
    cases: dict[str, dict[int, Result]] = {}
    for result in results:
        instances = cases.setdefault(result.case, {})
        if result.instance in instances:
            raise ValueError(
                f"{result.peer}, {result.case}, instance {result.instance} is there twice; "
                "keep one budget a file"
            )
        instances[result.instance] = result
    return cases


def median(ratios: Array) -> Array:
    """Median (m,) of ratios (n, m)."""
    return np.asarray(np.median(ratios, axis=0))


def geometric_mean(ratios: Array) -> Array:
    """Geometric mean (m,) of ratios (n, m), each limited to `LIMIT`, also where one never hit."""
    return np.asarray(np.exp(np.log(np.clip(ratios, 1.0 / LIMIT, LIMIT)).mean(axis=0)))


def compare(
    ours: Sequence[Result],
    others: Mapping[str, Sequence[Result]],
    targets: Sequence[int],
    *,
    cases: Sequence[str] | None = None,
    centre: Callable[[Array], Array] = median,
    seed: int = 1,
) -> Summary:
    """Ours against the best of the others on each case and target, over common instances.

    The best is chosen case by case with the full results, which favours the others.

    Args:
        centre: of ratios (n, m) over the n cases and targets.
    """
    rng = np.random.default_rng(seed)
    mine, theirs = by_case(ours), {name: by_case(rows) for name, rows in others.items()}
    ratios, samples, unreached = [], [], []
    for case in sorted(mine) if cases is None else cases:
        ran = set(mine.get(case, {}))
        if not any(ran & set(rows.get(case, {})) for rows in theirs.values()):
            continue  # not run by both
        for target in targets:
            found = _compare_case(mine[case], theirs, case, target, rng)
            if found is None:
                unreached.append((case, target))
            else:
                ratios.append(found[0])
                samples.append(found[1])
    if not ratios:
        return Summary(np.nan, np.nan, np.nan, (), tuple(unreached))
    low, high = _interval(centre(np.array(samples)))
    middle = float(centre(np.array([[r.ratio] for r in ratios]))[0])
    return Summary(middle, low, high, tuple(ratios), tuple(unreached))


def _compare_case(
    mine: Mapping[int, Result],
    theirs: Mapping[str, Mapping[str, Mapping[int, Result]]],
    case: str,
    target: int,
    rng: np.random.Generator,
) -> tuple[Ratio, Array] | None:
    """The ratio on one case and its bootstrap sample; None if nobody hit."""
    best, best_time = "", np.inf
    for name, cases in theirs.items():
        common = [r for i, r in cases.get(case, {}).items() if i in mine]
        if common and (expected_running_time(common, target) < best_time or not best):
            best, best_time = name, expected_running_time(common, target)
    instances = sorted(set(mine) & set(theirs[best][case]))
    a = _spent_and_hits([mine[i] for i in instances], target)
    b = _spent_and_hits([theirs[best][case][i] for i in instances], target)
    if not (a[1].any() or b[1].any()):
        return None
    picks = rng.integers(len(instances), size=(RESAMPLES, len(instances)))
    sample = _ratio(*(v[picks].sum(axis=1) for v in (*a, *b)))
    ratio = float(_ratio(*(np.array([v.sum()]) for v in (*a, *b)))[0])
    low, high = _interval(sample)
    times = [float(s.sum() / h.sum()) if h.any() else np.inf for s, h in (a, b)]
    hits = (int(a[1].sum()), int(b[1].sum()))
    return Ratio(
        case, target, best, ratio, low, high, times[0], times[1], hits, len(instances)
    ), sample


def _spent_and_hits(results: Sequence[Result], target: int) -> tuple[Array, NDArray[np.int64]]:
    spent = [r.hits.get(target, r.cost) for r in results]
    return np.array(spent), np.array([target in r.hits for r in results], dtype=np.int64)


def _ratio(a_spent: Array, a_hits: Array, b_spent: Array, b_hits: Array) -> Array:
    """ERT of b over ERT of a; 1 where neither hit, 0 or infinite where one did."""
    neither = (a_hits == 0) & (b_hits == 0)
    top, bottom = b_spent * a_hits, np.maximum(a_spent, 1e-9) * b_hits
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(
            neither, 1.0, np.where(bottom > 0, top / np.maximum(bottom, 1e-300), np.inf)
        )


def _interval(sample: Array) -> tuple[float, float]:
    low, high = np.quantile(sample, [0.025, 0.975], method="inverted_cdf")
    return float(low), float(high)
