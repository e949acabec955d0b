"""The report on drawn experiments counts what it says."""

from pathlib import Path

from benchmarks import lines
from benchmarks.calibration.drawn import report


def test_it_counts_intervals_that_hold_the_truth(tmp_path: Path) -> None:
    path = tmp_path / "drawn.jsonl"
    ranks = ((0.5, 0.97), (0.2, 0.5), (0.9, 0.04), (0.6, 0.5))
    for number, (friction, restitution) in enumerate(ranks):
        rank = {"friction": friction, "restitution": restitution}
        lines.append(path, {"name": "recovery-01", "draw": number, "rank": rank})
    assert report(path) == [
        "4 drawn experiments",
        "  friction: 50.0% in the 50% interval, 100.0% in the 90% interval",
        "  restitution: 50.0% in the 50% interval, 50.0% in the 90% interval",
        "  pooled: 75.0% in the 90% interval (+- 28.3%)",
    ]


def test_nothing_is_told_of_nothing(tmp_path: Path) -> None:
    assert report(tmp_path / "none.jsonl") == []
