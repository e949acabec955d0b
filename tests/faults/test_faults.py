"""A few faults of every kind; `scripts/survive --long` tries hundreds of each."""

from pathlib import Path

import pytest

from faults.plans import SHORT, trials
from faults.table import Trial, losses, table


@pytest.mark.parametrize("kind", list(SHORT))
def test_nothing_is_lost(kind: str, tmp_path: Path) -> None:
    made = list(trials(kind, tmp_path, seed=1, numbers=SHORT[kind], jobs=1))
    assert losses(made) == []
    assert len(made) == len(SHORT[kind])


def test_the_table_counts_by_kind() -> None:
    made = [Trial("kill", "one", None), Trial("write", "two", "gone"), Trial("kill", "three", None)]
    rows = [line.split() for line in table(made).splitlines()]
    assert rows[1:] == [["kill", "2", "2", "0"], ["write", "1", "0", "1"]]
    assert losses(made) == ["write: two: gone"]
