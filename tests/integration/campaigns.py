"""A study small enough to be run many times."""

import os
from pathlib import Path

STUDY = """
[study]
name = "small"
seed = 3
[problem]
scene = "dosing"
objective = "dispersion"
[[level]]
name = "reduced"
engine = "reduced"
[[level]]
name = "dem-40"
engine = {engine}
grains = 40
spheres_per_grain = 1
[search]
method = "cma-es"
population_size = 4
[[search.stage]]
level = "reduced"
generations = 3
[[search.stage]]
level = "dem-40"
generations = 1
[confirm]
seeds = 1
"""

PLAN = STUDY[STUDY.index("[search]") : STUDY.index("[confirm]")]


def new_cache(path: Path) -> Path:
    """A cache of its own, but for the compiled kernel, which takes half a minute to make."""
    usual = os.environ.get("XDG_CACHE_HOME")
    compiled = (Path(usual) if usual else Path.home() / ".cache") / "mfopt" / "compiled"
    compiled.mkdir(parents=True, exist_ok=True)
    (path / "mfopt").mkdir(parents=True)
    (path / "mfopt" / "compiled").symlink_to(compiled.resolve())
    return path
