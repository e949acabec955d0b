"""Run directories that hold every kind of number and text which a run can store."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from mfopt.arrays import AnyArray, Array, frozen
from mfopt.evaluation import Candidate, Evaluation, Generation, Insight, Purpose, Reference
from mfopt.outcome import Outcome
from mfopt.store import RunDirectory, create, open_run
from reports.design import Describe, DesignView

NUMBERS = (0.0, -0.0, 5e-324, -5e-324, 1e-310, 2.2e-308, 1e-30, 1e-9, 0.072, 1.0, -1.0, 450.0, 1e7,
           1e30, -1e30, 1e200, 1e300, 1.7976931348623157e308, -1.7976931348623157e308)  # fmt: skip
TEXTS = ("$\\foo$", "$", "[/]", "[bold]", "[/bold] [red", "a\x00b\x07\x1b[31m", "\ud800", "\ufffe",
         "\u202egnp", "\U0001f35a rice", "<b>&amp;</b>", "#panic()", "%s {0} {{x}}", "line\nline",
         "\r\n\t", "", " ", "\\", '"', "'", "_" * 300, "\u00b5m\u00b2", "\u7c73", "^{}_\\frac{")
PURPOSES: tuple[Purpose, ...] = (
    "search", "search", "search", "confirm best", "confirm baseline", "reference best",
    "reference baseline",
)  # fmt: skip


def nasty_run(path: Path, seed: int) -> RunDirectory:
    """A run of random shape whose numbers and texts are the worst that a journal holds."""
    rng = np.random.default_rng(seed)
    levels = [{"name": f"{i}{_text(rng)}", "engine": str(rng.choice(["numba", "command", "python"])),
               "grains": _maybe(rng, 300), "spheres_per_grain": _maybe(rng, 3),
               "work": abs(_number(rng))} for i in range(rng.integers(1, 4))]  # fmt: skip
    variables = []
    for i in range(rng.integers(1, 4)):
        lower, upper = sorted((_number(rng), _number(rng)))
        if not upper > lower:
            lower, upper = -abs(lower), 1.0
        variables.append({"name": f"{i}{_text(rng)}", "unit": _text(rng), "lower": lower,
                          "upper": float(upper)})  # fmt: skip
    baseline = _design(rng, variables)
    run = create(path, "study", {
        "mfopt_version": "0", "study": _text(rng), "created": _text(rng), "seed": 7,
        "versions": {_text(rng): _text(rng)}, "platform": _text(rng), "workers": 2,
        "variables": variables, "baseline": list(map(float, baseline)), "levels": levels,
        "objective": str(rng.choice(["dispersion", "filling_time", "returned"])),
        "objective_unit": str(rng.choice(["s", "-", "", "m", "rad", "$\\foo$", "[/]"])),
        "method": str(rng.choice(["assisted", "cma-es"])),
    })  # fmt: skip
    tame = rng.random() < 0.5  # numbers, and nasty ones seldom among them
    reference = Reference(levels[0]["name"] + "-yade", _text(rng), _text(rng))
    index, names = 0, [str(level["name"]) for level in levels]
    for number in range(1, rng.integers(1, 7)):
        level = names[min(number // 2, len(names) - 1)]
        why = f"level change to {level}: {_text(rng)}" if number % 2 == 0 else _text(rng)
        run.add_generation(Generation(number, level, 0, 0.2, 4, "dispersion", why))
        for _ in range(rng.integers(0, 4)):
            _add(run, rng, index, _design(rng, variables), str(rng.choice(names)), number,
                 "search", tame=tame)  # fmt: skip
            index += 1
        if rng.random() < 0.7:
            run.add_insight(Insight(
                number, float(rng.random()), int(rng.integers(0, 5)), level,
                tuple(map(float, _design(rng, variables))), _number(rng), abs(_number(rng)),
            ))  # fmt: skip
    for repeat in range(rng.integers(0, 4)):
        for purpose in PURPOSES[3 : 5 + 2 * (repeat == 0)]:
            where = reference.level if purpose.startswith("reference") else names[-1]
            _add(run, rng, index, baseline, where, 0, purpose, tame=tame, seed=1001 + repeat)
            index += 1
    if rng.random() < 0.5:
        run.add_reference(reference if rng.random() < 0.7 else Reference(why_not=_text(rng)))
    if rng.random() < 0.7:
        run.add_end(_text(rng))
    return open_run(path)


def nasty_view(seed: int) -> Describe:
    """A machine whose bounds are as bad as the numbers of the run; or none."""
    rng = np.random.default_rng(seed)
    corners = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.1, -0.2], [0.1, 0.1, -0.3]])
    triangles = np.array([[0, 1, 2], [1, 2, 3]])
    times = np.linspace(0.0, 0.6, 4)
    view = DesignView(
        label="", x=np.zeros(1), parts={"hopper": (corners, triangles)},
        motion_times=times, cup_positions=times, cup_velocities=np.ones(4),
        motion_points={"P1": (0.1, 0.1)}, notes=("Steep.",), bound_s=_number(rng),
        bound_any_s=_number(rng), grain_offsets=np.zeros((1, 3)), grain_radii=np.full(1, 0.002),
    )  # fmt: skip
    none: Callable[[Array], DesignView | None] = lambda x: None  # noqa: E731
    return (lambda x: view) if rng.random() < 0.6 else none


def _number(rng: np.random.Generator) -> float:
    return float(rng.choice(NUMBERS))


def _text(rng: np.random.Generator) -> str:
    return TEXTS[rng.integers(len(TEXTS))]


def _maybe(rng: np.random.Generator, value: int) -> int | None:
    return value if rng.random() < 0.5 else None


def _design(rng: np.random.Generator, variables: list[dict[str, object]]) -> Array:
    return frozen([float(v[rng.choice(["lower", "upper"])]) for v in variables])  # type: ignore[arg-type]


def _add(
    run: RunDirectory, rng: np.random.Generator, index: int, x: Array, level: str, number: int,
    purpose: Purpose, *, tame: bool, seed: int = 1,
) -> None:  # fmt: skip
    its = float(rng.uniform(0.05, 0.1)) if tame and rng.random() < 0.8 else _number(rng)
    work, cpu_s = abs(_number(rng)), abs(_number(rng))
    if rng.random() < 0.2:
        outcome = Outcome(x, level, seed, "crashed", _text(rng), {}, work, cpu_s)
        its = np.inf
    else:
        raw: dict[str, AnyArray] = {"f": np.array(its)} if rng.random() < 0.3 else _raw(rng)
        outcome = Outcome(x, level, seed, "finished", None, raw, work, cpu_s)
    run.add_evaluation(Evaluation(Candidate(index, x, level, seed, number, purpose), outcome, its))


def _raw(rng: np.random.Generator) -> dict[str, AnyArray]:
    """What a dosing run stores, with times and counts of any kind."""
    odd = (*NUMBERS, np.nan, np.inf, -np.inf)
    size = int(rng.choice([0, 1, 2, 3, 40]))
    times = np.sort(rng.uniform(0.2, 0.6, size))
    if size and rng.random() < 0.5:
        times[rng.integers(size)] = rng.choice(odd)
    counts = {n: np.array(float(rng.choice([0.0, 3.0, np.nan, 1e308])))
              for n in ("left_in_cup", "left_in_hopper", "grains")}  # fmt: skip
    raw = {"passage_times": times, "duration": np.array(float(rng.choice(odd))), **counts}
    if rng.random() < 0.3:
        speeds = rng.choice(odd, (2, 5))
        positions = rng.uniform(-0.2, 0.2, (2, 5, 3))
        positions[0, 0] = rng.choice(odd)
        raw |= {"snapshot_times": np.array([0.1, 0.2]), "snapshot_positions": positions,
                "snapshot_orientations": np.ones((2, 5, 4)), "snapshot_speeds": speeds}  # fmt: skip
    return raw
