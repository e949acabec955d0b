"""Invented run directories and designs: a fixture for reports, no result of any simulation."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fidelity.scenes.dosing.objectives import Weights, criteria
from mfopt.arrays import AnyArray, Array, frozen
from mfopt.campaign.store import RunDirectory, create, open_run
from mfopt.records.evaluation import Candidate, Evaluation, Generation, Insight, Purpose, Reference
from mfopt.records.objective import value
from mfopt.records.outcome import Outcome
from mfopt.records.view import DesignView, Mesh

MM = 1e-3
VARIABLES: list[tuple[str, float, float, str]] = [
    ("l1", 0.08, 0.18, "m"), ("w1", 0.06, 0.14, "m"), ("r1", 0.005, 0.045, "m"),
    ("s1", -0.04, 0.04, "m"), ("l2", 0.07, 0.15, "m"), ("w2", 0.05, 0.12, "m"),
    ("r2", 0.005, 0.04, "m"), ("s2", -0.03, 0.03, "m"), ("x1", 0.05, 0.45, "-"),
    ("y1", 0.1, 0.9, "-"), ("x2", 0.55, 0.95, "-"), ("y2", 0.1, 0.9, "-"), ("v", 0.2, 4.0, "-"),
]  # fmt: skip
BASELINE = np.array([
    0.133, 0.101, 0.025, 0.0, 0.112, 0.085, 0.025, 0.0, 0.25, 0.25, 0.75, 0.75, 1.0
])  # fmt: skip
OPTIMUM = np.array([
    0.151, 0.118, 0.031, 0.022, 0.124, 0.094, 0.028, 0.006, 0.30, 0.42, 0.70, 0.58, 1.3
])  # fmt: skip
LOWER = np.array([v[1] for v in VARIABLES])
UPPER = np.array([v[2] for v in VARIABLES])
LEVELS = [("reduced", 0, 2e5), ("bullet-300", 300, 6e7), ("yade-1000", 1000, 9e8)]
PLAN = [("reduced", 12, 24), ("bullet-300", 10, 12), ("yade-1000", 6, 10)]
REFERENCE = Reference("yade-1000-longdouble", "longdouble", "2022.01a")
CRITERIA = criteria(Weights(filling_time_limit_s=0.33))
STROKE, PERIOD, DROP = 0.4, 0.6, 0.56  # [m], [s], [m]


def header(variables: list[tuple[str, float, float, str]], baseline: Array) -> dict[str, Any]:
    return {
        "mfopt_version": "0.1.0", "study": "rice-synthetic", "created": "2020-02-03T04:05:06+00:00",
        "seed": 7, "versions": {"python": "3.11.2", "numpy": "2.1.0", "yade": "2023.02a"},
        "platform": "Linux, x86_64", "baseline": list(map(float, baseline)),
        "variables": [dict(zip(("name", "lower", "upper", "unit"), v, strict=True))
                      for v in variables],
        "levels": [{"name": n, "engine": n.split("-")[0], "grains": g or None,
                    "spheres_per_grain": 5 if g else None, "work": w} for n, g, w in LEVELS],
        "objective": "dispersion", "objective_unit": "s", "workers": 2,
        "objective_settings": dict(CRITERIA.settings),
    }  # fmt: skip


def passage_times(x: Array, grains: int, rng: np.random.Generator) -> Array:
    """Times that spread the more the farther `x` is from an invented optimum."""
    far = float(np.sqrt(np.mean(((x - OPTIMUM) / (UPPER - LOWER)) ** 2)))
    spread = (0.06 + 0.35 * far) * (1.0 + 0.02 * rng.standard_normal())
    u = np.sort(rng.beta(2.2, 2.6, grains))
    return np.asarray(0.27 + 4.8 * spread * u)


def dosing_raw(x: Array, grains: int, rng: np.random.Generator) -> dict[str, AnyArray]:
    stuck = int(rng.poisson(2.0)) if np.allclose(x, BASELINE) else 0
    times = passage_times(x, grains - stuck, rng)
    counts = {"grains": grains, "passed": grains - stuck, "left_in_cup": stuck,
              "left_in_hopper": 0, "lost": 0}  # fmt: skip
    return {"passage_times": times, "duration": np.array(1.2),
            **{name: np.array(n) for name, n in counts.items()}}  # fmt: skip


def snapshots(grains: int, rng: np.random.Generator) -> dict[str, AnyArray]:
    """A portion that leaves its cup and falls, with all its grains turned at random."""
    times = np.array([0.05, 0.2, 0.35, 0.5])
    cup = STROKE * np.interp(times / PERIOD, [0.0, 0.3, 0.7, 1.0], [0.0, 0.42, 0.58, 1.0])
    inside = rng.uniform([-0.06, -0.045, 0.003], [0.06, 0.045, 0.095], (grains, 3))
    leave = np.sort(rng.uniform(0.12, 0.42, grains))[np.argsort(np.argsort(inside[:, 2]))]
    fall = np.maximum(times[:, None] - leave, 0.0)
    positions = np.repeat(inside[None], len(times), axis=0)
    positions[..., 2] -= 0.5 * 9.81 * fall**2
    shrink = np.clip(1.0 + positions[..., 2] / 0.6, 0.6, 0.9)
    below = positions[..., 2] < 0.0
    positions[..., :2] *= np.where(below, shrink, 1.0)[..., None]
    positions[..., 0] += np.where(below, 0.01, cup[:, None] - 0.2)
    turns = rng.standard_normal((len(times), grains, 4))
    turns /= np.linalg.norm(turns, axis=-1, keepdims=True)
    speeds = np.where(below, 9.81 * fall, 0.6)
    gone = positions[..., 2] < -DROP
    positions[gone], turns[gone], speeds[gone] = np.nan, np.nan, np.nan
    return {"snapshot_times": times, "snapshot_positions": positions,
            "snapshot_orientations": turns, "snapshot_speeds": speeds}  # fmt: skip


def outcome(
    x: Array, level: str, seed: int, rng: np.random.Generator, *, pictures: bool
) -> Outcome:
    grains, work = next((g or 200, w) for n, g, w in LEVELS if n == level)
    if rng.random() < 0.02:
        return Outcome(
            x, level, seed, "crashed", "energy grew past 10 J at 0.12 s", {}, work / 3, 2
        )
    if rng.random() < 0.01:
        return Outcome(x, level, seed, "timed_out", "ended at its limit of 60 s", {}, work / 2, 60)
    raw = dosing_raw(x, grains, rng)
    if pictures:
        raw |= snapshots(grains, rng)
    cpu_s = work / 3e6 * (1.0 + 0.1 * rng.random())
    return Outcome(x, level, seed, "finished", None, raw, work * (0.9 + 0.2 * rng.random()), cpu_s)


def add(run: RunDirectory, candidate: Candidate, result: Outcome) -> Evaluation:
    evaluation = Evaluation(candidate, result, value(CRITERIA.objective("dispersion"), result))
    run.add_evaluation(evaluation)
    return evaluation


def fill(run: RunDirectory, *, generations: int, confirm: bool) -> None:
    """Write an invented search of at most `generations` generations into `run`."""
    rng = np.random.default_rng(3)
    index, number, centre, sigma = 0, 1, BASELINE, 0.2
    best = None
    for stage, (level, count, size) in enumerate(PLAN):
        for k in range(count):
            if number > generations:
                return
            why = "start" if number == 1 else f"level change to {level}" if k == 0 else ""
            why = "converged: tolx, tolfun" if number == 9 else why
            why = "y1 and y2 exchanged" if number == 17 else why
            run.add_generation(Generation(number, level, stage, sigma, size, "dispersion", why))
            made = []
            for _ in range(size):
                step = sigma * rng.standard_normal(13) * (UPPER - LOWER) * 0.7
                x = frozen(BASELINE if index == 0 else np.clip(centre + step, LOWER, UPPER))
                candidate = Candidate(index, x, level, 1 + k % 2, number)
                made.append(add(run, candidate, outcome(x, level, 1 + k % 2, rng, pictures=False)))
                index += 1
            best = min(made, key=lambda e: e.objective)
            centre = 0.75 * centre + 0.15 * best.candidate.x + 0.10 * OPTIMUM
            number, sigma = number + 1, max(0.03, sigma * 0.93)
    if not confirm or best is None:
        return
    for seed in range(1001, 1006):
        for purpose, x in (("confirm best", best.candidate.x), ("confirm baseline", BASELINE)):
            c = Candidate(index, frozen(x), "yade-1000", seed, 0, purpose)  # type: ignore[arg-type]
            raw = dosing_raw(x, 1000, rng) | snapshots(1000, rng)
            add(run, c, Outcome(c.x, c.level, seed, "finished", None, raw, 9e8, 300.0))
            index += 1
    run.add_reference(REFERENCE)
    repeats: list[tuple[Purpose, Array]] = [
        ("reference best", best.candidate.x),
        ("reference baseline", BASELINE),
    ]
    for purpose, x in repeats:
        c = Candidate(index, frozen(x), REFERENCE.level, 1001, 0, purpose)
        raw = dosing_raw(x, 1000, rng)
        add(run, c, Outcome(c.x, c.level, 1001, "finished", None, raw, 3e10, 9000.0))
        index += 1


def ring(length: float, width: float, radius: float, shift: float, z: float) -> Array:
    """Points (32, 3) of a rounded rectangle [m]."""
    corners = []
    for i, (sx, sy) in enumerate(((1, 1), (-1, 1), (-1, -1), (1, -1))):
        angle = np.pi / 2 * (i + np.linspace(0.0, 1.0, 8))
        cx, cy = sx * (length / 2 - radius), sy * (width / 2 - radius)
        corners.append(np.column_stack(
            (shift + cx + radius * np.cos(angle), cy + radius * np.sin(angle), np.full(8, z))
        ))  # fmt: skip
    return np.concatenate(corners)


def skin(rings: list[Array]) -> Mesh:
    """Triangles between consecutive rings of equally many points."""
    n, vertices = len(rings[0]), np.concatenate(rings)
    triangles = []
    for k in range(len(rings) - 1):
        for i in range(n):
            a, b = k * n + i, k * n + (i + 1) % n
            triangles += [(a, b, a + n), (b, b + n, a + n)]
    return vertices, np.array(triangles, dtype=np.int64)


def describe(x: Array) -> DesignView:
    """An invented machine whose hopper and motion follow from `x` (13,)."""
    hole, tube = (0.150, 0.115, 0.025, 0.0), (0.095, 0.070, 0.025, 0.0)
    sections = np.array([hole, x[:4], x[4:8], tube])
    heights = np.array([0.0, -80.0, -180.0, -260.0]) * MM
    z = np.linspace(0.0, -260.0, 14) * MM
    values = [np.interp(-z, -heights, sections[:, j]) for j in range(4)]
    hopper = [ring(*(float(v[i]) for v in values), float(z[i])) for i in range(len(z))]
    plate = [ring(0.75, 0.2, 0.025, 0.0, 0.0), ring(*hole, 0.0)]
    cup = [ring(0.13, 0.10, 0.02, -0.2, h) for h in (0.001, 0.099)]
    times = np.linspace(0.0, PERIOD, 121)
    knots = np.array([0.0, x[8], x[10], 1.0])
    position = STROKE * np.interp(times / PERIOD, knots, [0.0, x[9], x[11], 1.0])
    return DesignView(
        label="", x=x, parts={"cup": skin(cup), "plate": skin(plate), "hopper": skin(hopper),
                              "tube": skin([ring(*tube, h) for h in (-0.26, -0.56)])},
        moving=frozenset({"cup"}), mover="cup", backdrop=frozenset({"plate"}),
        clock="the start of the cycle", counted_at="the tube's end",
        bound_note="With this motion no hopper can fill faster: the physical lower bound.",
        motion_times=times, motion_positions=position,
        motion_velocities=np.gradient(position, times),
        motion_points={"P1": (PERIOD * x[8], STROKE * x[9]),
                       "P2": (PERIOD * x[10], STROKE * x[11])},
        notes=("The smallest wall angle to the vertical is 3.1°.", "The sheet is not developable."),
        bound=0.262, bound_any=0.187,
        grain_offsets=np.column_stack((np.linspace(-5.5, 5.5, 5) * MM, np.zeros(5), np.zeros(5))),
        grain_radii=np.full(5, 2.2 * MM),
    )  # fmt: skip


def dosing_run(path: Path, *, generations: int = 99, finished: bool = True) -> RunDirectory:
    """Write an invented dosing run and open it again."""
    text = 'name = "rice-synthetic"\n[search]\nseed = 7\n'
    run = create(path, text, header(VARIABLES, BASELINE), CRITERIA)
    fill(run, generations=generations, confirm=finished)
    if finished:
        run.add_end("the planned generations on every level are done")
    return open_run(path, CRITERIA)


def user_run(path: Path) -> RunDirectory:
    """Write an invented run of a user's own two variables, which stores nothing but `f`."""
    variables = [("a", -2.0, 2.0, "-"), ("pressure", 0.0, 5.0, "bar")]
    head = header(variables, np.array([1.5, 4.0])) | {
        "objective": "returned", "objective_unit": "-", "versions": {"python": "3.11.2"},
        "levels": [{"name": "mine", "engine": "python", "grains": None,
                    "spheres_per_grain": None, "work": 1.0}],
    }  # fmt: skip
    run = create(path, "", head)
    rng = np.random.default_rng(5)
    for number in range(1, 9):
        run.add_generation(Generation(number, "mine", 0, 0.5**number, 6, "returned"))
        for k in range(6):
            x = frozen(rng.normal([0.5, 2.0], 1.0 / number).clip([-2, 0], [2, 5]))
            f = float((x[0] - 0.5) ** 2 + (x[1] - 2.0) ** 2)
            out = Outcome(x, "mine", 1, "finished", None, {"f": np.array(f)}, 1.0, 0.01)
            candidate = Candidate(6 * number - 6 + k, x, "mine", 1, number)
            run.add_evaluation(Evaluation(candidate, out, f))
    run.add_end("the planned generations on every level are done")
    return open_run(path)


