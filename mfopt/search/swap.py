"""Two variables exchanged: the way out of a minimum in which they are the wrong way round.

Source: the paper's section 3.5, where y1 above y2 lets the cup move back.
"""

import numpy as np

from mfopt.arrays import Array
from mfopt.errors import ConfigError
from mfopt.records.problem import Problem
from mfopt.search.archive import Archive
from mfopt.settings import nearest

Pair = tuple[str, str]

AFTER = 10  # generations in the suspected minimum; the paper waited 25 by hand
SHARE = 0.9  # share of candidates in it; the paper saw 98.7 %


def check_pair(problem: Problem, pair: Pair | None) -> None:
    """Make sure that they are two free variables.

    Raises:
        ConfigError: if they are not.
    """
    for name in pair or ():
        if name not in problem.names:
            raise ConfigError(
                f"exchange names {name!r}, which is not free{nearest(name, problem.names)}"
            )
    if pair is not None and pair[0] == pair[1]:
        raise ConfigError(f"exchange names {pair[0]!r} twice; name two variables")


def wrong_way(problem: Problem, pair: Pair, x: Array) -> bool:
    """Whether the design `x` (d,) has the first variable above the second."""
    first, second = (problem.names.index(name) for name in pair)
    return bool(x[first] > x[second])


def swapped(problem: Problem, pair: Pair, x: Array) -> Array | None:
    """The design `x` (d,) with both exchanged, moved into bounds; None if it is impossible."""
    places = [problem.names.index(name) for name in pair]
    turned = np.array(x)
    turned[places] = turned[places[::-1]]
    turned = np.clip(turned, problem.lower, problem.upper)
    as_run = problem.to_x(problem.to_z(turned))
    return None if problem.impossible(as_run) else turned


class _OfPair:
    """What both ways to exchange a pair know.

    Args:
        problem: what to minimise over.
        pair: the first is not to be above the second; None where nothing is exchanged.

    Raises:
        ConfigError: if a variable of the pair is not free.
    """

    def __init__(self, problem: Problem, pair: Pair | None) -> None:
        check_pair(problem, pair)
        self._problem, self._pair = problem, pair

    @property
    def name(self) -> str:
        """The exchange in words."""
        return f"{' and '.join(self._pair or ())} exchanged"


class Exchange(_OfPair):
    """Tries a design exchanged, once a level, where it is the wrong way round."""

    def __init__(self, problem: Problem, pair: Pair | None) -> None:
        super().__init__(problem, pair)
        self._tried: Array | None = None

    def new_level(self) -> None:
        """Allow one more try."""
        self._tried = None

    def attempt(self, z: Array) -> Array | None:
        """The design `z` (d,) of the unit cube exchanged, if that is to be tried now.

        An impossible design is not tried.
        """
        if self._pair is None or self._tried is not None:
            return None
        x = self._problem.to_x(z)
        turned = swapped(self._problem, self._pair, x)
        if turned is not None and wrong_way(self._problem, self._pair, x):
            self._tried = self._problem.to_z(turned)
        return self._tried

    def success(self, archive: Archive, level: int) -> Array | None:
        """The exchanged design (d,) of the unit cube, if it is the best run at this level."""
        if self._tried is None:
            return None
        return self._tried if archive.beats_others(self._tried, level) else None


class Watch(_OfPair):
    """Says, once a stage, when generations have stayed where the pair is the wrong way round."""

    def __init__(self, problem: Problem, pair: Pair | None) -> None:
        super().__init__(problem, pair)
        self._generations, self._done = 0, False

    def new_stage(self) -> None:
        """Allow one more exchange."""
        self._done = False

    def restart(self) -> None:
        """Count anew."""
        self._generations = 0

    def after(self, designs: Array, best: Array) -> Array | None:
        """The best design (d,) exchanged, if that is due after a generation (n, d).

        It stays as it is where the exchanged one is impossible.
        """
        if self._pair is None or self._done:
            return None
        above = np.mean([wrong_way(self._problem, self._pair, x) for x in designs])
        stays = above >= SHARE and wrong_way(self._problem, self._pair, best)
        self._generations = self._generations + 1 if stays else 0
        if self._generations < AFTER:
            return None
        self._done = True
        turned = swapped(self._problem, self._pair, best)
        return best if turned is None else turned
