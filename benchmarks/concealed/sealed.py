"""Concealed cases by YADE: what is missing is drawn, sealed, diagnosed, and only then revealed.

    python -m benchmarks.concealed.sealed draw 1 [--blocks 2]  # truths of batch 1, and their seal
    python -m benchmarks.concealed.sealed record 1             # by YADE: about 90 s for each case
    python -m benchmarks.concealed.sealed diagnose 1           # from the recordings alone
    python -m benchmarks.concealed.sealed reveal 1             # if truth and code are as sealed
    python -m benchmarks.concealed.sealed oracle 1             # fits that know the effects
    python -m benchmarks.concealed.sealed report

Truths come from the system's entropy and stay in `--work` until they are revealed. The seal in
`results/seals.jsonl` is the SHA-256 of salt and truths beside that of the code; it and the
recordings are committed before the first diagnosis. Batch 0 is open: it is for development.
"""

import argparse
import hashlib
import json
import secrets
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, replace
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from benchmarks import lines
from benchmarks.concealed.distance import differences
from benchmarks.concealed.found import line_of
from benchmarks.concealed.learned import RESULTS, Learned, learned, written
from benchmarks.concealed.oracle import oracle_error
from benchmarks.concealed.places import by_window
from benchmarks.concealed.recordings import NOISE, recorded
from benchmarks.concealed.rigs import CHANNELS, RIGS
from benchmarks.concealed.score import report
from benchmarks.concealed.truth import BLOCK, Truth, drawn_block, true_rows
from benchmarks.concealed.yade_runs import runs_of
from calibration.diagnosis.diagnose import examine, joined, learned_from, suspected
from calibration.diagnosis.measuring import measuring_effects
from calibration.observed import Observed
from calibration.runs import seeing
from mfopt.study.case import AssembledCase, assemble_case
from surrogates.series import SeriesEmulator

WORK = Path("runs") / "concealed"  # truths that are not revealed, and all of the open batch
OPEN = 0  # the batch for development
ROOT = Path(__file__).parents[2]
FROZEN = ("calibration", "surrogates", "fidelity", "benchmarks/concealed")


def main(arguments: Sequence[str] | None = None) -> int:
    """Do what the command line says."""
    parser = argparse.ArgumentParser(prog="sealed", description="concealed cases by YADE")
    commands = parser.add_subparsers(required=True)
    for name, do in (("draw", _draw), ("record", _record), ("diagnose", _diagnose),
                     ("reveal", _reveal), ("oracle", _oracle)):  # fmt: skip
        its = commands.add_parser(name)
        its.add_argument("batch", type=int)
        if do is _draw:
            its.add_argument("--blocks", type=int, default=1, help=f"of {len(BLOCK)} cases")
        its.add_argument("--jobs", type=int, default=2)
        its.add_argument("--work", type=Path, default=WORK)
        its.set_defaults(do=do)
    told = commands.add_parser("report")
    told.add_argument("--work", type=Path, default=WORK)
    told.add_argument("--open", action="store_true", help="of the open cases")
    told.set_defaults(do=_report)
    given = parser.parse_args(arguments)
    given.do(given)
    return 0


def _draw(given: argparse.Namespace) -> None:
    """Draw the truths of a batch and seal them."""
    path = _truths(given)
    if path.exists():
        sys.exit(f"the truths of batch {given.batch} are drawn: {path}")
    known = {name: learned(name) for name in RIGS}
    its = [
        truth
        for block in range(given.blocks)
        for truth in drawn_block(
            1000 * given.batch + len(BLOCK) * block, known, secrets.randbits(100)
        )
    ]
    content = json.dumps({"salt": secrets.token_hex(16), "truths": [asdict(t) for t in its]})
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(content)
    seal = {
        "batch": given.batch, "cases": [t.case for t in its],
        "truths": hashlib.sha256(content.encode()).hexdigest(), "code": code_digest(),
    }  # fmt: skip
    lines.append(_results(given) / "seals.jsonl", seal)
    print(seal["truths"])


def _record(given: argparse.Namespace) -> None:
    """Make the recordings of a batch by YADE."""
    file = _results(given) / f"recordings-{given.batch}.jsonl"
    there = {line["case"] for _, line in lines.read(file)}
    waiting = [t for t in _sealed(given) if t.case not in there]
    with ProcessPoolExecutor(given.jobs, mp_context=get_context("spawn")) as pool:
        for truth, (runs, cpu_s) in zip(waiting, pool.map(runs_of, waiting), strict=True):
            files = {} if runs is None else recorded(runs, measured(truth), truth.seed)
            noises = {} if truth.noise == 1.0 else {c: truth.noise * sd for c, sd in NOISE.items()}
            line = {"case": truth.case, "rig": truth.rig, "noises": noises, "files": files}
            lines.append(file, {**line, "cpu_s": round(cpu_s, 1)})
            print(truth.case, truth.rig, f"{cpu_s:.0f} s", "" if files else "failed", flush=True)


def measured(truth: Truth) -> dict[str, float]:
    """Strengths of the effects of measuring of a case."""
    names = {its.name for its in measuring_effects(CHANNELS, True)}
    return {name: s for name, s in truth.strengths.items() if name in names}


