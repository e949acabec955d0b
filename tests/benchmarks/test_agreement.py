"""The agreement campaign: files, plan and verdicts, on made-up runs."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.engine import agreement
from benchmarks.engine.agreement import main, seeds_of
from benchmarks.engine.compare import Row, as_mapping, compare, comparison_table, samples
from benchmarks.engine.runs import Run, add_run, read_runs, runs_in
from benchmarks.engine.scenes import DESIGNS, portion_of, run_scene, scene_names
from fidelity.scenes.dosing.design import design, dosing_problem
from fidelity.scenes.dosing.settings import DosingSettings
from mfopt.errors import ConfigError

SCALE = {"yade": 1.0, "other": 1.3, "twin": 1.0}


def made_up(engine: str, scene: str, grains: int, seed: int) -> Run:
    """A run with 3 % of scatter; the engine `other` is slower by its scale."""
    rng = np.random.default_rng([seed, grains, len(engine), len(scene)])
    slow = SCALE[engine] * rng.normal(1.0, 0.03)
    times = np.sort(slow * rng.gamma(4.0, 0.1, grains))
    radii = np.linspace(0.0, 0.1, 5)
    raw = {
        "discharge": {"exit_times": times, "mass_flow_rate": 2 / slow, "grain_mass": 0.001},
        "heap": {"angle": 0.5 * slow, "radii": radii, "heights": slow * (0.1 - radii)},
        "silo": {"wall_share": 0.4 * slow},
        "dosing": {
            "passage_times": times, "grains": times.size, "left_in_cup": 0, "left_in_hopper": 0,
            "duration": 1.2,
        },
    }[scene.partition(":")[0]]  # fmt: skip
    arrays = {name: np.asarray(value) for name, value in raw.items()}
    return Run(engine, scene, grains, seed, "finished", None, arrays, 10.0, 2.0)


def campaign(*engines: str, scenes: tuple[str, ...], seeds: int = 8) -> list[Run]:
    return [
        made_up(engine, scene, 60, seed)
        for engine in engines
        for scene in scenes
        for seed in range(seeds)
    ]


def row_of(rows: list[Row], quantity: str) -> Row:
    return next(row for row in rows if row.quantity == quantity)


ALL = ("discharge", "heap", "silo", "dosing:wide")


def test_the_same_physics_is_no_difference_and_another_one_is() -> None:
    runs = campaign("yade", "twin", "other", scenes=ALL)
    same, apart = compare(runs, "yade", "twin"), compare(runs, "yade", "other")
    assert len(same) == len(apart) == 7
    assert {row.verdict for row in same} == {"no difference"}
    assert {row.verdict for row in apart} == {"different"}
    assert row_of(apart, "heap angle").difference.estimate == pytest.approx(0.3, abs=0.05)
    assert row_of(apart, "discharge rate").difference.estimate == pytest.approx(-0.23, abs=0.05)
    assert all(row.p_family >= row.p for row in same)


def test_too_few_runs_are_not_called_no_difference() -> None:
    # However far apart, three runs against three give a p-value of 0.1 at least.
    few = compare(campaign("yade", "other", scenes=("heap",), seeds=3), "yade", "other")
    assert [row.verdict for row in few] == ["too few runs to tell"]
    assert few[0].difference.low > 0.05  # the interval still tells


def test_failed_runs_are_counted_and_tell_nothing() -> None:
    runs = campaign("yade", "twin", scenes=("heap",))
    failed = replace(runs[0], seed=99, status="crashed", why="it exploded", raw={})
    (row,) = compare([*runs, failed], "yade", "twin")
    assert (row.runs, row.failed) == ((8, 8), (1, 0))
    (all_failed,) = samples([failed], "yade")
    assert (len(all_failed.numbers), all_failed.failed) == (0, 1)


def test_a_row_says_its_verdict_in_table_and_json() -> None:
    rows = compare(campaign("yade", "other", scenes=("heap",)), "yade", "other")
    table = comparison_table(rows, "yade", "other")
    assert table.splitlines()[-1].endswith("| different |")
    stored = json.loads(json.dumps(as_mapping(rows[0])))
    assert stored["verdict"] == "different"
    assert stored["inside"] is False
    assert stored["difference"]["low"] < stored["difference"]["estimate"]


def test_a_file_gives_back_its_runs_by_seed(tmp_path: Path) -> None:
    for seed in (12, 3):
        run = made_up("yade", "dosing:wide", 60, seed)
        add_run(tmp_path, replace(run, settings={"damping": 0.125, "depth": None}))
    assert [p.name for p in tmp_path.iterdir()] == ["yade-dosing-wide-60.jsonl"]
    back, last = runs_in(tmp_path)
    assert (back.engine, back.scene, back.grains, back.seed) == ("yade", "dosing:wide", 60, 3)
    assert last.seed == 12
    assert back.settings == {"damping": 0.125, "depth": None}
    same = made_up("yade", "dosing:wide", 60, 3)
    np.testing.assert_allclose(back.raw["passage_times"], same.raw["passage_times"], rtol=5e-6)
    assert back.raw["duration"].shape == ()


def test_a_line_that_was_cut_off_costs_no_other_run(tmp_path: Path) -> None:
    add_run(tmp_path, made_up("yade", "heap", 60, 1))
    (file,) = tmp_path.iterdir()
    file.write_text(file.read_text() + file.read_text()[:50])
    assert [run.seed for run in runs_in(tmp_path)] == [1]
    add_run(tmp_path, made_up("yade", "heap", 60, 2))
    assert [run.seed for run in runs_in(tmp_path)] == [1, 2]


def test_runs_of_another_machine_are_not_mixed_in(tmp_path: Path) -> None:
    for seed, width in ((1, 0.08), (2, 0.09)):
        run = replace(made_up("yade", "silo", 60, seed), settings={"width": width})
        add_run(tmp_path, run)
    with pytest.raises(ConfigError, match="settings"):
        read_runs([tmp_path])


def test_what_is_no_run_is_named(tmp_path: Path) -> None:
    (tmp_path / "other.jsonl").write_text('{"engine": "yade"}\n')
    with pytest.raises(ConfigError, match=r"other\.jsonl:1"):
        read_runs([tmp_path])
    (tmp_path / "other.jsonl").unlink()
    with pytest.raises(ConfigError, match="no runs"):
        read_runs([tmp_path])


def test_seeds_and_scenes_as_words() -> None:
    assert seeds_of(["1-3", "7"]) == [1, 2, 3, 7]
    with pytest.raises(ConfigError, match="1-x"):
        seeds_of(["1-x"])
    assert scene_names(["heap", "dosing"]) == ["heap", *(f"dosing:{name}" for name in DESIGNS)]
    with pytest.raises(ConfigError, match="mill"):
        scene_names(["mill"])


@pytest.fixture
def ran(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, str, int, int]]:
    """What the campaign runs, without an engine."""
    done: list[tuple[str, str, int, int]] = []

    def instead(engine: str, scene: str, grains: int, seed: int) -> Run:
        done.append((engine, scene, grains, seed))
        return made_up("yade", scene, grains, seed)

    class Installed:
        def version(self) -> str:
            return "1"

    named: Callable[[str], Installed] = lambda name: Installed()  # noqa: E731
    monkeypatch.setattr(agreement, "run_scene", instead)
    monkeypatch.setattr(agreement, "engine_named", named)
    return done


def test_a_campaign_goes_on_where_it_stopped(
    tmp_path: Path, ran: list[tuple[str, str, int, int]]
) -> None:
    command = ["run", "--engines", "yade", "--scenes", "heap", "silo", "--grains", "60"]
    assert main([*command, "--seeds", "1-2", "--out", str(tmp_path)]) == 0
    assert len(ran) == 4
    file = tmp_path / "yade-silo-60.jsonl"
    file.write_text(file.read_text().splitlines()[0] + "\n")
    assert main([*command, "--seeds", "1-3", "--out", str(tmp_path)]) == 0
    assert ran[4:] == [("yade", "silo", 60, 2), ("yade", "heap", 60, 3), ("yade", "silo", 60, 3)]


def test_the_report_prints_tables_and_draws_figures(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for run in campaign("yade", "twin", scenes=ALL, seeds=3):
        add_run(tmp_path, run)
    out = tmp_path / "report"
    assert main(["report", "--in", str(tmp_path), "--out", str(out)]) == 0
    assert "| heap | heap angle | 60 | 3 / 3 |" in capsys.readouterr().out
    names = {path.name for path in (out / "yade-twin").iterdir()}
    assert names == {"agreement.json", "discharge.svg", "heap.svg", "differences.svg"}
    assert len(json.loads((out / "yade-twin" / "agreement.json").read_text())) == 7


def test_an_unknown_engine_is_an_error_in_words(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["run", "--engines", "mill", "--scenes", "heap", "--grains", "60", "--seeds", "1"]
    assert main([*command, "--out", str(tmp_path)]) == 2
    assert "unknown engine 'mill'" in capsys.readouterr().err


def test_the_designs_can_be_built() -> None:
    settings = DosingSettings()
    problem = dosing_problem(settings)
    for values in DESIGNS.values():
        assert set(values) <= set(problem.names)
        own = dict(zip(problem.names, problem.baseline, strict=True)) | dict(values)
        design(settings, np.array([own[name] for name in problem.names]))


def test_every_portion_weighs_the_same() -> None:
    for grains in (300, 1000, 4600):
        assert portion_of(grains).mass == pytest.approx(1.0)


def test_a_scene_that_cannot_start_is_a_failed_run() -> None:
    # Three grains of 1 kg are too long for the cylinder.
    run = run_scene("bullet", "heap", 3, 1)
    assert run.status == "crashed"
    assert run.why is not None
    assert "use more grains" in run.why
