"""Beginning a run in a directory, or going on with the one that it holds."""

import json
import os
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from mfopt.campaign.differences import Difference, differences, named
from mfopt.campaign.store import HELD, RunDirectory, clear, create, open_run
from mfopt.errors import ConfigError
from mfopt.records.evaluation import Reference
from mfopt.records.objective import OWN, Criteria

# Entries of the header that say what a run is. Others say when, where and by how many it is made.
MEANING = (
    "mfopt_version", "versions", "settings", "variables", "baseline", "conditions", "objective",
    "objective_settings", "objective_unit", "seed", "method", "levels",
)  # fmt: skip
REMEDY = "resume with what it was begun with, or give another directory"


def begin(
    path: Path,
    study: str,
    header: Mapping[str, Any],
    *,
    resume: bool,
    criteria: Criteria = OWN,
) -> RunDirectory:
    """Create the run directory, or make sure that it holds this very run.

    A run that is there may have a smaller budget, fewer generations or fewer seeds of the
    confirmation, or be a calibration to other recordings. Then it is extended: runs that were made
    are used wherever they are asked for again. A run of which nothing finished is begun anew,
    unless it is resumed as it is.
    To be called within `mfopt.campaign.store.writing`, so that of two starts only one goes on.

    Args:
        path: the run directory.
        study: text of the study file.
        header: what `mfopt.campaign.header.header` says of the run now.
        resume: go on with a run that is there.
        criteria: how its runs are judged.

    Raises:
        ConfigError: if runs have finished there and `resume` is off, if it is another one than
            `header` says, or if it cannot be written.
    """
    if not os.path.lexists(path / "run.json"):
        return create(path, study, header, criteria)
    run, now = open_run(path, criteria), json.loads(json.dumps(header))
    if "conditions" in now:  # those of levels that are gone stay: a name has them for good
        now["conditions"] = {**run.header.get("conditions", {}), **now["conditions"]}
    found = list(differences(_meaning(run.header), _meaning(now)))
    others = [difference for difference in found if not _goes_on(difference)]
    if run.nothing_finished and (others or not resume):
        clear(path)
        return create(path, study, header, criteria)
    if not resume:
        raise ConfigError(f"{path} {HELD}")
    if others:
        raise ConfigError(f"{path} holds another run than the one given: {named(others)}; {REMEDY}")
    if found:
        changed = {key: now[key] for key in ("settings", "conditions", "levels") if key in now}
        spent = budgets(run.header) + budgets(now)
        run.extend({**changed, "budgets": list(dict.fromkeys(spent))}, study)
    elif not _holds_its_study(run):
        run.extend({}, study)
    return run


def budgets(header: Mapping[str, Any]) -> list[float]:
    """Budgets that the search of a run was given, one after the other; none if it needs none.

    The search decides with the first until that is spent, then with the next. So an extended run
    begins with all that was made for the smaller budget.
    """
    budget = header.get("settings", {}).get("search", {}).get("budget")
    return list(header.get("budgets") or filter(None, [budget]))


def _meaning(header: Mapping[str, Any]) -> dict[str, Any]:
    """What a run is. Levels of a calibration come and go; their conditions say what they are."""
    gone = {"levels"} if "conditions" in header else set()
    return {key: header.get(key) for key in MEANING if key not in gone}


def _goes_on(difference: Difference) -> bool:
    """Whether a run can go on with this difference: all that was run stays what it is."""
    match difference.place:
        case (
            ("settings", "search", "budget")
            | ("settings", "search", "generations")
            | ("settings", "search", "generations", _)
            | ("settings", "search", "stage", _, "generations")
            | ("settings", "confirm", "seeds")
        ):
            old, new = difference.old, difference.new
            return isinstance(old, int | float) and isinstance(new, int | float) and new > old
        case ("settings", "fit"):
            return True
        case ("conditions", _):
            return difference.old is None
    return False


def _holds_its_study(run: RunDirectory) -> bool:
    try:
        run.study()
    except ConfigError:
        return False
    return True


def begin_reference(run: RunDirectory, now: Reference | None) -> None:
    """Note on which engine the reference runs are made, or why they are skipped.

    An engine that was missing when the run began may be there when it goes on.

    Raises:
        ConfigError: if a reference run has been made already, with another version.
    """
    if now is None or now == run.reference:
        return
    made = any(purpose.startswith("reference") for purpose in run.purposes)
    if made and now.why_not is None:
        before = asdict(run.reference) if run.reference else None
        changed = list(differences(before, asdict(now), ("reference",)))
        raise ConfigError(
            f"{run.path} has a reference run by another version: {named(changed)}; {REMEDY}"
        )
    if not made:
        run.add_reference(now)
