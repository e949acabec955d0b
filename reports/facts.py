"""What a run directory says, read once: for the pages, the screen and scripts."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from mfopt.campaign.store import RunDirectory
from reports import campaign
from reports.course import Course, course
from reports.plain import readable_run
from reports.result import Result, result
from reports.rows import Row, read_rows
from reports.sentence import objective_name
from reports.units import Display, display


@dataclass(frozen=True, slots=True, eq=False)
class Facts:
    """What the run directory says, reduced and evaluated; all text in it can be shown."""

    run: RunDirectory
    rows: tuple[Row, ...]
    result: Result | None
    steps: list[campaign.Step]
    course: Course | None  # of a search that says what its generations taught
    stages: list[campaign.Stage]
    costs: list[campaign.Cost]
    name: str  # of the objective, in words
    shown: Display  # how its values are shown

    @property
    def header(self) -> Mapping[str, Any]:
        """The run's header."""
        return self.run.header


def gather(run: RunDirectory) -> Facts:
    """Read a run directory once and evaluate it."""
    run = readable_run(run)
    rows, levels = read_rows(run), run.header["levels"]
    unit = str(run.header.get("objective_unit", "-"))
    top_work = levels[-1]["work"] if levels else None
    return Facts(
        run, rows,
        result(rows, [level["name"] for level in levels], run.insights),
        campaign.steps(run.generations, rows),
        course(run, rows),
        campaign.stages(run.generations, rows, top_work),
        campaign.costs(rows, top_work),
        objective_name(run.header),
        display(unit, [r.value for r in rows]),
    )  # fmt: skip
