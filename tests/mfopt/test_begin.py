"""Beginning a run, and going on with one: what may have changed in between."""

from pathlib import Path

import numpy as np
import pytest

from mfopt.begin import begin_reference
from mfopt.errors import ConfigError
from mfopt.evaluation import Candidate, Evaluation, Purpose, Reference
from mfopt.outcome import Outcome
from mfopt.store import create, open_run

HERE = Reference("fine-yade", "yade", "2023.02a")
NEWER = Reference("fine-yade", "yade", "2024.01")
MISSING = Reference(why_not="yade is not installed")


def made(purpose: Purpose) -> Evaluation:
    x = np.zeros(1)
    outcome = Outcome(x, "fine-yade", 1, "finished", None, {"f": np.asarray(0.5)})
    return Evaluation(Candidate(0, x, "fine-yade", 1, 0, purpose), outcome, 0.5)


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
