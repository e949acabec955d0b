"""GrainLearning (https://grainlearning.readthedocs.io): a sequential filter in generations.

Each generation of parameters is weighted by how near its series are to those recorded; the next is
drawn from a mixture of Gaussians about the weighted ones. Its settings are its own, but that the
uncertainty scales with the largest value of a channel: the recorded series touch zero.
"""

import json
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.calibration.side_by_side import side_by_side
from calibration.observed import POINTS, Observed
from calibration.posterior import from_unit
from calibration.recordings.case import Case
from calibration.recordings.records import Noise
from calibration.runs import Evaluate, candidates
from mfopt.arrays import Array

ROOT = Path(__file__).parents[2]
PYTHON = ROOT / "build" / "peers" / "grainlearning" / "bin" / "python"
SIZE, FEWEST, MOST = 25, 2, 4  # parameters in a generation, and number of generations
LARGEST = 1.0  # variance over the square of the largest value of a channel


def grainlearning(case: Case, noises: Mapping[str, Noise], evaluate: Evaluate, runs: int) -> Array:
    """The weighted mean of the last generation.

    Raises:
        FileNotFoundError: if its environment is not there.
    """
    each = runs // len(case.fitted)
    generations = min(MOST, max(FEWEST, each // SIZE))
    count = each // generations
    task = {"dimension": len(case.parameters), "seed": case.seed, "recorded": [[0.0]]}
    answer = _asked({**task, "sigma": LARGEST, "count": count})
    sigma, made_so_far = LARGEST, 0
    for generation in range(generations):
        points = [(r, np.array(answer["next"])) for r in case.fitted]
        made = evaluate(candidates(case.parameters, points, made_so_far, "design"))
        made_so_far += len(made)
        seen, z, rows = side_by_side(case, noises, made)
        answer = _asked(
            {
                **task,
                "sigma": sigma,
                "last": generation == generations - 1,
                "z": z.tolist(),
                "recorded": _series(seen, np.concatenate([o.values for o in seen])).tolist(),
                "simulated": [_series(seen, row).tolist() for row in rows],
            }
        )
        sigma = answer["sigma"]
    return from_unit(case.parameters, np.array(answer["mean"]))


def _series(seen: Sequence[Observed], row: Array) -> Array:
    """The channels of all recordings (c, POINTS), each over its own time."""
    sizes = [block.size for o in seen for block in o.blocks]
    parts = np.split(row, np.cumsum(sizes)[:-1])
    return np.array(
        [np.interp(np.linspace(0.0, len(p) - 1.0, POINTS), np.arange(len(p)), p) for p in parts]
    )


def _asked(task: Mapping[str, Any]) -> dict[str, Any]:
    if not PYTHON.exists():
        raise FileNotFoundError(
            f"grainlearning needs {PYTHON}; make it with "
            "benchmarks/search/environments grainlearning"
        )
    done = subprocess.run(
        [PYTHON, Path(__file__).with_name("grainlearning_worker.py")],
        input=json.dumps(task), stdout=subprocess.PIPE, text=True, check=True,
    )  # fmt: skip
    return dict(json.loads(done.stdout.splitlines()[-1]))
