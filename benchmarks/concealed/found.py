"""What a diagnosis found, as a line of a store."""

from typing import Any

from calibration.diagnosis.diagnose import Examined


def line_of(found: Examined) -> dict[str, Any]:
    """The verdict, what it rests on, and what it predicts."""
    verdict, compared = found.verdict, found.compared
    names = {s.name for w in compared.weighed for s in w.which.suspects}
    best = compared.best
    return {
        "verdict": verdict.kind, "effects": list(verdict.effects), "why": verdict.why,
        "probability": round(verdict.probability, 4), "mismatch": round(found.test.probability, 5),
        "unexplained": verdict.unexplained,
        "best": best.which.name, "best_p": round(float(compared.probabilities.max()), 4),
        "of": {n: round(compared.of(n), 4) for n in sorted(names) if compared.of(n) > 0.01},
        "strengths": {
            s.name: [round(best.strength(i, tail), 4) for tail in (0.05, 0.95)]
            for i, s in enumerate(best.which.suspects)
        },
        "held_out": [[h.before, h.after, h.decoy, h.discrepancy] for h in found.held_out][-1],
        "cells": [
            [c.recording, c.channel, round(c.difference, 3), round(c.probability, 4)]
            for c in found.cells
        ],
    }  # fmt: skip
