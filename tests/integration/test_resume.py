"""A run that is there: nothing to do, more to do, or another run; and its report anywhere."""

import json
import shutil
from pathlib import Path

import pytest
from campaigns import STUDY
from typer.testing import CliRunner, Result

from mfopt.campaign.store import open_run
from mfopt.commands.app import app

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
        ("generations = 1", "generations = 3", 8 + 1),  # the confirmation of another best design
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
        ("generations = 3", "generations = 2", "search stage 1 generations 3 (now 2)"),
        ("population_size = 4", "population_size = 5", "search population_size 4 (now 5)"),
    ):
        file.write_text(REDUCED.replace(old, new, 1))
        done = mfopt("run", file, "-d", again, "--resume")
        assert (done.exit_code, said in done.output.replace("\n", " ")) == (2, True), done.output


def test_report_and_status_need_no_simulator(again: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The run was made elsewhere, on an engine that is not installed here."""
    from fidelity.scenes.dosing.reduced import ReducedDosing

    def missing(*arguments: object, **more: object) -> None:
        raise AssertionError("a simulator was asked for")

    monkeypatch.setattr(ReducedDosing, "evaluate", missing)
    study = REDUCED.replace('engine = "reduced"\ngrains = 60', 'engine = "yade"\ngrains = 60')
    other = again.parent / "elsewhere"
    from mfopt.campaign.store import create

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


def test_a_larger_budget_of_the_assisted_search_uses_all_that_was_paid(tmp_path: Path) -> None:
    target = '[[level]]\nname = "reduced"\nengine = "reduced"\n'
    head, tail = REDUCED[: REDUCED.index("[[level]]")], REDUCED[REDUCED.index("[confirm]") :]
    study = head + target + "[search]\nbudget = 20\npopulation_size = 6\n" + tail
    run(study, tmp_path / "run")
    before = evaluations(tmp_path / "run")
    said = run(study.replace("budget = 20", "budget = 26"), tmp_path / "run")
    assert f"{len(before)} runs made before are used" in said
    after, its = evaluations(tmp_path / "run"), open_run(tmp_path / "run")
    searched = [purpose for _, purpose, *_ in before].count("search")
    first = max(i for i, purpose, *_ in before if purpose == "search") + 1
    assert after[:first] == before[:first]
    assert [purpose for _, purpose, *_ in after].count("search") == searched + 6
    assert its.header["budgets"] == [20, 26]
    assert its.made < len(before) + len(after) - first  # of what follows, some is used again
    assert "nothing was left to do" in run(study.replace("= 20", "= 26"), tmp_path / "run")
    assert evaluations(tmp_path / "run") == after
