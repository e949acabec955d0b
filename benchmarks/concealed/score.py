"""How often a missing effect was named rightly, named wrongly, or left open."""

import itertools
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

Line = Mapping[str, Any]
BINS = ((5.0, np.inf), (3.0, 5.0), (0.0, 3.0))  # of the distance D
ECE_BINS = 4


def report(made: Sequence[Line]) -> list[str]:
    """The table of a set of cases."""
    nulls = [m for m in made if m["kind"] in ("null", "misjudged", "stiffness")]
    told = [f"{len(made)} cases"]
    for kind in ("null", "misjudged", "stiffness"):
        its = [m for m in nulls if m["kind"] == kind]
        told += [f"{kind}: {count(its, alarm)} of {len(its)} false alarms"] if its else []
    singles = [m for m in made if m["kind"] == "single"]
    for low, high in BINS:
        its = [m for m in singles if low <= m["distance"] < high]
        told.append(
            f"D from {low:g} to {high:g}: {len(its)} singles, named right {count(its, right)}, in "
            f"a set with the truth {count(its, in_set)}, wrong {count(its, wrong)}, nothing "
            f"{count(its, quiet)}, unknown {count(its, unknown)}"
        )
    pairs = [m for m in made if m["kind"] == "pair"]
    told.append(
        f"pairs: {len(pairs)}, at least one right {count(pairs, in_set)}, both "
        f"{count(pairs, both)}, wrong {count(pairs, wrong)}"
    )
    others = [m for m in made if m["kind"] == "outside"]
    told.append(f"outside: {len(others)}, not named {len(others) - count(others, named)}")
    told.append(f"wrong names over all: {count(made, wrong)}")
    told.append(f"expected calibration error {ece(made):.3f}")
    clear = [m for m in singles if m["distance"] >= BINS[0][0]]
    if clear:
        errors = np.array([m["held_out"] for m in clear])
        before, after, decoy, nameless = np.median(errors, axis=0)
        told.append(
            f"held out at D >= 5, medians: before {before:.2f}, after {after:.2f}, decoy "
            f"{decoy:.2f}, nameless discrepancy {nameless:.2f}"
        )
    told.append(f"CPU {np.median([m['cpu_s'] for m in made]):.1f} s a case (median)")
    return told


def count(its: Sequence[Line], holds: Callable[[Line], bool]) -> int:
    """Cases of which something holds."""
    return sum(map(holds, its))


def alarm(its: Line) -> bool:
    """A mismatch was claimed."""
    return bool(its["verdict"] != "nothing")


def named(its: Line) -> bool:
    """A name was given, of all that is missing or of its main part."""
    return its["verdict"] == "named" or (its["verdict"] == "partly" and len(its["effects"]) == 1)


def quiet(its: Line) -> bool:
    """Nothing was said to be missing."""
    return bool(its["verdict"] == "nothing")


def unknown(its: Line) -> bool:
    """Something unknown was said to be missing."""
    return bool(its["verdict"] == "unknown")


def right(its: Line) -> bool:
    """The truth was named, and nothing else."""
    return named(its) and set(its["effects"]) == set(its["truth"])


def both(its: Line) -> bool:
    """Both members of a pair were named."""
    return named(its) and set(its["effects"]) >= set(its["truth"])


def in_set(its: Line) -> bool:
    """The truth, or a part of it, was named or is in the set."""
    return its["verdict"] in ("named", "set", "partly") and bool(
        set(its["effects"]) & set(its["truth"])
    )


def wrong(its: Line) -> bool:
    """A name was given that is not in the truth."""
    return named(its) and not set(its["effects"]) <= set(its["truth"])


def ece(made: Sequence[Line]) -> float:
    """Expected calibration error of the likeliest hypothesis, in four bins of equal count."""
    p = np.array([m["best_p"] for m in made])
    ok = np.array([m["best"] in _answers(m) for m in made], dtype=float)
    order = np.argsort(p)
    parts = np.array_split(order, ECE_BINS)
    return float(sum(len(i) / len(p) * abs(p[i].mean() - ok[i].mean()) for i in parts if len(i)))


def _answers(its: Line) -> set[str]:
    """Names of hypotheses that are right."""
    if its["kind"] == "outside":
        return {"other"}
    names = sorted(its["truth"]) or ["nothing"]
    return {" + ".join(order) for order in itertools.permutations(names)}
