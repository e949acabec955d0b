"""Beginning a run, and going on with one: what may have changed in between."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mfopt.campaign.begin import begin, begin_reference, budgets
from mfopt.campaign.store import create, open_run
from mfopt.errors import ConfigError
from mfopt.records.evaluation import Candidate, Evaluation, Purpose, Reference
from mfopt.records.outcome import Outcome

HERE = Reference("fine-yade", "yade", "2023.02a")
NEWER = Reference("fine-yade", "yade", "2024.01")
MISSING = Reference(why_not="yade is not installed")


def made(purpose: Purpose) -> Evaluation:
    x = np.zeros(1)
    outcome = Outcome(x, "fine-yade", 1, "finished", None, {"f": np.asarray(0.5)})
    return Evaluation(Candidate(0, x, "fine-yade", 1, 0, purpose), outcome, 0.5)


def failed() -> Evaluation:
    its = made("search")
    outcome = replace(its.outcome, status="crashed", why="wrong function", raw={})
    return replace(its, outcome=outcome, objective=np.inf)


def noted(
    path: Path, *given: Reference | None, after: Evaluation | None = None
) -> Reference | None:
    """What a run says of its reference that was resumed with each of `given` in turn."""
    run = create(path, "", {})
    begin_reference(run, given[0])
    if after is not None:
        run.add_evaluation(after)
    for now in given[1:]:
        begin_reference(open_run(path), now)
    return open_run(path).reference


def test_what_is_noted_is_read_back(tmp_path: Path) -> None:
    assert noted(tmp_path / "a", HERE) == HERE
    assert noted(tmp_path / "b", MISSING) == MISSING
    assert noted(tmp_path / "c", None) is None


def test_it_is_noted_once(tmp_path: Path) -> None:
    noted(tmp_path / "a", HERE, HERE, HERE)
    assert (tmp_path / "a" / "journal.jsonl").read_text().count("reference") == 1


def test_an_engine_may_be_installed_later_or_changed_before_it_is_used(tmp_path: Path) -> None:
    search = made("search")
    assert noted(tmp_path / "a", MISSING, HERE, after=search) == HERE
    assert noted(tmp_path / "b", HERE, NEWER, after=search) == NEWER
    assert noted(tmp_path / "c", HERE, MISSING, after=search) == MISSING


def test_what_was_made_with_an_engine_stands_when_it_is_gone(tmp_path: Path) -> None:
    assert noted(tmp_path / "a", HERE, MISSING, after=made("reference best")) == HERE


def test_two_versions_are_not_mixed(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"version 2023\.02a \(now 2024\.01\)"):
        noted(tmp_path / "a", HERE, NEWER, after=made("reference best"))


def described(**changed: object) -> dict[str, object]:
    """What the header of a run says, as far as it is compared."""
    settings = {
        "search": {"budget": 20.0, "sigma": 0.2, "generations": {"c": 3}, "exchange": ("a", "b"),
                   "stage": [{"level": "c", "generations": 2}]},
        "confirm": {"seeds": 2},
    }  # fmt: skip
    return {
        "mfopt_version": "1", "versions": {"numpy": "2"}, "seed": 1, "method": "assisted",
        "variables": [{"name": "a", "lower": 0.0, "upper": 1.0, "unit": "-"}], "baseline": [0.5],
        "objective": "returned", "levels": [{"name": "c", "work": 1.0}], "settings": settings,
        "created": "now", "workers": 2, "study": "s",
    } | changed  # fmt: skip


def with_settings(table: str, **changed: object) -> dict[str, object]:
    settings = dict(described()["settings"])  # type: ignore[call-overload]
    return described(settings=settings | {table: settings[table] | changed})


def test_what_does_not_change_the_meaning_goes_on(tmp_path: Path) -> None:
    begin(tmp_path, "a = 1", described(), resume=False)
    now = described(created="later", workers=5, study="renamed")
    run = begin(tmp_path, "a = 1  # a comment", now, resume=True)
    assert (run.study(), run.header["workers"], run.kept) == ("a = 1", 2, 0)


@pytest.mark.parametrize(
    ("now", "message"),
    [
        (described(seed=2), r"seed 1 \(now 2\)"),
        (described(baseline=[0.4]), r"baseline 1 0\.5 \(now 0\.4\)"),
        (described(versions={"numpy": "3"}), r"versions numpy 2 \(now 3\)"),
        (described(variables=[{"name": "b", "lower": 0.0, "upper": 1.0, "unit": "-"}]),
         r"variables a name a \(now b\)"),
        (described(variables=[{"name": "a", "lower": -1.0, "upper": 1.0, "unit": "-"}]),
         r"variables a lower 0\.0 \(now -1\.0\)"),
        (described(levels=[{"name": "c", "work": 2.0}]), r"levels c work 1\.0 \(now 2\.0\)"),
        (described(levels=[{"name": "c", "work": 1.0}, {"name": "d"}]), r"levels d nothing \(now"),
        (described(method="cma-es", objective="other"), r"objective returned .*method assisted"),
        (with_settings("search", sigma=0.3), r"settings search sigma 0\.2 \(now 0\.3\)"),
        (with_settings("search", budget=10.0), r"settings search budget 20\.0 \(now 10\.0\)"),
        (with_settings("search", budget=None), r"settings search budget 20\.0 \(now nothing\)"),
        (with_settings("confirm", seeds=1), r"settings confirm seeds 2 \(now 1\)"),
    ],
)  # fmt: skip
def test_another_run_is_refused_by_what_differs(
    now: dict[str, object], message: str, tmp_path: Path
) -> None:
    begin(tmp_path, "", described(), resume=False).add_evaluation(made("search"))
    with pytest.raises(ConfigError, match=f"another run than the one given: .*{message}"):
        begin(tmp_path, "", now, resume=True)
    assert open_run(tmp_path).end is None


@pytest.mark.parametrize(
    "now",
    [with_settings("search", budget=30.0), with_settings("confirm", seeds=3),
     with_settings("search", generations={"c": 4}),
     with_settings("search", stage=[{"level": "c", "generations": 9}])],
)  # fmt: skip
def test_a_run_is_extended_by_what_asks_for_more(now: dict[str, object], tmp_path: Path) -> None:
    run = begin(tmp_path, "small", described(), resume=False)
    run.add_evaluation(made("search"))
    run.add_end("the budget is spent")
    run = begin(tmp_path, "large", now, resume=True)
    assert (len(run), run.kept, run.end, run.study()) == (0, 1, None, "large")
    again = run.use_again(replace(made("search").candidate, index=7, generation=2))
    assert again is not None
    assert (again.candidate.index, again.candidate.generation, again.objective) == (7, 2, 0.5)
    assert run.use_again(again.candidate) is None  # each is used once
    run = begin(tmp_path, "large", now, resume=True)
    assert [e.candidate.index for e in run.evaluations()] == [7]
    assert (run.made, run.kept, run.study()) == (1, 0, "large")
    np.testing.assert_equal(dict(run.header["settings"]), json.loads(json.dumps(now["settings"])))


def test_a_calibration_goes_on_with_other_recordings_and_never_mixes_conditions(
    tmp_path: Path,
) -> None:
    def calibration(fit: str, **conditions: float) -> dict[str, object]:
        by_level = {level: {"opening_mm": mm} for level, mm in conditions.items()}
        return described(settings={"fit": fit}, conditions=by_level)

    run = begin(tmp_path, "one", calibration("one", a=1.0, b=2.0), resume=False)
    run.add_evaluation(made("search"))
    run = begin(tmp_path, "two", calibration("two", a=1.0, c=3.0), resume=True)
    assert (run.kept, run.study()) == (1, "two")
    for again, message in (
        (calibration("two", a=1.0, c=4.0), r"conditions c opening_mm 3\.0 \(now 4\.0\)"),
        (calibration("one", a=1.0, b=9.0), r"conditions b opening_mm 2\.0 \(now 9\.0\)"),
    ):
        with pytest.raises(ConfigError, match=f"another run than the one given: {message}"):
            begin(tmp_path, "", again, resume=True)
    assert begin(tmp_path, "one", calibration("one", a=1.0, b=2.0), resume=True).kept == 1


@pytest.mark.parametrize(
    ("now", "resume"),
    [(described(seed=2), True), (described(seed=2), False), (described(), False)],
)
def test_a_run_of_which_nothing_finished_is_begun_anew(
    now: dict[str, object], resume: bool, tmp_path: Path
) -> None:
    begin(tmp_path, "wrong", described(), resume=False).add_evaluation(failed())
    run = begin(tmp_path, "right", now, resume=resume)
    assert (run.made, run.study(), run.header["seed"]) == (0, "right", now["seed"])
    run.add_evaluation(made("search"))
    assert open_run(tmp_path).made == 1


def test_a_run_of_which_nothing_finished_goes_on_as_it_is(tmp_path: Path) -> None:
    begin(tmp_path, "", described(), resume=False).add_evaluation(failed())
    assert begin(tmp_path, "", described(), resume=True).made == 1


def test_a_run_of_which_something_finished_is_kept(tmp_path: Path) -> None:
    run = begin(tmp_path, "", described(), resume=False)
    its = made("search")
    run.add_evaluation(failed())
    run.add_evaluation(replace(its, candidate=replace(its.candidate, index=1)))
    with pytest.raises(ConfigError, match="holds a run already; use --resume"):
        begin(tmp_path, "", described(), resume=False)
    assert open_run(tmp_path).made == 2


def test_budgets_are_spent_one_after_the_other(tmp_path: Path) -> None:
    begin(tmp_path, "", described(), resume=False).add_evaluation(made("search"))
    for budget in (30.0, 30.0, 45.0):
        run = begin(tmp_path, "", with_settings("search", budget=budget), resume=True)
    assert budgets(run.header) == budgets(open_run(tmp_path).header) == [20.0, 30.0, 45.0]
    with pytest.raises(ConfigError, match=r"budget 45\.0 \(now 30\.0\)"):
        begin(tmp_path, "", with_settings("search", budget=30.0), resume=True)


def test_a_lost_study_file_is_written_anew(tmp_path: Path) -> None:
    begin(tmp_path, "given", described(), resume=False).add_evaluation(made("search"))
    (tmp_path / "study.toml").unlink()
    run = begin(tmp_path, "given, with a comment", described(), resume=True)
    assert open_run(tmp_path).study() == "given, with a comment"
    assert run.use_again(made("search").candidate) is not None
