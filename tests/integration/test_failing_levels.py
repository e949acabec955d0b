"""Levels that cannot run stop a study before its budget is spent; where all failed it says so."""

import json
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from mfopt.campaign.store import open_run
from mfopt.commands.app import app

STUDY = """
[study]
name = "own"
[problem]
objective = "returned"
[[problem.variable]]
name = "a"
lower = 0.0
upper = 1.0
[[problem.variable]]
name = "b"
lower = 0.0
upper = 1.0
[[level]]
name = "coarse"
engine = "command"
command = {coarse}
work = 1
[[level]]
name = "fine"
engine = "command"
command = {fine}
work = 10
[search]
{search}
[confirm]
seeds = 1
[run]
workers = 2
"""
ASSISTED = "budget = 3"
# Without a surrogate, which takes longer to load than these studies take to run.
PLANNED = """
method = "cma-es"
population_size = 3
stage = [{ level = "coarse", generations = 1 }, { level = "fine", generations = 1 }]
"""
SIMULATOR = """
import json, sys
asked = json.load(sys.stdin)
x = asked["x"]
open(sys.argv[1], "a").write(json.dumps([asked["level"], asked["seed"], x]) + "\\n")
if eval(sys.argv[2]):
    print("licence server does not answer", file=sys.stderr)
    sys.exit(3)
print(json.dumps({"f": (x["a"] - 0.3) ** 2 + x["b"] ** 2}))
"""


def study(
    folder: Path, search: str = PLANNED, *, coarse: str = "False", fine: str = "False"
) -> Path:
    """A study whose levels fail where these expressions hold; each call is noted in `calls`."""
    (folder / "simulator.py").write_text(SIMULATOR)
    program, calls = str(folder / "simulator.py"), str(folder / "calls")
    commands = {
        name: json.dumps([sys.executable, "-I", "-S", program, calls, fails])
        for name, fails in (("coarse", coarse), ("fine", fine))
    }
    path = folder / "study.toml"
    path.write_text(STUDY.format(search=search, **commands))
    return path


def mfopt(*arguments: str | Path) -> Result:
    return CliRunner().invoke(app, list(map(str, arguments)))


def calls(folder: Path) -> list[tuple[str, int, dict[str, float]]]:
    lines = (folder / "calls").read_text().splitlines()
    return [tuple(json.loads(line)) for line in lines]


@pytest.mark.parametrize("broken", ["coarse", "fine"])
@pytest.mark.parametrize("command", ["run", "check"])
def test_a_level_that_never_runs_stops_the_study_with_its_log(
    command: str, broken: str, tmp_path: Path
) -> None:
    path, directory = study(tmp_path, **{broken: "True"}), tmp_path / "run"
    options = ["-q", "-d", directory] if command == "run" else ["--dry-run"]
    done = mfopt(command, path, *options)
    assert done.exit_code == 1
    assert f"level '{broken}' cannot run: its first 3 runs" in done.stderr
    assert done.stderr.endswith("licence server does not answer\n")
    assert len(calls(tmp_path)) == 4  # three of the broken level, one of the other
    assert not (directory / "run.json").exists()


def test_a_dry_run_measures_and_writes_nothing(tmp_path: Path) -> None:
    done = mfopt("check", study(tmp_path), "--dry-run")
    assert done.exit_code == 0, done.stderr
    assert "every level runs" in done.stdout
    assert "The study takes about" in done.stdout
    assert sorted(level for level, _, _ in calls(tmp_path)) == ["coarse", "fine"]
    assert {p.name for p in tmp_path.iterdir()} == {"study.toml", "simulator.py", "calls"}


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a study that was run."""
    folder = tmp_path_factory.mktemp("finished")
    done = mfopt("run", study(folder, ASSISTED), "-q", "-d", folder / "run")
    assert done.exit_code == 0, done.stderr
    return folder


def test_what_the_check_ran_is_stored_and_not_run_again(finished: Path) -> None:
    made = list(open_run(finished / "run").evaluations())
    assert [(e.candidate.level, e.candidate.purpose) for e in made[:2]] == [
        ("coarse", "check"), ("fine", "check"),
    ]  # fmt: skip
    once = [(level, seed, tuple(x.values())) for level, seed, x in calls(finished)]
    assert len(once) == len(set(once))
    spent = sum(e.outcome.work for e in made if e.candidate.purpose in ("check", "search"))
    assert spent <= 3 * 10.0


def test_a_resumed_run_does_not_check_whole_runs_again(finished: Path) -> None:
    before = len(calls(finished))
    directory = finished / "run"
    assert mfopt("run", finished / "study.toml", "-q", "-d", directory, "--resume").exit_code == 0
    assert len(calls(finished)) == before


def test_a_run_without_a_finished_run_at_its_target_ends_with_the_commonest_reason(
    tmp_path: Path,
) -> None:
    # The check finishes, so that the study is not stopped; nothing else does at the target.
    path = study(tmp_path, fine='asked["seed"] != 1 or x != {"a": 0.5, "b": 0.5}')
    done = mfopt("run", path, "-q", "-d", tmp_path / "run")
    assert done.exit_code == 1
    assert "there is no result: none of" in done.stderr
    assert done.stderr.endswith("licence server does not answer\n")
