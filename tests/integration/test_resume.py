"""A run that is there: nothing to do, more to do, or another run; and its report anywhere."""

import json
import shutil
from pathlib import Path

import pytest
from campaigns import STUDY
from typer.testing import CliRunner, Result

from mfopt.commands.app import app
from mfopt.store import open_run

REDUCED = STUDY.replace('"dem-40"', '"reduced-60"', 1).replace(
    'engine = {engine}\ngrains = 40\nspheres_per_grain = 1', 'engine = "reduced"\ngrains = 60'
).replace('level = "dem-40"', 'level = "reduced-60"') + "[run]\nworkers = 1\n"  # fmt: skip


def mfopt(*arguments: str | Path) -> Result:
    return CliRunner().invoke(app, list(map(str, arguments)))


def run(study: str, directory: Path) -> str:
    """Run a study and return what the screen says."""
    file = directory.parent / "study.toml"
    file.write_text(study)
    done = mfopt("run", file, "-d", directory, "--resume")
    assert done.exit_code == 0, done.output
    return done.output


def evaluations(directory: Path) -> list[tuple[object, ...]]:
    return [
        (e.candidate.index, e.candidate.purpose, e.candidate.level, e.candidate.seed,
         e.candidate.x.tobytes(), e.objective)
        for e in open_run(directory).evaluations()
    ]  # fmt: skip


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("finished") / "run"
    run(REDUCED, path)
    return path


@pytest.fixture
def again(finished: Path, tmp_path: Path) -> Path:
    """A copy of the finished run."""
    return Path(shutil.copytree(finished, tmp_path / "run"))


def test_a_finished_run_has_nothing_left_to_do(again: Path) -> None:
    before = (again / "journal.jsonl").read_bytes()
    assert "nothing was left to do" in run(REDUCED, again)
    assert "nothing was left to do" in run("# a comment\n" + REDUCED, again)
    assert (again / "journal.jsonl").read_bytes() == before


@pytest.mark.parametrize(
    ("old", "new", "most"),
    [
        ("generations = 2", "generations = 4", 8 + 1),  # the confirmation of another best design
        ("generations = 3", "generations = 4", 4 + 8 + 1),  # the second stage is another then
        ("[confirm]\nseeds = 1", "[confirm]\nseeds = 3", 4),
    ],
)
def test_a_longer_plan_goes_on_to_what_it_would_have_been_at_once(
    old: str, new: str, most: int, again: Path, tmp_path: Path
) -> None:
    longer = REDUCED.replace(old, new)
    assert longer != REDUCED
    made = len(open_run(again))
    said = run(longer, again)
    assert f"{made} runs made before are used wherever the study asks for them again" in said
    run(longer, tmp_path / "at-once")
    assert evaluations(again) == evaluations(tmp_path / "at-once")
    assert open_run(again).study() == longer
    assert "nothing was left to do" in run(longer, again)
    assert open_run(again).made - made <= most


def test_another_study_is_refused_by_what_differs(again: Path) -> None:
    file = again.parent / "study.toml"
    for old, new, said in (
        ("grains = 60", "grains = 70", "settings level reduced-60 grains 60 (now 70)"),
        ("seed = 3", "seed = 4", "seed 3 (now 4)"),
        ("generations = 2", "generations = 1", "search stage 2 generations 2 (now 1)"),
        ("population_size = 4", "population_size = 5", "search population_size 4 (now 5)"),
    ):
        file.write_text(REDUCED.replace(old, new, 1))
        done = mfopt("run", file, "-d", again, "--resume")
        assert (done.exit_code, said in done.output.replace("\n", " ")) == (2, True), done.output


def test_report_and_status_need_no_simulator(again: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The run was made elsewhere, on an engine that is not installed here."""
    from fidelity.reduced import ReducedDosing

    def missing(*arguments: object, **more: object) -> None:
        raise AssertionError("a simulator was asked for")

    monkeypatch.setattr(ReducedDosing, "evaluate", missing)
    study = REDUCED.replace('engine = "reduced"\ngrains = 60', 'engine = "yade"\ngrains = 60')
    other = again.parent / "elsewhere"
    from mfopt.store import create

    header = {k: v for k, v in open_run(again).header.items() if k not in ("check", "study_check")}
    run = create(other, study, header)
    for evaluation in open_run(again).evaluations():
        run.add_evaluation(evaluation)
    monkeypatch.setenv("PATH", str(again.parent))
    for command in ("status", "report"):
        done = mfopt(command, other)
        assert done.exit_code == 0, done.output
    page = (other / "report.html").read_text()
    assert "viewer" in page  # the machine is drawn
    assert json.loads(mfopt("status", other, "--json").stdout)["evaluations"] == len(run)