def assisted_run(path: Path, *, finished: bool = True) -> RunDirectory:
    """Write an invented run of the assisted search over two of the levels.

    Generation 1 and 2 are at the coarser level, 2 begins with a validation; 3 is at the finer one.
    The third design of generation 3 is recommended, and has not its lowest value.
    """
    head = header(VARIABLES, BASELINE)
    head |= {"levels": head["levels"][1:], "method": "assisted"}
    run = create(path, "", head, CRITERIA)
    rng, coarse, fine = np.random.default_rng(8), "bullet-300", "yade-1000"
    plan = [(1, coarse, [coarse] * 4), (2, coarse, [fine, coarse, coarse]), (3, fine, [fine] * 4)]
    why = {1: "start", 3: f"level change to {fine}: converged"}
    index = 0
    for number, level, where in plan:
        run.add_generation(
            Generation(number, level, number // 3, 0.2, 11, "dispersion", why.get(number, ""))
        )
        for k, run_at in enumerate(where):
            x = frozen(BASELINE + 0.01 * index * (OPTIMUM - BASELINE))
            raw = dosing_raw(x, 300, rng)
            raw["passage_times"] = raw["passage_times"] * (1.0 + 0.5 * (k == 2))
            out = Outcome(x, run_at, 1, "finished", None, raw, dict(
                (n, w) for n, _, w in LEVELS)[run_at], 1.0)  # fmt: skip
            add(run, Candidate(index, x, run_at, 1, number), out)
            index += 1
            if k == 2:
                recommended = tuple(map(float, x))
        run.add_insight(Insight(number, 0.9 / number, len(where), level, recommended, 0.1, 0.01))
    if finished:
        for seed in (1001, 1002, 1003):
            designs: list[tuple[Purpose, Array]] = [
                ("confirm best", frozen(recommended)), ("confirm baseline", BASELINE),
            ]  # fmt: skip
            for purpose, x in designs:
                out = Outcome(x, fine, seed, "finished", None, dosing_raw(x, 300, rng), 9e8, 1.0)
                add(run, Candidate(index, x, fine, seed, 0, purpose), out)
                index += 1
        run.add_end("the budget is spent")
    return open_run(path, CRITERIA)


@pytest.fixture
def make_assisted(tmp_path: Path) -> Callable[..., RunDirectory]:
    """Make a run of the assisted search, finished or broken off."""
    return lambda **kw: assisted_run(tmp_path / "assisted", **kw)


@pytest.fixture(scope="session")
def finished_run(tmp_path_factory: pytest.TempPathFactory) -> RunDirectory:
    """A finished and confirmed dosing run."""
    return dosing_run(tmp_path_factory.mktemp("finished") / "run")


@pytest.fixture
def make_run(tmp_path: Path) -> Callable[..., RunDirectory]:
    """Make a dosing run of so many generations, finished or broken off."""
    return lambda **kw: dosing_run(tmp_path / "run", **kw)


@pytest.fixture
def own_run(tmp_path: Path) -> RunDirectory:
    """A run of a user's own problem."""
    return user_run(tmp_path / "own")


@pytest.fixture(scope="session")
def machine() -> Callable[[Array], DesignView]:
    """The description of the invented machine."""
    return describe
