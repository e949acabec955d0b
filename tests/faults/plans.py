"""The trials of each kind by number, the same in the tests and in `scripts/survive`."""

import random
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from faults import kills, starts, stores, studies, writes
from faults.campaign import COMMANDS
from faults.table import Trial
from faults.undisturbed import ASSISTED, GRAINS, YADE, has_yade, undisturbed
from faults.undisturbed import studies as valid_studies

# How many of each the long form tries. Of writes it tries every one, with every error.
LONG: Mapping[str, Sequence[int] | None] = {
    "kills": range(100), "writes": None, "stores": range(300), "lock": range(1000),
    "starts": range(20), "studies": range(10_000),
}  # fmt: skip
SHORT: Mapping[str, Sequence[int]] = {
    "kills": (0, 1, 2, 3), "writes": range(4),
    "stores": (0, 1, 2, 3, 6, 15, 28, 37, 100),  # one of each kind of damage, with seed 1
    "lock": range(100), "starts": range(2), "studies": range(300),
}  # fmt: skip


def trials(
    kind: str, folder: Path, seed: int, numbers: Sequence[int] | None, jobs: int
) -> Iterator[Trial]:
    """Make the trials of a kind with these numbers; of all there are if None."""
    its = {"kills": _kills, "writes": _writes, "stores": _stores, "lock": _lock,
           "starts": _starts, "studies": _studies}  # fmt: skip
    return its[kind](folder / kind, seed, numbers, jobs)


def _kills(folder: Path, seed: int, numbers: Sequence[int] | None, jobs: int) -> Iterator[Trial]:
    assert numbers is not None
    made = {
        study: undisturbed(folder / f"undisturbed-{n}", study)
        for n, study in enumerate(dict.fromkeys(map(_killed, numbers)))
    }

    def one(number: int) -> Trial:
        its = made[_killed(number)]
        return kills.trial(folder / str(number), its.study, its.end, seed, number)

    return _in_parallel(one, numbers, jobs)


def _killed(number: int) -> str:
    """The study of a kill: one in twenty of each target with YADE, two with grains of our own."""
    if number % 20 in (4, 5, 6, 7) and has_yade():
        return YADE
    return GRAINS if number % 20 in (8, 9) else COMMANDS  # numba needs neither keeper nor child


def _writes(folder: Path, seed: int, numbers: Sequence[int] | None, jobs: int) -> Iterator[Trial]:
    cases, wanted = writes.counted(folder / "undisturbed")
    random.Random(f"writes {seed}").shuffle(cases)  # so that the first few are of every kind

    def one(number: int) -> Trial:
        return writes.trial(folder / str(number), wanted, cases[number], number)

    return _in_parallel(one, range(len(cases)) if numbers is None else numbers, jobs)


def _stores(folder: Path, seed: int, numbers: Sequence[int] | None, jobs: int) -> Iterator[Trial]:
    assert numbers is not None
    bases = [undisturbed(folder / "commands").base, undisturbed(folder / "assisted", ASSISTED).base]
    for number in numbers:
        yield stores.trial(folder / str(number), bases[number % len(bases)], seed, number)


def _lock(folder: Path, seed: int, numbers: Sequence[int] | None, jobs: int) -> Iterator[Trial]:
    assert numbers is not None
    return starts.lock_trials(folder, len(numbers))


def _starts(folder: Path, seed: int, numbers: Sequence[int] | None, jobs: int) -> Iterator[Trial]:
    assert numbers is not None
    its = undisturbed(folder / "undisturbed")
    for number in numbers:
        yield starts.trial(folder / str(number), its.study, its.end, seed, number)


def _studies(folder: Path, seed: int, numbers: Sequence[int] | None, jobs: int) -> Iterator[Trial]:
    assert numbers is not None
    return studies.trials(folder, valid_studies(), seed, numbers)


def _in_parallel(one: Callable[[int], Trial], numbers: Iterable[int], jobs: int) -> Iterator[Trial]:
    with ThreadPoolExecutor(jobs) as pool:
        yield from pool.map(one, numbers)
