"""`mfopt evaluate`: one design once on one level."""

import json
from pathlib import Path
from typing import Annotated

import typer

from mfopt.commands.shared import FromRun, StudyFile, ValuesGiven, chosen_design
from mfopt.records.objective import Criteria, judged
from mfopt.records.outcome import Outcome
from mfopt.study.assemble import assemble, traced
from mfopt.study.material import read_with_material


def evaluate(
    study_file: StudyFile,
    level: Annotated[str | None, typer.Option(help="level; the target if left out")] = None,
    seed: Annotated[int, typer.Option(help="seed of the simulation", min=0)] = 1,
    settings: ValuesGiven = None,
    best_of: FromRun = None,
    trace: Annotated[
        Path | None, typer.Option(help="directory for VTK files of the grains (YADE)")
    ] = None,
) -> None:
    """Run one design once on one level and print what came out, as JSON.

    Quantities carry their units; terms, objective and raw are in SI units.
    """
    study, *_ = read_with_material(study_file)
    parts = assemble(study, where=str(study_file))
    x = chosen_design(parts.problem, settings or [], best_of)
    chosen = parts.all_levels[level or parts.ladder.top.name]
    if trace is not None:
        chosen = traced(chosen, trace)
    outcome = chosen.evaluate(x, seed=seed)
    terms = {}
    if outcome.finished:
        objective = parts.criteria.objective(study.problem.objective)
        outcome, _ = judged(objective, outcome)
    if outcome.finished:
        terms = objective.terms(outcome.raw)
    answer = {
        "design": parts.problem.named(x),
        "level": outcome.level,
        "seed": seed,
        "status": outcome.status,
        "why": outcome.why,
        "terms": terms,
        "objective": sum(terms.values()) if terms else None,
        "quantities": _shown(parts.criteria, outcome),
        "raw": {name: float(a) for name, a in outcome.raw.items() if a.ndim == 0},
        "work": outcome.work,
        "cpu_s": outcome.cpu_s,
    }
    typer.echo(json.dumps(answer, indent=2))
    if not outcome.finished:
        raise typer.Exit(1)


def _shown(criteria: Criteria, outcome: Outcome) -> dict[str, float]:
    """What an engineer asks of the run, by name and unit."""
    found = criteria.quantities_of(outcome)
    units = {its.name: its.shown for its in criteria.quantities}
    return {f"{name} [{units[name][1]}]": units[name][0] * it for name, it in found.items()}
