"""A bar that counts simulations."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TaskID,
    TextColumn,
    TimeRemainingColumn,
)

MAKING = "simulations"


@dataclass(frozen=True, slots=True)
class Count:
    """Simulations made so far, and what goes on meanwhile."""

    on: Console
    total: int
    bar: Progress
    task: TaskID

    @property
    def made(self) -> int:
        """Simulations made so far."""
        return round(self.bar.tasks[0].completed)

    def one(self, _: object) -> None:
        """Count one more."""
        self.bar.update(self.task, advance=1, description=MAKING)

    def pause(self, doing: str, line: str) -> None:
        """Say that no simulation is made for a while: at the bar, or as a line if none is shown."""
        self.bar.update(self.task, description=doing)
        if not self.on.is_terminal:
            self.on.print(f"{self.made} of {self.total} simulations are made; {line}")


@contextmanager
def counting(on: Console, total: int, *, hidden: bool) -> Iterator[Count]:
    """Show how many simulations are made."""
    columns = (
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn()
    )  # fmt: skip
    with Progress(*columns, console=on, disable=hidden) as bar:
        yield Count(on, total, bar, bar.add_task(MAKING, total=total))
