"""The energy balance of a run: what was gained from nowhere.

    kinetic + potential + elastic + carried out by grains that left
    + lost in slip, contact damping, numerical damping and drag
    - work of moving walls and body forces

stays what it was at the start. Steps that are too long, and contacts made in the wrong place,
show as a gain; small losses are the discretisation's.
"""

from collections.abc import Mapping

from fidelity.dem import state as at
from mfopt.arrays import Array

NAMES = {
    "kinetic": at.KINETIC,
    "potential": at.POTENTIAL,
    "elastic": at.ELASTIC,
    "wall_work": at.WALL_WORK,
    "force_work": at.FORCE_WORK,
    "slip": at.SLIP,
    "contact_damping": at.CONTACT_DAMPING,
    "numerical_damping": at.NUMERICAL_DAMPING,
    "drag": at.DRAG,
    "carried": at.CARRIED,
}
_LOST = (at.SLIP, at.CONTACT_DAMPING, at.NUMERICAL_DAMPING, at.DRAG)


def total(budget: Array) -> float:
    """The sum that stays constant [J]."""
    kept = budget[[at.KINETIC, at.POTENTIAL, at.ELASTIC, at.CARRIED, *_LOST]].sum()
    return float(kept - budget[at.WALL_WORK] - budget[at.FORCE_WORK])


def turnover(budget: Array) -> float:
    """Energy that was turned from one kind into another, to compare a gain with [J]."""
    return float(budget[at.LARGEST_KINETIC] + budget[list(_LOST)].sum())


def named(budget: Array, start: float) -> Mapping[str, float]:
    """The budget by name, with the gain since the start and the turnover [J]."""
    parts = {name: float(budget[place]) for name, place in NAMES.items()}
    return {**parts, "gain": total(budget) - start, "turnover": turnover(budget)}