def _diagnose(given: argparse.Namespace) -> None:
    """Diagnose the recordings of a batch."""
    folder = _results(given)
    file = folder / f"found-{given.batch}.jsonl"
    there = {line["case"] for _, line in lines.read(file)}
    recordings = (line for _, line in lines.read(folder / f"recordings-{given.batch}.jsonl"))
    asked = [line for line in recordings if line["files"] and line["case"] not in there]
    with ProcessPoolExecutor(given.jobs, mp_context=get_context("spawn")) as pool:
        for line in pool.map(_found, asked):
            lines.append(file, line)
            print(line["case"], line["verdict"], *line["effects"], f"{line['cpu_s']:.0f} s",
                  flush=True)  # fmt: skip


def _found(line: dict[str, Any]) -> dict[str, Any]:
    """What a diagnosis finds in the recordings of one case."""
    its = learned(line["rig"])
    begun = time.process_time()
    parts, seen, emulators = _seen(line, its)
    found = examine(parts.case, its.shared.library, seen, emulators, parts.rig.channels)
    cpu_s = time.process_time() - begun
    return {
        "case": line["case"], **line_of(found, len(parts.case.fitted)), "cpu_s": round(cpu_s, 2)
    }  # fmt: skip


def _seen(
    line: dict[str, Any], its: Learned
) -> tuple[AssembledCase, list[Observed], list[SeriesEmulator]]:
    """The case of a line of recordings, and the emulators of its experiments."""
    with tempfile.TemporaryDirectory() as folder:
        parts = assemble_case(written(Path(folder), line["rig"], line["files"], line["noises"]))
        see = seeing(parts.case, parts.noises)
        shared = its.shared
        return parts, *learned_from(parts.case, shared.library, shared.experiments, see, its.made)


def _reveal(given: argparse.Namespace) -> None:
    """Put the truths of a batch beside what was found, if nothing was changed since the draw."""
    content = _truths(given).read_text()
    seals = [line for _, line in lines.read(_results(given) / "seals.jsonl")]
    (seal,) = (s for s in seals if s["batch"] == given.batch)
    if hashlib.sha256(content.encode()).hexdigest() != seal["truths"]:
        sys.exit("these are not the truths that were sealed")
    if code_digest() != seal["code"]:
        sys.exit("the code is not the one that was sealed")
    (_results(given) / f"truths-{given.batch}.json").write_text(content)


def _oracle(given: argparse.Namespace) -> None:
    """Fit the effects that are there, where truths are revealed and effects are in the library."""
    folder = _results(given)
    revealed = json.loads((folder / f"truths-{given.batch}.json").read_text())["truths"]
    truths = {truth["case"]: Truth(**truth) for truth in revealed if truth["strengths"]}
    file = folder / f"oracle-{given.batch}.jsonl"
    there = {line["case"] for _, line in lines.read(file)}
    recordings = (line for _, line in lines.read(folder / f"recordings-{given.batch}.jsonl"))
    asked = [
        (line, truths[line["case"]])
        for line in recordings
        if line["files"] and line["case"] in truths and line["case"] not in there
    ]
    with ProcessPoolExecutor(given.jobs, mp_context=get_context("spawn")) as pool:
        for line in pool.map(_known, asked):
            lines.append(file, line)
            print(line["case"], f"{line['oracle']:.2f}", flush=True)


def _known(asked: tuple[dict[str, Any], Truth]) -> dict[str, Any]:
    """Held-out error of an oracle, and how far the effects move each cell."""
    line, truth = asked
    its = learned(line["rig"])
    parts, seen, emulators = _seen(line, its)
    measuring, whole = joined(parts.case, seen, emulators, parts.rig.channels)
    suspects, count = suspected(its.shared.library, measuring), len(parts.case.fitted)
    effects = [s for s in suspects if s.name in truth.strengths]
    joint = whole.of(range(count))
    rows = true_rows(replace(its, joint=joint), truth.base, truth.strengths)
    return {
        "case": line["case"], "oracle": oracle_error(whole, seen, count, effects, its.dimensions),
        "true_cells": by_window(seen[:count], differences(joint, rows, its.dimensions)),
    }  # fmt: skip


def _report(given: argparse.Namespace) -> None:
    print("\n".join(report(list(_judged(given.work if given.open else RESULTS)))))


def _judged(folder: Path) -> Iterator[dict[str, Any]]:
    """Each case with its truth and what was found."""
    for path in sorted(folder.glob("truths-*.json")):
        batch = path.stem.rpartition("-")[2]
        found, known = (
            {line["case"]: line for _, line in lines.read(folder / f"{name}-{batch}.jsonl")}
            for name in ("found", "oracle")
        )
        for truth in json.loads(path.read_text())["truths"]:
            case, strengths = truth["case"], truth["strengths"]
            if case in found:
                told = {"truth": strengths, "true_strengths": strengths}
                yield {**truth, **told, **known.get(case, {}), **found[case]}


def _sealed(given: argparse.Namespace) -> list[Truth]:
    return [Truth(**truth) for truth in json.loads(_truths(given).read_text())["truths"]]


def _truths(given: argparse.Namespace) -> Path:
    return Path(given.work) / f"truths-{given.batch}.json"


def _results(given: argparse.Namespace) -> Path:
    """Where the results of a batch are kept: those of the open one beside the library."""
    return Path(given.work) if given.batch == OPEN else RESULTS


def code_digest() -> str:
    """SHA-256 of all source files that a diagnosis depends on."""
    total = hashlib.sha256()
    for folder in FROZEN:
        for path in sorted((ROOT / folder).rglob("*.py")):
            total.update(str(path.relative_to(ROOT)).encode() + b"\0" + path.read_bytes() + b"\0")
    return total.hexdigest()


if __name__ == "__main__":
    sys.exit(main())
