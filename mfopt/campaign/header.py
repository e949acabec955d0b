"""The header of a run directory: who made it, with which versions, from which choices."""

import platform
import sys
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from importlib import metadata
from typing import Any

from mfopt.campaign.phases import Starts
from mfopt.records.level import Ladder
from mfopt.records.objective import OWN, Criteria
from mfopt.records.problem import Problem

SEARCHED_WITH = ("numpy", "scipy", "cma", "h5py", "torch", "gpytorch")
CALIBRATED_WITH = ("numpy", "scipy", "h5py", "scikit-learn", "dynesty")


def header(
    problem: Problem,
    ladder: Ladder,
    *,
    name: str,
    seed: int,
    method: str,
    objective: str,
    criteria: Criteria = OWN,
    workers: int,
    starts: Starts | None = None,
    levels: Sequence[Mapping[str, Any]] = (),
    packages: Sequence[str] = SEARCHED_WITH,
    versions: Mapping[str, str] | None = None,
    settings: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """Describe a run before it starts, in what JSON can hold.

    Args:
        method: of the search: "assisted" or "cma-es".
        starts: designs that the search may start from.
        levels: per level, what a report should say of it: `engine`, `grains`, ...
        packages: whose versions decide what is found.
        versions: of the simulators behind the levels.
        settings: all that was chosen besides; `search`, `confirm` and others by name.
    """
    described = levels or [{} for _ in ladder]
    return {
        "mfopt_version": metadata.version("mfopt"),
        "study": name,
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "seed": seed,
        "method": method,
        "versions": {
            "python": platform.python_version(),
            **{package: metadata.version(package) for package in packages},
            **(versions or {}),
        },
        "platform": f"{platform.system()} {platform.machine()}, {sys.implementation.name}",
        "variables": [
            {"name": v.name, "lower": v.lower, "upper": v.upper, "unit": v.unit}
            for v in problem.variables
        ],
        "baseline": [float(value) for value in problem.baseline],
        "levels": [
            {
                "name": level.name,
                "work": float(level.work(problem.baseline)),
                **dict.fromkeys(("engine", "grains", "spheres_per_grain")),
                **extra,
            }
            for level, extra in zip(ladder, described, strict=True)
        ],
        "objective": objective,
        "objective_settings": dict(criteria.settings),
        "starts": {}
        if starts is None
        else {name: [float(value) for value in x] for name, x in starts.designs.items()},
        "objective_unit": problem.objective_unit,
        "workers": workers,
        "settings": settings or {},
    }
