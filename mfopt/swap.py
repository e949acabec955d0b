"""Two variables exchanged: the way out of a minimum in which they are the wrong way round.

Source: the paper's section 3.5, where y1 above y2 lets the cup move back.
"""

import numpy as np

from mfopt.arrays import Array
from mfopt.errors import ConfigError
from mfopt.problem import Problem

Pair = tuple[str, str]


def check_pair(problem: Problem, pair: Pair | None) -> None:
    """Make sure that both variables are free.

    Raises:
        ConfigError: if one is not.
    """
    for name in pair or ():
        if name not in problem.names:
            raise ConfigError(
                f"exchange names {name!r}, which is not free; "
                f"the variables are {', '.join(problem.names)}"
            )


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
    return None if problem.impossible(turned) else turned
