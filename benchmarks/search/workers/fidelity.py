"""Levels as the budgets of hyperband: a budget is the cost of a level."""

import numpy as np

from benchmarks.search.case import Case


def level_of(case: Case, budget: float) -> int:
    """The level whose cost is nearest to the budget, on a log scale."""
    return int(np.argmin(np.abs(np.log(np.array(case.costs) / budget))))


def eta(case: Case) -> int:
    """Ratio of the costs of neighbouring levels."""
    return round(case.costs[1] / case.costs[0])
