"""Run directories that hold every kind of number and text which a journal can hold."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from fidelity.scenes.dosing.objectives import criteria
from mfopt.arrays import AnyArray, Array, frozen
from mfopt.campaign.store import RunDirectory, create, open_run
from mfopt.records.evaluation import Candidate, Evaluation, Generation, Insight, Purpose, Reference
from mfopt.records.objective import OWN, judged
from mfopt.records.outcome import Outcome
from mfopt.records.view import Describe, DesignView, no_view

NUMBERS = (
    0.0, -0.0, 5e-324, -5e-324, 1e-310, 2.2e-308, 1e-30, 1e-9, 0.072, 1.0, -1.0, 450.0, 1e7, 1e30,
    -1e30, 1e200, 1e300, 1.7976931348623157e308, -1.7976931348623157e308,
)  # fmt: skip
NO_NUMBERS = (np.nan, np.inf, -np.inf)
TEXTS = (
    "$\\foo$", "$", "[/]", "[bold]", "[/bold] [red", "a\x00b\x07\x1b[31m", "\ud800", "\ufffe", "",
    "\u202egnp", "\U0001f35a rice", "<b>&amp;</b>", "#panic()", "%s {0} {{x}}", "line\nline", " ",
    "\r\n\t", "\\", '"', "'", "_" * 300, "\u00b5m\u00b2", "\u7c73", "^{}_\\frac{",
)  # fmt: skip
CONFIRMED: tuple[Purpose, ...] = ("confirm best", "confirm baseline")
REPEATED: tuple[Purpose, ...] = ("reference best", "reference baseline")

# Of a dosing run, and of a problem of the user's own.
CRITERIA = replace(criteria(), objectives={**criteria().objectives, **OWN.objectives})


class Nasty:
    """Draws what a run is made of; half of the runs have ordinary values with odd ones among them.

    Args:
        seed: of all draws.
    """

    def __init__(self, seed: int) -> None:
        self._rng = np.random.default_rng(seed)
        self._tame = self.often(0.5)

    def often(self, share: float) -> bool:
        return bool(self._rng.random() < share)

    def count(self, most: int) -> int:
        return int(self._rng.integers(most + 1))

    def number(self) -> float:
        return float(self._rng.choice(NUMBERS))

    def text(self) -> str:
        return TEXTS[self.count(len(TEXTS) - 1)]

    def one_of(self, names: list[str]) -> str:
        return names[self.count(len(names) - 1)]

    def value(self) -> float:
        return float(self._rng.uniform(0.05, 0.1)) if self._tame else self.number()

    def variable(self, i: int) -> dict[str, Any]:
        lower, upper = sorted((self.number(), self.number()))
        if lower == upper:
            lower, upper = -abs(lower), 1.0
        return {"name": f"{i}{self.text()}", "unit": self.text(), "lower": lower, "upper": upper}

    def level(self, i: int) -> dict[str, Any]:
        return {
            "name": f"{i}{self.text()}", "engine": self.one_of(["numba", "command", "python"]),
            "grains": 300 if self.often(0.5) else None,
            "spheres_per_grain": 3 if self.often(0.5) else None, "work": abs(self.number()),
        }  # fmt: skip

    def header(self) -> dict[str, Any]:
        variables = [self.variable(i) for i in range(1 + self.count(2))]
        return {
            "mfopt_version": "0", "study": self.text(), "created": self.text(), "seed": 7,
            "versions": {self.text(): self.text()}, "platform": self.text(), "workers": 2,
            "variables": variables, "baseline": list(map(float, self.design(variables))),
            "levels": [self.level(i) for i in range(1 + self.count(2))],
            "objective": self.one_of(["dispersion", "filling_time", "returned"]),
            "objective_unit": self.one_of(["s", "-", "", "m", "rad", "$\\foo$", "[/]"]),
            "method": self.one_of(["assisted", "cma-es"]),
        }  # fmt: skip

    def design(self, variables: list[dict[str, Any]]) -> Array:
        return frozen([v["lower"] if self.often(0.5) else v["upper"] for v in variables])

    def raw(self) -> dict[str, AnyArray]:
        """What a dosing run stores, with times and counts of any kind."""
        odd = np.array([*NUMBERS, *NO_NUMBERS])
        times = np.sort(self._rng.uniform(0.2, 0.6, int(self._rng.choice([0, 1, 2, 3, 40]))))
        if times.size and self.often(0.5):
            times[self.count(times.size - 1)] = self._rng.choice(odd)
        made: dict[str, AnyArray] = {
            name: np.array(self._rng.choice([0.0, 3.0, np.nan, 1e308]))
            for name in ("left_in_cup", "left_in_hopper", "grains")
        }
        made |= {"passage_times": times, "duration": np.array(self._rng.choice(odd))}
        if self.often(0.3):
            positions = self._rng.uniform(-0.2, 0.2, (2, 5, 3))
            positions[0, 0] = self._rng.choice(odd)
            made |= {
                "snapshot_times": np.array([0.1, 0.2]), "snapshot_positions": positions,
                "snapshot_orientations": np.ones((2, 5, 4)),
                "snapshot_speeds": self._rng.choice(odd, (2, 5)),
            }  # fmt: skip
        return made

    def evaluation(self, candidate: Candidate, objective: str) -> Evaluation:
        x, level, seed = candidate.x, candidate.level, candidate.seed
        work, cpu_s = abs(self.number()), abs(self.number())
        if self.often(0.2):
            outcome = Outcome(x, level, seed, "crashed", self.text(), {}, work, cpu_s)
            return Evaluation(candidate, outcome, np.inf)
        raw = {"f": np.array(self.value())} if objective == "returned" else self.raw()
        outcome = Outcome(x, level, seed, "finished", None, raw, work, cpu_s)
        with np.errstate(all="ignore"):
            return Evaluation(candidate, *judged(CRITERIA.objective(objective), outcome))


def nasty_run(path: Path, seed: int) -> RunDirectory:
    """A run of random shape with the worst numbers and texts."""
    its = Nasty(seed)
    header = its.header()
    run = create(path, "study", header, CRITERIA)
    names = [str(level["name"]) for level in header["levels"]]
    reference = Reference(f"{names[-1]}-yade", its.text(), its.text())
    index = 0
    for number in range(1, 1 + its.count(5)):
        level = names[min(number // 2, len(names) - 1)]
        why = its.text() if number % 2 else f"level change to {level}: {its.text()}"
        run.add_generation(Generation(number, level, 0, 0.2, 4, header["objective"], why))
        for _ in range(its.count(3)):
            x = its.design(header["variables"])
            candidate = Candidate(index, x, its.one_of(names), 1, number)
            run.add_evaluation(its.evaluation(candidate, header["objective"]))
            index += 1
        if its.often(0.7):
            x = its.design(header["variables"])
            mean, deviation = its.value(), abs(its.number())
            run.add_insight(
                Insight(number, 0.5, 3, level, tuple(map(float, x)), mean, deviation,
                        positive=mean > 0.0)
            )  # fmt: skip
    x = its.design(header["variables"])
    for repeat in range(its.count(3)):
        for purpose in CONFIRMED if repeat else (*CONFIRMED, *REPEATED):
            level = reference.level if purpose in REPEATED else names[-1]
            candidate = Candidate(index, x, level, 1001 + repeat, 0, purpose)
            run.add_evaluation(its.evaluation(candidate, header["objective"]))
            index += 1
    if its.often(0.5):
        run.add_reference(reference if its.often(0.7) else Reference(why_not=its.text()))
    if its.often(0.7):
        run.add_end(its.text())
    return open_run(path, CRITERIA)


def nasty_view(seed: int) -> Describe:
    """A machine whose bounds are as bad as the numbers of the run; or none."""
    its = Nasty(seed)
    corners = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.1, -0.2], [0.1, 0.1, -0.3]])
    times = np.linspace(0.0, 0.6, 4)
    view = DesignView(
        label="", x=np.zeros(1), parts={"hopper": (corners, np.array([[0, 1, 2], [1, 2, 3]]))},
        motion_times=times, motion_positions=times, motion_velocities=np.ones(4),
        motion_points={"P1": (0.1, 0.1)}, notes=("Steep.",), bound=its.number(),
        bound_any=its.number(), grain_offsets=np.zeros((1, 3)), grain_radii=np.full(1, 0.002),
    )  # fmt: skip
    return (lambda x: view) if its.often(0.6) else no_view
