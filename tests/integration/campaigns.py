"""A study small enough to be run many times, and what became of it."""

import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

from mfopt.evaluation import Insight
from mfopt.store import open_run

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
seeds = 2
[[search.stage]]
level = "reduced"
generations = 3
[[search.stage]]
level = "dem-40"
generations = 2
[confirm]
seeds = 1
"""

PLAN = STUDY[STUDY.index("[search]") : STUDY.index("[confirm]")]
ASSISTED = STUDY.replace(PLAN, "[search]\nbudget = 60\npopulation_size = 6\nseeds = 2\n").replace(
    "seeds = 1\n", "seeds = 1\n[run]\nworkers = 2\n"
)


def new_cache(path: Path) -> Path:
    """A cache of its own, but for the compiled kernel, which takes half a minute to make."""
    usual = os.environ.get("XDG_CACHE_HOME")
    compiled = (Path(usual) if usual else Path.home() / ".cache") / "mfopt" / "compiled"
    compiled.mkdir(parents=True, exist_ok=True)
    (path / "mfopt").mkdir(parents=True)
    (path / "mfopt" / "compiled").symlink_to(compiled.resolve())
    return path


@dataclass(frozen=True)
class Campaign:
    """One run directory, with the means to run mfopt on it."""

    study: Path
    directory: Path
    environment: dict[str, str]

    def start(self) -> "subprocess.Popen[str]":
        command = [sys.executable, "-m", "mfopt", "run", str(self.study), "--resume", "--quiet"]
        return subprocess.Popen(
            [*command, "--directory", str(self.directory)],
            env=self.environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        )  # fmt: skip

    def finish(self) -> None:
        with self.start() as process:
            _, complaint = process.communicate(timeout=600)
        assert process.returncode == 0, complaint

    def evaluations(self) -> list[tuple[object, ...]]:
        """Everything of the evaluations that must repeat, bit for bit; CPU time must not."""
        return [
            (
                e.candidate.index, e.candidate.level, e.candidate.seed, e.candidate.purpose,
                e.candidate.x.tobytes(), e.objective, e.outcome.status, e.outcome.work,
                {name: array.tobytes() for name, array in sorted(e.outcome.raw.items())
                 if not name.startswith("settling")},
            )
            for e in open_run(self.directory).evaluations()
        ]  # fmt: skip

    def insights(self) -> list[Insight]:
        """What the generations of the search taught."""
        return open_run(self.directory).insights

    def processes(self) -> list[int]:
        """Living processes that were started for this campaign, however indirectly."""
        mark = f"MFOPT_TEST_MARK={self.environment['MFOPT_TEST_MARK']}".encode()
        found = []
        for entry in Path("/proc").iterdir():
            if entry.name.isdigit() and int(entry.name) != os.getpid():
                try:
                    if mark in (entry / "environ").read_bytes().split(b"\0"):
                        found.append(int(entry.name))
                except OSError:  # gone meanwhile
                    continue
        return found
