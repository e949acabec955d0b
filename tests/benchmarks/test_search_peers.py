"""Each light peer runs, repeats, and gets better; runs resume."""

from pathlib import Path

import pytest

from benchmarks.search.peers import PEERS, external
from benchmarks.search.peers.ladder import stalled
from benchmarks.search.peers.ours import planned_cmaes, run_search
from benchmarks.search.results import hit, read, result_file
from benchmarks.search.run import main, numbers
from benchmarks.search.suites import case_named

LADDERS = {"warm-start", "ladder-stall", "ladder-shares", "kendall-tau"}
LIGHT = ("pycma", "lq", "noise-handler", "lra", *sorted(LADDERS), "mfopt-cmaes")


@pytest.mark.parametrize("name", LIGHT)
@pytest.mark.parametrize("noise", ["n0", "n30"])
def test_a_peer_spends_its_budget_and_repeats(name: str, noise: str) -> None:
    case = case_named(f"ladder/f1/b0.3/{noise}", 1)
    budget = 60.0 * case.costs[-1] if name not in LADDERS else 25.0 * case.costs[-1]
    trace, again = (PEERS[name](case, budget, 1) for _ in range(2))
    assert trace.costs == again.costs
    assert trace.cells == again.cells
    assert 0.7 * budget < trace.cost <= budget
    spent = sum(n * c for n, c in zip(trace.runs, case.costs, strict=True))
    assert trace.cost == spent
    assert max(trace.cells) > 0
    if name in LADDERS:
        assert trace.runs[0] > 0
    elif name != "mfopt-cmaes":
        assert trace.runs[0] == 0


@pytest.mark.parametrize("name", ["pycma", "lq", "lra"])
def test_the_sphere_is_solved(name: str) -> None:
    trace = PEERS[name](case_named("bbob/f1/d10", 1), 4000.0, 1)
    assert hit(trace, 100) is not None
    assert trace.why == "solved"


def test_the_surrogate_of_lq_saves_runs_on_a_quadratic() -> None:
    case = case_named("bbob/f10/d10", 2)
    plain, lq = (hit(PEERS[name](case, 6000.0, 1), 60) for name in ("pycma", "lq"))
    assert plain is not None
    assert lq is not None
    assert lq < 0.6 * plain


def test_ladder_stall_climbs_to_the_target() -> None:
    case = case_named("ladder/f1/b0.3/n0", 1)
    trace = PEERS["ladder-stall"](case, 100.0 * case.costs[-1], 1)
    assert min(trace.runs) > 0


def test_the_short_plan_spends_half() -> None:
    case = case_named("ladder/f1/b0.3/n0", 1)
    trace = PEERS["ladder-short"](case, 2560.0, 1)
    assert min(trace.runs) > 0
    assert 1100 < trace.cost <= 1280


def test_stalled() -> None:
    falling = [100.0 - i for i in range(50)]
    assert not stalled(falling, 5, 0.01)
    assert stalled(falling + [51.0] * 6, 5, 0.01)
    assert not stalled([3.0] * 10, 5, 0.01)


def test_our_search_is_metered_like_the_peers() -> None:
    case = case_named("ladder/f1/b0.3/n0", 1)
    trace = run_search(planned_cmaes, case, 2560.0, 1)
    assert min(trace.runs) > 0
    assert trace.why == "the planned generations on every level are done"
    assert trace.slowest_s > 0.0


def test_numbers() -> None:
    assert numbers(["1-3", "7"]) == [1, 2, 3, 7]


def test_runs_resume(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["--suite", "noisy", "--peers", "pycma", "--cases", "noisy/f1-*", "--budget", "0.1"]
    assert main([*words, "--instances", "1-2", "--out", str(tmp_path)]) == 0
    assert "4 runs to do" in capsys.readouterr().out
    assert main([*words, "--instances", "1-3", "--out", str(tmp_path)]) == 0
    assert "2 runs to do" in capsys.readouterr().out
    results = list(read(result_file(tmp_path, "noisy", "pycma", 1)))
    assert len({(r.case, r.instance) for r in results}) == len(results) == 6
    assert main([*words, "--instances", "1", "101", "--out", str(tmp_path)]) == 2


def test_turbo_goes_down_and_repeats() -> None:
    case = case_named("bbob/f1/d10", 1)
    trace, again = (PEERS["turbo"](case, 60.0, 1) for _ in range(2))
    assert trace.cells == again.cells
    assert trace.cost == 60.0
    assert hit(trace, 10) is not None  # a third of the first gap; CMA-ES needs about as many


def test_a_missing_environment_is_named(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(external, "ROOT", tmp_path)
    with pytest.raises(FileNotFoundError, match="environments smac"):
        PEERS["smac"](case_named("bbob/f1/d10", 1), 60.0, 1)
