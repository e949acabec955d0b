"""What is concealed in a case: drawn from the system's entropy, on a fixed schedule of kinds.

The size of an effect is such that its distance D is near 1.5, 4 or 7, as the emulators of the rig
predict it, or its largest where it cannot reach that.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.concealed.distance import distance, rows_of
from benchmarks.concealed.learned import Learned
from benchmarks.concealed.outside import OUTSIDE
from benchmarks.concealed.rigs import PARAMETERS, RIGS
from calibration.diagnosis.joint import Hypothesis, Suspect
from mfopt.arrays import Array

FAR, MIDDLE, NEAR = 7.0, 4.0, 1.5  # distances
# 220 cases: 80 nulls, of which 20 with misjudged noise and 20 of another stiffness; 90 with one
# effect, 40 of them far, 30 in the middle, 20 near; 20 pairs; 30 outside of the library.
BLOCK = (
    *["clean"] * 4, *["misjudged"] * 2, *["stiffness"] * 2, *[f"single {FAR}"] * 4,
    *[f"single {MIDDLE}"] * 3, *[f"single {NEAR}"] * 2, *["pair"] * 2, *["outside"] * 3,
)  # fmt: skip
INNER = 0.1  # share of the ranges at each end from which no truth is drawn
MISJUDGED = (0.5, 2.0)  # noise that a case states over the true one
STIFFER = (1.0 / 5.0, 5.0)  # than stated
OUTSIDE_SHARES = (0.4, 1.0)  # of their full strengths
HALVINGS = 7  # of the interval in which a strength is sought


@dataclass(frozen=True, slots=True)
class Truth:
    """The truth of one case."""

    case: str
    rig: str
    kind: str  # clean, misjudged, stiffness, single, pair or outside
    seed: int  # of packings and noise
    base: Mapping[str, float]
    strengths: Mapping[str, float]  # of the effects of the library, by their names
    outside: str = ""
    share: float = 0.0  # of the full strength of what lies outside
    noise: float = 1.0  # stated over true
    stiffness: float = 1.0  # true over stated
    distance: float = 0.0  # D of the effects of the library, realised
    apart: tuple[float, ...] = ()  # D of each of them alone


def drawn_block(first: int, learned: Mapping[str, Learned], entropy: int) -> list[Truth]:
    """The truths of a block of cases, from the number `first` on, in mixed order."""
    rng = np.random.default_rng(entropy)
    kinds = rng.permutation(BLOCK)
    return [
        drawn(f"{first + place:03d}", list(RIGS)[place % len(RIGS)], str(kind), learned, rng)
        for place, kind in enumerate(kinds)
    ]


def drawn(
    case: str, rig: str, kind: str, learned: Mapping[str, Learned], rng: np.random.Generator
) -> Truth:
    """The truth of one case."""
    base = {
        name: round(low + (high - low) * rng.uniform(INNER, 1.0 - INNER), 5)
        for name, (low, high) in PARAMETERS.items()
    }
    word, _, target = kind.partition(" ")
    made = Truth(case, rig, word, int(rng.integers(1 << 31)), base, {})
    if word == "misjudged":
        return replace(made, noise=float(rng.choice(MISJUDGED)))
    if word == "stiffness":
        return replace(made, stiffness=float(rng.choice(STIFFER)))
    if word == "outside":
        share = round(float(rng.uniform(*OUTSIDE_SHARES)), 3)
        return replace(made, outside=str(rng.choice(OUTSIDE)), share=share)
    if word == "clean":
        return made
    its = learned[rig]
    count = 2 if word == "pair" else 1
    names = rng.choice(sorted({family(s.name) for s in its.suspects}), count, replace=False)
    strengths: dict[str, float] = {}
    for name in names:
        its_own = [i for i, s in enumerate(its.suspects) if family(s.name) == name]
        suspect = its.suspects[rng.choice(its_own)]
        sign = -1.0 if suspect.signed and rng.random() < 0.5 else 1.0
        strengths[suspect.name] = sign * sized(suspect, sign, float(target or FAR), base, its)
    return replace(
        made, strengths=strengths,
        distance=round(far(its, base, strengths), 3),
        apart=tuple(round(far(its, base, {n: s}), 3) for n, s in strengths.items()),
    )  # fmt: skip


def family(name: str) -> str:
    """Effects that are drawn as one: the bias of any sensor."""
    return name.partition(".")[0]


def sized(
    suspect: Suspect, sign: float, target: float, base: Mapping[str, float], its: Learned
) -> float:
    """Strength of an effect at which its distance is the target, or the largest one."""
    low, high = 0.0, 1.0
    if far(its, base, {suspect.name: sign}) <= target:
        return high
    for _ in range(HALVINGS):
        middle = (low + high) / 2.0
        beyond = far(its, base, {suspect.name: sign * middle}) > target
        low, high = (low, middle) if beyond else (middle, high)
    return round((low + high) / 2.0, 5)


def far(its: Learned, base: Mapping[str, float], strengths: Mapping[str, float]) -> float:
    """Distance D of effects."""
    return distance(its.joint, true_rows(its, base, strengths), its.dimensions)


def true_rows(
    its: Learned, base: Mapping[str, float], strengths: Mapping[str, float]
) -> list[Array]:
    """Noise-free rows (p,) of the fitted recordings."""
    by_name = {s.name: s for s in its.suspects}
    which = Hypothesis(tuple(by_name[name] for name in strengths))
    units = [(s + 1.0) / 2.0 if by_name[name].signed else s for name, s in strengths.items()]
    return rows_of(its.joint, which, np.array([*its.unit(base), *units]))
