"""The trials of each kind by number, the same in the tests and in `scripts/survive`."""

import functools
import random
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from faults import kills, starts, stores, studies, writes
from faults.table import Trial
from faults.undisturbed import ASSISTED, YADE, Undisturbed, has_yade, undisturbed
from faults.undisturbed import studies as valid_studies

# How many of each the long form tries. Of writes it tries every one, with every error.
LONG = {"kills": 100, "writes": None, "stores": 300, "lock": 1000, "starts": 20, "studies": 10_000}
SHORT = {"kills": 5, "writes": 6, "stores": 12, "lock": 100, "starts": 2, "studies": 300}


def trials(kind: str, folder: Path, seed: int, numbers: range | None, jobs: int) -> Iterator[Trial]:
    """Make the trials of a kind with these numbers; of all there are if None."""
    its = {"kills": _kills, "writes": _writes, "stores": _stores, "lock": _lock,
           "starts": _starts, "studies": _studies}  # fmt: skip
    return its[kind](folder / kind, seed, numbers, jobs)


def _kills(folder: Path, seed: int, numbers: range | None, jobs: int) -> Iterator[Trial]:
    assert numbers is not None
    own = undisturbed(folder / "undisturbed")
    yade = functools.cache(lambda: undisturbed(folder / "undisturbed-yade", YADE))

    def one(number: int) -> Trial:
        with_yade = has_yade() and number % 20 in range(4, 8)  # each target once in twenty
        its = yade() if with_yade else own
        return kills.trial(folder / str(number), its.study, its.evaluations, seed, number)

    if has_yade():
        yade()
    return _in_parallel(one, numbers, jobs)


def _writes(folder: Path, seed: int, numbers: range | None, jobs: int) -> Iterator[Trial]:
    its = undisturbed(folder / "undisturbed", writes.STUDY)
    cases = writes.cases(folder / "cases", its.study)
    if numbers is None:
        chosen: Iterable[int] = range(len(cases))
    else:  # spread over all
        choose = random.Random(f"writes {seed}")
        chosen = sorted(choose.sample(range(len(cases)), min(len(cases), len(numbers))))

    def one(number: int) -> Trial:
        return writes.trial(folder / str(number), its.study, its.evaluations, cases[number])

    return _in_parallel(one, chosen, jobs)


def _stores(folder: Path, seed: int, numbers: range | None, jobs: int) -> Iterator[Trial]:
    assert numbers is not None
    bases = [undisturbed(folder / "commands").base, undisturbed(folder / "assisted", ASSISTED).base]
    for number in numbers:
        yield stores.trial(folder / str(number), bases[number % len(bases)], seed, number)


def _lock(folder: Path, seed: int, numbers: range | None, jobs: int) -> Iterator[Trial]:
    assert numbers is not None
    return starts.lock_trials(folder, len(numbers))


def _starts(folder: Path, seed: int, numbers: range | None, jobs: int) -> Iterator[Trial]:
    assert numbers is not None
    its: Undisturbed = undisturbed(folder / "undisturbed")
    for number in numbers:
        yield starts.trial(folder / str(number), its.study, its.evaluations, seed, number)


def _studies(folder: Path, seed: int, numbers: range | None, jobs: int) -> Iterator[Trial]:
    assert numbers is not None
    return studies.trials(folder, valid_studies(), seed, numbers)


def _in_parallel(one: Callable[[int], Trial], numbers: Iterable[int], jobs: int) -> Iterator[Trial]:
    with ThreadPoolExecutor(jobs) as pool:
        yield from pool.map(one, numbers)
