"""What one simulation run gave, finished or failed."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from mfopt.arrays import AnyArray, Array

Status = Literal["finished", "crashed", "timed_out", "invalid_design"]


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """One simulation run: raw results that any objective can be computed from later.

    `raw` maps a name to an array (0-d for a scalar), SI units. The dosing scene stores
    `passage_times` (n_passed,) [s, sorted], and the counts `grains`, `passed`,
    `left_in_cup`, `left_in_hopper`, `lost`.
    """

    x: Array  # (d,) design, physical units
    level: str
    seed: int
    status: Status
    why: str | None = None  # one line, then the last of its log if it crashed; None if finished
    raw: Mapping[str, AnyArray] = field(default_factory=dict)
    work: float = 0.0  # [sphere-steps times the engine's cost factor]
    cpu_s: float = 0.0  # measured; never decides anything

    @property
    def finished(self) -> bool:
        """Whether the run ended as it should."""
        return self.status == "finished"
