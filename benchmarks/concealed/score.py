"""How often a missing effect was named rightly, named wrongly, or left open."""

from collections.abc import Callable, Sequence

import numpy as np

from benchmarks.concealed.found import Line
from benchmarks.concealed.places import localised
from benchmarks.concealed.stated import FULL, in_stated_set, intervals_hold, is_true

BINS = ((5.0, np.inf), (3.0, 5.0), (0.0, 3.0))  # of the distance D
CLEAR = BINS[0][0]
ECE_BINS = 4
NULLS = ("null", "clean", "misjudged", "stiffness")


def report(made: Sequence[Line]) -> list[str]:
    """The table of a set of cases."""
    return [
        f"{len(made)} cases",
        *_alarms(made),
        *_names(made),
        *_stated(made),
        *_held_out(made),
        _localised(made),
        _plain_bic(made),
        _faint(made),
        f"CPU {np.median([m['cpu_s'] for m in made]):.1f} s a case (median)",
    ]


def _alarms(made: Sequence[Line]) -> list[str]:
    """False alarms of each kind of null."""
    by_kind = {kind: of_kind(made, kind) for kind in NULLS}
    return [
        f"{kind}: {count(its, alarm)} of {len(its)} false alarms"
        for kind, its in by_kind.items()
        if its
    ]


def _names(made: Sequence[Line]) -> list[str]:
    """What was named where something is missing."""
    told, singles = list[str](), of_kind(made, "single")
    for low, high in BINS:
        its = [m for m in singles if low <= m["distance"] < high]
        told.append(
            f"D from {low:g} to {high:g}: {len(its)} singles, named right {count(its, right)}, in "
            f"a set with the truth {count(its, in_set)}, wrong {count(its, wrong)}, nothing "
            f"{count(its, quiet)}, unknown {count(its, unknown)}"
        )
    pairs, others = of_kind(made, "pair"), of_kind(made, "outside")
    told.append(
        f"pairs: {len(pairs)}, at least one right {count(pairs, in_set)}, both "
        f"{count(pairs, both)}, wrong {count(pairs, wrong)}"
    )
    told.append(f"outside: {len(others)}, not named {len(others) - count(others, named)}")
    return [*told, f"wrong names over all: {count(made, wrong)}"]


def _stated(made: Sequence[Line]) -> list[str]:
    """Whether probabilities and intervals are as often true as they say."""
    kinds = {"nothing": NULLS, "one effect": ("single",), "two": ("pair",), "else": ("outside",)}
    parts = [
        f"{name} {share([in_stated_set(m) for m in of_kind(made, *its)])}"
        for name, its in kinds.items()
    ]
    named_right = [m for m in made if right(m)]
    inside = intervals_hold(named_right, below_full=True)
    return [
        f"expected calibration error {ece(made):.3f}",
        f"stated 90 % sets hold the truth: {share(list(map(in_stated_set, made)))}, target 85 to "
        f"97 % ({', '.join(parts)})",
        f"strength in its 90 % interval where named right: {share(intervals_hold(named_right))}, "
        f"target 80 to 97 % (below full strength {share(inside)})",
    ]


def _held_out(made: Sequence[Line]) -> list[str]:
    """Errors of held-out recordings of clear cases, beside those of rivals."""
    clear = [m for m in of_kind(made, "single") if m["distance"] >= CLEAR]
    told = []
    if clear:
        before, after, decoy, nameless = np.median([m["held_out"] for m in clear], axis=0)
        told.append(
            f"held out at D >= 5, medians of singles: before {before:.2f}, after {after:.2f}, "
            f"decoy {decoy:.2f}, nameless discrepancy {nameless:.2f}"
        )
    over = over_oracle(made)
    if over:
        told.append(
            f"held out at D >= 5, after over that of an oracle, median: {np.median(over):.2f} in "
            f"{len(over)} singles and pairs, target 1.2"
        )
    return told


def _localised(made: Sequence[Line]) -> str:
    """Whether the right cells were flagged."""
    its = localised(made)
    return (
        f"cells, F1 at D >= 5: {its.f1:.2f} in {its.cases} cases, target 0.7; every cell flagged "
        f"{its.everything:.2f}, target 0.2 below"
    )


def _plain_bic(made: Sequence[Line]) -> str:
    """What a choice by BIC with independent noise names."""
    nulls, singles = of_kind(made, *NULLS), of_kind(made, "single")
    clear = [m for m in singles if m["distance"] >= CLEAR]
    return (
        f"BIC with independent noise: {count(nulls, bic_names)} of {len(nulls)} false alarms, "
        f"named right {count(singles, bic_right)} of {len(singles)} singles, at D >= 5 "
        f"{count(clear, bic_right)} of {len(clear)}; wrong names over all {count(made, bic_wrong)}"
    )


def _faint(made: Sequence[Line]) -> str:
    """Effects that could not reach a clear distance."""
    its = [f"{name} ({far:.1f})" for name, far in out_of_reach(made).items()]
    return f"below D = 5 at full strength: {', '.join(its) or 'none'}"


def share(holds: Sequence[bool]) -> str:
    """How many hold, of how many."""
    if not holds:
        return "0 of 0"
    return f"{sum(holds)} of {len(holds)} ({100.0 * sum(holds) / len(holds):.0f} %)"


def of_kind(made: Sequence[Line], *kinds: str) -> list[Line]:
    """The cases of these kinds."""
    return [m for m in made if m["kind"] in kinds]


def over_oracle(made: Sequence[Line]) -> list[float]:
    """Held-out error over that of an oracle, of each clear case that has one."""
    return [
        m["held_out"][1] / m["oracle"]
        for m in made
        if m.get("oracle") is not None and m["distance"] >= CLEAR
    ]


def out_of_reach(made: Sequence[Line]) -> dict[str, float]:
    """Effects that were at full strength below a clear distance, with their largest distance."""
    found: dict[str, float] = {}
    for its in of_kind(made, "single"):
        ((name, strength),) = its["true_strengths"].items()
        if abs(strength) >= FULL and its["distance"] < CLEAR:
            found[name] = max(its["distance"], found.get(name, 0.0))
    return dict(sorted(found.items()))


def bic_names(its: Line) -> bool:
    """BIC chose an effect."""
    return bool(its["bic"] != "nothing")


def bic_right(its: Line) -> bool:
    """BIC chose an effect that is there."""
    return its["bic"] in its["truth"]


def bic_wrong(its: Line) -> bool:
    """BIC chose an effect that is not there."""
    return bic_names(its) and not bic_right(its)


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
    best = [max(m["hypotheses"], key=m["hypotheses"].__getitem__) for m in made]
    p = np.array([m["hypotheses"][name] for m, name in zip(made, best, strict=True)])
    ok = np.array([is_true(name, m) for m, name in zip(made, best, strict=True)], dtype=float)
    order = np.argsort(p)
    parts = np.array_split(order, ECE_BINS)
    return float(sum(len(i) / len(p) * abs(p[i].mean() - ok[i].mean()) for i in parts if len(i)))
