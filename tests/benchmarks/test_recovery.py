"""The report on known experiments counts what it says."""

from pathlib import Path

from benchmarks import lines
from benchmarks.calibration.recovery import report


def line(rank: float, share: float, error: float) -> dict[str, object]:
    found = {"mean": 0.3, "share": share, "determined": share < 0.5}
    return {
        "name": "recovery-01", "kind": "recovery", "runs": 200, "truth": [0.3, 0.5, 0.1],
        "rank": [rank] * 4, "found": [found] * 4, "misfit": 10.0, "freedom": 20,
        "compared": [{"recording": "a", "channel": "level", "held_out": True, "error": error}],
        "fit_cpu_s": 10.0, "runs_cpu_s": 400.0,
    }  # fmt: skip


def test_it_counts_intervals_that_hold_the_truth(tmp_path: Path) -> None:
    path = tmp_path / "found.jsonl"
    for rank, share, error in ((0.5, 0.1, 1.0), (0.96, 0.2, 2.0), (0.99, 0.8, 1.0)):
        lines.append(path, line(rank, share, error))
    told = report(path)
    assert told[0] == "recovery: 3 experiments, 200 runs each"
    assert "friction: in the 90 % interval 1 of 3 (1 of 2 that are determined)" in told[1]
    assert "outside the 95 % interval 1; narrower than half the prior 2" in told[1]
    assert "median 1.00, root mean square 1.41, largest 2.00" in told[5]
