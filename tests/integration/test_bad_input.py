"""Bad input: one clear message, exit code 2, nothing written over."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from campaigns import PLAN, STUDY
from typer.testing import CliRunner, Result

from mfopt.campaign.store import create
from mfopt.commands.app import app
from mfopt.records.evaluation import Candidate, Evaluation
from mfopt.records.outcome import Outcome

GOOD = STUDY.format(engine='"bullet"')


def mfopt(*arguments: str | Path) -> Result:
    return CliRunner().invoke(app, list(map(str, arguments)))


def refused(done: Result) -> str:
    """The message of a refusal; it must be one, and the exit code 2."""
    assert done.exit_code == 2, done.output
    assert done.stderr.count("error:") == 1
    return done.stderr


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("seed = 3", 'seed = "3"', r"study\.seed = '3'"),
        ("seed = 3", "seed = 3\n[problem.dosing.free]\nl1 = 5", r"l1 = 5 must be a list, such as"),
        ("seed = 3", "seed = 3\n[problem.dosing.free]\nl1 = [5]", r"l1 = \[5\] has too few"),
        ("seed = 3", "seed = 3\n[problem.dosing.free]\nl1 = [5, 6, 7]", r"l1.* at most 2 entries"),
        ("seed = 3", "seed = 3\n[problem.dosing]\nfree = 5", r"free = 5 must be a table"),
        ("grains = 40", "grains = 40\neffects = {tilt = 1}", r"tilt = 1 must be a table"),
        (
            "grains = 40", "grains = 40\neffects = {drag_linear = {rate = -1}}",
            r"study\.toml: level 2: effect .*rate = -1 1/s must be at least 0",
        ),
        (
            "grains = 40", 'grains = 40\nprecision = "double"',
            r"level 2: precision = 'double' is an option of the engine 'yade'",
        ),
        (
            'objective = "dispersion"', 'objective = "dispersion"\nobjective_unit = "kg"',
            r"objective_unit = 'kg': a scene brings the unit",
        ),
        ("seed = 3", "seed = nan", r"study\.seed = nan"),
        ("grains = 40", "grains = 40.5", r"grains = 40\.5"),
        ("grains = 40", "grains = -1", r"grains = -1 must be at least 1; raise it"),
        ("grains = 40", "graims = 40", r"unknown key 'graims'; did you mean 'grains'\?"),
        ("grains = 40", "", r"key 'grains' is missing"),
        ("[confirm]\nseeds", "[confirm]\nsedes", r"unknown key 'confirm\.sedes'.*'seeds'"),
        ("seeds = 1", 'seeds = 1\nreference = "yaed"', r"reference = 'yaed' must be one of"),
        ("seeds = 1", 'seeds = 0\nreference = "yade"', r"confirm: reference needs a run"),
        ("seeds = 1", "seeds = 1\nreference = 3", r"confirm\.reference.*= 3"),
        ('objective = "dispersion"', "", r"key 'problem\.objective' is missing"),
        ('objective = "dispersion"', 'objective = "speed"', r"unknown objective 'speed'"),
        ('engine = "bullet"', 'engine = "blender"', r"engine = 'blender' must be one of"),
        ('level = "dem-40"', 'level = "dem-41"', r"'dem-41'.*did you mean 'dem-40'"),
        ('name = "dem-40"', 'name = "reduced"', r"'dem-40'|'reduced' occurs more than once"),
        ("population_size = 4", "population_size = 1", r"population_size = 1"),
        ("seed = 3", "seed = ", r"not valid TOML"),
        ('"cma-es"', '"cma-es"\nbudget = 9', r"search: budget is of method = \"assisted\""),
        ('"cma-es"', '"assisted"\nbudget = 9', r"stages are of method = \"cma-es\".*budget"),
        ('"cma-es"', '"cmaes"', r"search\.method = 'cmaes': .*'assisted' or 'cma-es'"),
        (PLAN, "[search]\n", r"search: budget is missing; give it in runs of the target level"),
        (PLAN, "[search]\nbudget = 0.5\n", r"search\.budget = 0\.5 must be at least 1; raise"),
        (PLAN, '[search]\nmethod = "cma-es"\n', r"no \[\[search\.stage\]\]; plan at least one"),
        (
            "[[level]]\nname = \"reduced\"",
            '[problem.dosing.free]\nl1 = [180, 80]\n[[level]]\nname = "reduced"',
            r"l1.*lower bound 180 must be below upper bound 80",
        ),
        (
            "[[level]]\nname = \"reduced\"",
            '[problem.dosing.free]\nl1 = [80, nan]\n[[level]]\nname = "reduced"',
            r"l1.* finite",
        ),
        (
            "[[level]]\nname = \"reduced\"",
            '[problem.dosing]\nstroke_mm = "long"\n[[level]]\nname = "reduced"',
            r"stroke_mm = 'long'",
        ),
        (
            "[[level]]\nname = \"reduced\"",
            '[problem.dosing.cup]\nlenght_mm = 3\n[[level]]\nname = "reduced"',
            r"unknown key 'cup\.lenght_mm'; did you mean 'length_mm'",
        ),
        (
            "[[level]]\nname = \"reduced\"",
            '[problem.dosing.cup]\nvolume_ml = 500\n[[level]]\nname = "reduced"',
            r"volume_ml = 500 to 126% .* at least 982 ml",
        ),
        (PLAN, '[search]\nbudget = 5\nexchange = ["y1", "yy"]\n', r"'yy', which is not free"),
        (PLAN, '[search]\nbudget = 5\nexchange = ["y1", "y1"]\n', r"'y1' twice"),
        ('name = "small"', 'name = "../../evil"', r"study\.name: '\.\./\.\./evil' holds '/'"),
        ('name = "small"', 'name = ".hidden"', r"begins with a dot"),
        ('name = "small"', 'name = " "', r"shows nothing"),
        ('name = "small"', f'name = "{101 * "a"}"', r"101 characters, above the limit of 100"),
        ('name = "small"', r'name = "a\u0000b"', r"control character"),
        ("grains = 40", "grains = 1000000000000", r"grains = 1000000000000 must be at most 1e\+06"),
        ("grains = 40", f"grains = {400 * '9'}", r"grains = 9+\.\.\.9+ must be at most"),
        ("grains = 40", f"grains = {5000 * '9'}", r"not valid TOML: .*digits"),
        ("grains = 40", "grains = 40\nyoung_modulus_pa = 5e-324", r"young_modulus_pa = 5e-324 "),
        ("grains = 40", "grains = 40\ntime_limit_s = 1e-320", r"time_limit_s = 1e-320 must be"),
        ("[confirm]\nseeds = 1", "[confirm]\nseeds = 1000000000000", r"seeds = 10+ must be at"),
        ("[confirm]", "[run]\nworkers = 1000000000000\n[confirm]", r"workers = 10+ must be at"),
        ("population_size = 4", "population_size = 10000000000", r"population_size = 10+ must"),
    ],
)  # fmt: skip
def test_wrong_study_is_refused_before_anything_is_written(
    old: str, new: str, message: str, tmp_path: Path
) -> None:
    assert old in GOOD
    study = tmp_path / "study.toml"
    study.write_text(GOOD.replace(old, new, 1))
    said = refused(mfopt("run", study, "--directory", tmp_path / "run"))
    assert re.search(message, said), said
    assert not (tmp_path / "run").exists()


def test_empty_ladder(tmp_path: Path) -> None:
    study = tmp_path / "study.toml"
    head = GOOD[: GOOD.index("[[level]]")]
    study.write_text("level = []\n" + head + "[search]\nbudget = 5\n")
    assert "ladder is empty" in refused(mfopt("run", study, "-d", tmp_path / "run"))


def test_missing_and_unreadable_study(tmp_path: Path) -> None:
    assert "does not exist" in refused(mfopt("run", tmp_path / "none.toml"))
    assert "is a directory" in refused(mfopt("run", tmp_path))
    assert "is not a file" in refused(mfopt("run", "/dev/zero"))
    os.mkfifo(tmp_path / "pipe")
    assert "is not a file" in refused(mfopt("run", tmp_path / "pipe"))
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    assert "cannot read" in refused(mfopt("run", tmp_path / "loop"))
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00")
    assert "not UTF-8" in refused(mfopt("run", tmp_path / "binary.toml"))
    (tmp_path / "long.toml").write_text("#" * 2_000_000)
    assert "has 2 MB, above the limit" in refused(mfopt("run", tmp_path / "long.toml"))


@pytest.mark.parametrize("depth", [100, 1000, 5000])
def test_deeply_nested_study_is_refused(depth: int, tmp_path: Path) -> None:
    study = tmp_path / "study.toml"
    study.write_text(GOOD.replace("seed = 3", f"seed = {depth * '['}{depth * ']'}"))
    assert re.search(r"nested too deeply|study\.seed = \[\[", refused(mfopt("ladder", study)))


def test_study_with_a_byte_order_mark_is_read(tmp_path: Path) -> None:
    study = tmp_path / "study.toml"
    study.write_text(GOOD, encoding="utf-8-sig")
    assert mfopt("ladder", study).exit_code == 0


def test_missing_yade_is_named_with_the_remedy(tmp_path: Path) -> None:
    study = tmp_path / "study.toml"
    study.write_text(GOOD.replace('"bullet"', '"yade"'))
    done = subprocess.run(
        [sys.executable, "-m", "mfopt", "run", str(study), "-d", str(tmp_path / "run")],
        capture_output=True, text=True, check=False, env={**os.environ, "PATH": str(tmp_path)},
    )  # fmt: skip
    assert done.returncode == 2
    assert done.stderr.startswith("error: ")
    assert "apt-get install yade" in done.stderr
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "run").exists()


def test_run_directory_is_not_written_over(tmp_path: Path) -> None:
    study, run = tmp_path / "study.toml", tmp_path / "run"
    study.write_text(GOOD)
    run.mkdir()
    (run / "run.json").write_text('{"format": 1}')
    assert "format 1" in refused(mfopt("run", study, "-d", run))
    (run / "run.json").write_text('{"format": 0}')
    assert "format 0" in refused(mfopt("run", study, "-d", run, "--resume"))
    assert json.loads((run / "run.json").read_text()) == {"format": 0}
    assert "format 0" in refused(mfopt("status", run))


def test_resume_with_another_study_or_version_is_refused(tmp_path: Path) -> None:
    study, run = tmp_path / "study.toml", tmp_path / "run"
    study.write_text(GOOD)
    x = np.zeros(1)
    outcome = Outcome(x, "a", 1, "finished", None, {})
    made = Evaluation(Candidate(0, x, "a", 1, 0, "search"), outcome, 0.5)
    create(run, GOOD, {"mfopt_version": "0.0.0"}).add_evaluation(made)
    assert "holds a run already; use --resume" in refused(mfopt("run", study, "-d", run))
    said = refused(mfopt("run", study, "-d", run, "--resume"))
    assert "holds another run than the one given: mfopt_version 0.0.0 (now " in said


def test_no_disk_space_is_refused_at_the_start(tmp_path: Path) -> None:
    small = tmp_path / "small"
    small.mkdir()
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=1m", "tmpfs", str(small)],
        capture_output=True, check=False,
    )  # fmt: skip
    if mounted.returncode != 0:
        pytest.skip("needs the right to mount a small file system")
    try:
        study = tmp_path / "study.toml"
        study.write_text(GOOD)
        said = refused(mfopt("run", study, "-d", small / "run"))
        assert "MB of disk are free" in said
        assert not (small / "run").exists()
    finally:
        subprocess.run(["umount", str(small)], check=True)


def test_status_of_what_is_no_run(tmp_path: Path) -> None:
    assert "not a run directory" in refused(mfopt("status", tmp_path))


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ("l1=9999", r"l1 = 9999 must be from 80 to 180 mm"),
        ("ll=3", r"--set ll=3: write name=number.*did you mean"),
        ("l1=wide", r"--set l1=wide: write name=number"),
        ("l1=nan", r"finite"),
    ],
)
def test_wrong_design_is_refused(given: str, message: str, tmp_path: Path) -> None:
    study = tmp_path / "study.toml"
    study.write_text(GOOD)
    said = refused(mfopt("evaluate", study, "--level", "reduced", "--set", given))
    assert re.search(message, said), said


@pytest.mark.parametrize("blocked", ["file", "name"])
def test_directory_that_cannot_be_written_is_one_line(blocked: str, tmp_path: Path) -> None:
    study = tmp_path / "study.toml"
    study.write_text(GOOD)
    (tmp_path / "file").write_text("not a directory")
    where = tmp_path / ("file" if blocked == "file" else 300 * "n")
    for command in ("geometry", "run"):
        said = refused(mfopt(command, study, "--directory", where / "deep"))
        assert str(where) in said
        assert said.count("\n") == 1
