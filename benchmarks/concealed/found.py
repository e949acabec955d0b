"""What a diagnosis found, as a line of a store."""

from collections.abc import Mapping
from typing import Any

from benchmarks.concealed.bic import chosen
from calibration.diagnosis.compare import Compared
from calibration.diagnosis.diagnose import Examined
from calibration.diagnosis.joint import Hypothesis

Line = Mapping[str, Any]
LEAST = 1e-3  # probability of a hypothesis that is kept


def line_of(found: Examined, fitted: int) -> dict[str, Any]:
    """The verdict, what it rests on, and what it predicts.

    Args:
        found: what a diagnosis found.
        fitted: how many recordings are fitted.
    """
    verdict, compared = found.verdict, found.compared
    names = {s.name for w in compared.weighed for s in w.which.suspects}
    best = compared.best
    return {
        "verdict": verdict.kind, "effects": list(verdict.effects), "why": verdict.why,
        "probability": round(verdict.probability, 4), "mismatch": round(found.test.probability, 5),
        "unexplained": verdict.unexplained,
        "of": {n: round(compared.of(n), 4) for n in sorted(names) if compared.of(n) > 0.01},
        "hypotheses": hypotheses(compared),
        "strengths": {
            s.name: [round(best.strength(i, tail), 4) for tail in (0.05, 0.95)]
            for i, s in enumerate(best.which.suspects)
        },
        "held_out": [[h.before, h.after, h.decoy, h.discrepancy] for h in found.held_out][-1],
        "cells": [
            [c.recording, c.channel, round(c.difference, 3), round(c.probability, 4)]
            for c in found.cells
        ],
        "bic": bic_of(found, fitted),
    }  # fmt: skip


def hypotheses(compared: Compared) -> dict[str, float]:
    """Probabilities of whole hypotheses by name, the likeliest first."""
    pairs = zip(compared.weighed, compared.probabilities, strict=True)
    its = {whole_name(w.which): round(float(p), 4) for w, p in pairs if p > LEAST}
    return dict(sorted(its.items(), key=lambda item: -item[1]))


def whole_name(which: Hypothesis) -> str:
    """Name of a hypothesis, which also tells something else beside an effect."""
    return f"{which.name} + other" if which.suspects and which.other else which.name


def bic_of(found: Examined, fitted: int) -> str:
    """What a choice by BIC names in the same recordings."""
    compared = found.compared
    alone = [w.which for w in compared.explained if len(w.which.suspects) == 1]
    return chosen(
        found.joint.of(range(fitted)), found.observations[:fitted],
        [which.suspects[0] for which in alone], len(compared.nothing.best),
    )  # fmt: skip
