"""Is what is stated with 90 % probability true as often? Sets of hypotheses, and strengths."""

from collections.abc import Mapping, Sequence

from benchmarks.concealed.found import Line

STATED = 0.9  # probability of a set
FULL = 1.0  # strength at the end of the range of an effect


def smallest_set(probabilities: Mapping[str, float]) -> set[str]:
    """The fewest hypotheses that have the probability `STATED` together, by name."""
    found, total = set[str](), 0.0
    for name in sorted(probabilities, key=lambda n: -probabilities[n]):
        if total >= STATED:
            break
        found.add(name)
        total += probabilities[name]
    return found


def in_stated_set(its: Line) -> bool:
    """Whether the stated set of a case holds a true hypothesis."""
    return any(is_true(name, its) for name in smallest_set(its["hypotheses"]))


def is_true(hypothesis: str, its: Line) -> bool:
    """Whether a hypothesis says what is there.

    Of a pair one member is enough. What lies outside of the library is `other`, also where that
    stands beside an effect.
    """
    parts = set(hypothesis.split(" + "))
    if its["kind"] == "outside":
        return "other" in parts
    if its["kind"] == "pair":
        return bool(parts & set(its["truth"]))
    return parts == (set(its["truth"]) or {"nothing"})


def intervals_hold(made: Sequence[Line], *, below_full: bool = False) -> list[bool]:
    """For each true effect of these cases whether its strength lies in the stated interval.

    The effect must be in the likeliest hypothesis, else its strength is missed.

    Args:
        made: the cases.
        below_full: only strengths inside of their range; an interval of quantiles misses its end.
    """
    found = []
    for its in made:
        for name, strength in its["true_strengths"].items():
            if below_full and abs(strength) >= FULL:
                continue
            low, high = its["strengths"].get(name, (float("inf"), float("-inf")))
            found.append(low <= strength <= high)
    return found
