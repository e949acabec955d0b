"""Adding a scene: its file, and one line where scenes are listed."""

import json
import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
MAIN = """
import mfopt.study.assemble as assembly
from toy_scene import Ramp

assembly.SCENES["ramp"] = Ramp  # the one line
if __name__ == "__main__":
    from mfopt.commands.app import app
    app()
"""
STUDY = """
[study]
name = "ramp"
[problem]
scene = "ramp"
objective = "lateness"
arrival_ms = 250
[problem.ramp]
slope_deg = 50
[[level]]
name = "ball"
engine = "numba"
grains = 1
spheres_per_grain = 1
[search]
budget = 12
[confirm]
seeds = 1
[run]
workers = 1
"""


def mfopt(folder: Path, *arguments: str) -> str:
    (folder / "main.py").write_text(MAIN)
    paths = os.pathsep.join([str(ROOT), str(ROOT / "tests" / "fidelity")])
    done = subprocess.run(
        [sys.executable, "main.py", *arguments], cwd=folder, capture_output=True, text=True,
        check=False, env={**os.environ, "PYTHONPATH": paths},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_a_new_scene_is_searched_resumed_and_reported(tmp_path: Path) -> None:
    (tmp_path / "ramp.toml").write_text(STUDY)
    its = json.loads(mfopt(tmp_path, "run", "ramp.toml", "-d", "run", "--json"))
    arrival = {name: its["needs"]["arrival"][name]["median"] for name in ("best", "baseline")}
    assert abs(arrival["best"] - 0.25) < abs(arrival["baseline"] - 0.25)
    assert its["confirmed_median"] < its["baseline_median"]
    assert "nothing was left to do" in mfopt(tmp_path, "run", "ramp.toml", "-d", "run", "--resume")
    page = (tmp_path / "run" / "report.html").read_text()
    assert "arrival [ms]" in page
    assert "ramp" in mfopt(tmp_path, "check", "ramp.toml")
