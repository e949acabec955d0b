"""Best and baseline on another engine at the end of a run, and the run without that engine."""

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import pytest
from campaigns import STUDY

from mfopt.campaign.store import open_run


def run(directory: Path, study: str, environment: Mapping[str, str], *more: str) -> str:
    """What `mfopt run` prints."""
    file = directory.with_suffix(".toml")
    file.write_text(study)
    command = [sys.executable, "-m", "mfopt", "run", str(file), "-d", str(directory), *more]
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    assert done.returncode == 0, done.stderr
    return done.stdout


def study(reference: str) -> str:
    one_worker = "\n[run]\nworkers = 1\n"  # which loads the kernel once
    confirm = f"seeds = 1\nreference = {reference}"
    return STUDY.format(engine='"numba"').replace("seeds = 1", confirm) + one_worker


@pytest.fixture
def without_yade(tmp_path: Path) -> dict[str, str]:
    return {**os.environ, "PATH": str(tmp_path)}


def test_the_first_installed_engine_confirms(tmp_path: Path, without_yade: dict[str, str]) -> None:
    path = tmp_path / "run"
    its = json.loads(run(path, study('["yade", "bullet"]'), without_yade, "--json"))
    *_, best, baseline = open_run(path).evaluations()
    assert best.candidate.purpose == "reference best"
    assert baseline.candidate.purpose == "reference baseline"
    assert best.candidate.level == baseline.candidate.level == "dem-40-bullet"
    assert its["reference"]["engine"].startswith("bullet")
    assert its["reference"]["best"] == pytest.approx(best.objective)
    assert its["reference"]["baseline_at_target"] == pytest.approx(its["baseline_median"])
    assert its["level"] == "dem-40"  # the target is still the top of the ladder
    assert its["evaluations"] == len(list(open_run(path).evaluations()))
    assert "Reference run" in (path / "report.html").read_text()


@pytest.mark.yade
@pytest.mark.skipif(shutil.which("yade") is None, reason="YADE is not installed")
def test_the_run_goes_on_without_the_engine_and_adds_it_later(
    tmp_path: Path, without_yade: dict[str, str]
) -> None:
    path = tmp_path / "run"
    said = run(path, study('"yade"'), without_yade)
    assert said.count("the reference run is skipped: yade is not installed") == 1
    assert "apt-get install yade" in said
    assert "apt-get install yade" in (path / "report.html").read_text()
    before = [e.objective for e in open_run(path).evaluations()]
    path_of_yade = str(Path(str(shutil.which("yade"))).parent)
    with_yade = {**without_yade, "PATH": f"{path_of_yade}:/usr/bin:/bin"}
    said = run(path, study('"yade"'), with_yade, "--resume")
    assert "left out" not in said
    assert "reference" in said
    resumed = list(open_run(path).evaluations())
    assert [e.objective for e in resumed[:-2]] == before
    assert {e.candidate.level for e in resumed[-2:]} == {"dem-40-yade"}
    assert all(e.outcome.finished for e in resumed[-2:])
    assert "left out" not in (path / "report.html").read_text()
