"""What a diagnosis learns of a rig before it sees any case: the library and its emulators.

    python -m benchmarks.concealed.learned [--rigs slot wedge] [--jobs 2]

makes the runs of the library, 20 to 60 minutes of one core for each rig. They are kept in
`results/`, packed (`benchmarks.lines`).
"""

import argparse
import sys
import tempfile
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from benchmarks.calibration.kept_runs import KeptRuns, kept_runs
from benchmarks.concealed.recordings import NOISE, recorded
from benchmarks.concealed.rigs import CHANNELS, RIGS, SETTINGS, case_text
from calibration.diagnosis.diagnose import joined, learned_from, suspected
from calibration.diagnosis.joint import Joint, Suspect
from calibration.runs import seeing
from mfopt.arrays import Array, frozen
from mfopt.records.evaluation import Candidate, Evaluation
from mfopt.study.case import AssembledCase, assemble_case
from mfopt.study.rig_library import AssembledLibrary, assemble_library

RESULTS = Path(__file__).parent / "results"
RUNS = 240  # of each experiment
FIRST_PLAIN = 2_000_000  # seed of the runs without any effect, which are not in the library
AMID = 0.5  # of the prior of a parameter that a truth does not have: what the case states


@dataclass(frozen=True, slots=True, eq=False)
class Learned:
    """Library and emulators of a rig."""

    shared: AssembledLibrary
    made: tuple[Evaluation, ...]
    suspects: tuple[Suspect, ...]
    joint: Joint  # of fitted recordings without any effect

    @property
    def dimensions(self) -> int:
        """How many base parameters there are."""
        return len(self.shared.library.parameters)

    def unit(self, base: Mapping[str, float]) -> Array:
        """The point (d,) of the cube of the priors, which are even for the parameters in `base`."""
        return np.array(
            [
                (base[p.name] - p.low) / (p.high - p.low) if p.name in base else AMID
                for p in self.shared.library.parameters
            ]
        )


def main(arguments: Sequence[str] | None = None) -> int:
    """Make the runs of the libraries."""
    parser = argparse.ArgumentParser(prog="learned", description="libraries of the two rigs")
    parser.add_argument("--rigs", nargs="*", choices=RIGS, default=list(RIGS))
    parser.add_argument("--jobs", type=int, default=2)
    given = parser.parse_args(arguments)
    for name in given.rigs:
        with _kept(name, given.jobs) as kept:
            made = _runs(assembled(name), kept)
            print(name, len(made), f"{sum(e.outcome.cpu_s for e in made):.0f} s of CPU")
    return 0


@cache
def learned(name: str) -> Learned:
    """A rig with its emulators; learned once in each process."""
    with _kept(name, 1) as kept:
        shared = assembled(name)
        made, plain = _runs(shared, kept), _plain(shared, kept)
    with tempfile.TemporaryDirectory() as folder:
        runs = {s.name: [plain[s.name]] * s.repeats for s in SETTINGS}
        path = written(Path(folder), name, recorded(runs, {}, 1), {})
        parts = assemble_case(path)
        seen, emulators = learned_from(
            parts.case, shared.library, shared.experiments, seeing(parts.case, parts.noises), made
        )
    measuring, whole = joined(parts.case, seen, emulators, parts.rig.channels)
    joint = whole.of(range(len(parts.case.fitted)))
    return Learned(shared, made, suspected(shared.library, measuring), joint)


def assembled(name: str) -> AssembledLibrary:
    """The library of a rig, from the case file of a case without recordings."""
    with tempfile.TemporaryDirectory() as folder:
        return assemble_library(_empty(Path(folder), name), further=False)


def written(folder: Path, rig: str, files: Mapping[str, str], noises: Mapping[str, float]) -> Path:
    """The folder of a case; gives the case file."""
    folder.mkdir(parents=True, exist_ok=True)
    for file, text in files.items():
        (folder / file).write_text(text)
    path = folder / "case.toml"
    path.write_text(case_text(folder.name, rig, noises))
    return path


def _empty(folder: Path, name: str) -> AssembledCase:
    times = np.linspace(0.0, 1.1, 100)
    run = {"time": times, **{c: 100.0 * NOISE[c] * (1.0 - times / 2.0) for c in CHANNELS}}
    runs = {s.name: [run] * s.repeats for s in SETTINGS}
    return assemble_case(written(folder, name, recorded(runs, {}, 1), {}))


def _kept(name: str, jobs: int) -> AbstractContextManager[KeptRuns]:
    return kept_runs(RESULTS / f"library-{name}.jsonl", CHANNELS, jobs)


def _runs(shared: AssembledLibrary, kept: KeptRuns) -> tuple[Evaluation, ...]:
    planned = shared.library.planned(list(shared.conditions), RUNS)
    return tuple(kept.evaluate(planned, shared.ladder))


def _plain(shared: AssembledLibrary, kept: KeptRuns) -> dict[str, Mapping[str, Array]]:
    """One run of each recording without any effect, the base parameters amid their ranges."""
    x = frozen(shared.library.design(np.full(len(shared.library.parameters), AMID), {}))
    asked = [
        Candidate(place, x, shared.experiments[s.name], FIRST_PLAIN + place, 0, "design")
        for place, s in enumerate(SETTINGS)
    ]
    made = kept.evaluate(asked, shared.ladder)
    return {s.name: e.outcome.raw for s, e in zip(SETTINGS, made, strict=True)}


if __name__ == "__main__":
    sys.exit(main())
