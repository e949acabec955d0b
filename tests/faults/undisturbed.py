"""Undisturbed runs, which the disturbed ones are compared with."""

import shutil
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from faults.campaign import COMMANDS, Campaign, End, complaint, new_campaign
from faults.stores import Base

ROOT = Path(__file__).parents[2]

# Grains that move, by an engine outside of mfopt, for kills; only few runs, as each takes a second.
YADE = """
[study]
name = "small"
seed = 3
[problem]
scene = "dosing"
objective = "dispersion"
dosing.free = { l1 = [80, 180], w1 = [60, 140], s1 = [-40, 40] }
[[level]]
name = "reduced"
engine = "reduced"
[[level]]
name = "dem-40"
engine = "yade"
grains = 40
spheres_per_grain = 1
[search]
method = "cma-es"
population_size = 2
seeds = 1
[[search.stage]]
level = "reduced"
generations = 1
[[search.stage]]
level = "dem-40"
generations = 1
[confirm]
seeds = 1
[run]
workers = 2
"""

# A surrogate over a level that takes milliseconds, for damaged stores.
ASSISTED = """
[study]
name = "small"
[problem]
scene = "dosing"
objective = "dispersion"
[[level]]
name = "reduced"
engine = "reduced"
[search]
budget = 12
population_size = 6
[confirm]
seeds = 1
[run]
workers = 1
"""


# The same with moving grains above, for kills.
GRAINS = ASSISTED.replace(
    "[search]",
    '[[level]]\nname = "grains"\nengine = "numba"\ngrains = 150\nspheres_per_grain = 1\n[search]',
).replace("workers = 1", "workers = 2")


@dataclass(frozen=True, slots=True)
class Undisturbed:
    """A study, and what an undisturbed run of it gave."""

    study: str
    base: Base
    end: End


_made: dict[str, Undisturbed] = {}  # by study


def undisturbed(folder: Path, study: str = COMMANDS) -> Undisturbed:
    """Run a study without any fault, in a new folder; what was made before is given again.

    Raises:
        RuntimeError: if it does not end well.
    """
    if study not in _made:
        _made[study] = _run(new_campaign(folder, study))
    return _made[study]


def _run(campaign: Campaign) -> Undisturbed:
    wrong = complaint(campaign.run(), codes=(0,))
    if wrong is not None:
        raise RuntimeError(f"the undisturbed run failed: {wrong}")
    base = Base(campaign.study, campaign.directory)
    return Undisturbed(campaign.study.read_text(), base, campaign.end())


def studies() -> list[dict[str, Any]]:
    """Valid studies of every kind, to be fuzzed."""
    files = [
        *sorted((ROOT / "examples").glob("*.toml")),
        Path(__file__).with_name("everything.toml"),
    ]
    texts = (COMMANDS, ASSISTED, *(path.read_text(encoding="utf-8") for path in files))
    return [tomllib.loads(text) for text in texts]


def has_yade() -> bool:
    """Whether kills of YADE can be tried here."""
    return shutil.which("yade") is not None
