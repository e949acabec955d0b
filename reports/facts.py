"""The contents of a run directory, read once for the pages, the screen and scripts."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from mfopt.campaign.store import RunDirectory
from mfopt.records.objective import Quantity
from reports import campaign
from reports.course import Course, course
from reports.plain import readable_run
from reports.result import Result, result
from reports.rows import Row, read_rows
from reports.sentence import objective_name
from reports.units import Display, display


@dataclass(frozen=True, slots=True, eq=False)
class Facts:
    """The contents of a run directory, reduced and evaluated; all text is printable."""

    run: RunDirectory
    rows: tuple[Row, ...]
    result: Result | None
    steps: list[campaign.Step]
    course: Course | None  # of a search with insights
    stages: list[campaign.Stage]
    costs: list[campaign.Cost]
    name: str  # of the objective, in words
    shown: Display  # how its values are shown

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """What an engineer asks of a run, as far as runs of the study give it."""
        asked = self.run.criteria.quantities
        return tuple(q for q in asked if any(q.name in row.quantities for row in self.rows))

    @property
    def beside(self) -> Quantity | None:
        """The quantity that is shown beside the objective."""
        name = self.run.criteria.beside
        return next((q for q in self.quantities if q.name == name), None)

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
