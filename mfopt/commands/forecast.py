"""How long a run still takes, from the work that is left and the time that runs have taken."""

import math
import time
from collections.abc import Callable, Mapping

TELLING = 0.01  # of a full run: what is cheaper tells nothing of how long the others take
LEAST_USE = 0.2  # of the workers' time; a first pause must not multiply the forecast


class Forecast:
    """Learns the time per work of each level, and how busy the workers are kept.

    Work counts alike on all levels, so one without a run of its own takes the time per work of
    those that have one, unless they are too cheap to tell.

    Args:
        work: predicted work of one run, by level.
        full_run: that of the target level.
        workers: runs that are made at the same time.
        seconds_per_work: by level, where it is known beforehand.
        clock: gives the time [s].
    """

    def __init__(
        self,
        work: Mapping[str, float],
        *,
        full_run: float,
        workers: int,
        seconds_per_work: Mapping[str, float] | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._work, self._full_run, self._workers, self._clock = work, full_run, workers, clock
        self._known = dict(seconds_per_work or {})
        self._measured: dict[str, tuple[float, float]] = {}  # work and CPU time [s] of its runs
        self._began: float | None = None  # when the first run ended that tells
        self._busy_s = 0.0  # CPU time of the runs that ended since

    def learn(self, level: str, cpu_s: float) -> None:
        """Take notice of a run that took so long."""
        work, spent_s = self._measured.get(level, (0.0, 0.0))
        self._measured[level] = work + self._work[level], spent_s + cpu_s
        if not self._tells(level):
            return
        if self._began is None:
            self._began = self._clock()
        else:
            self._busy_s += cpu_s

    def seconds(self, left: Mapping[str, float]) -> float | None:
        """Time that so much work at each level takes [s]; None while nothing tells."""
        total_s = 0.0
        for level, work in left.items():
            if work > 0.0:
                rate = self._rate(level)
                if rate is None:
                    return None
                total_s += rate * work
        return total_s / (self._workers * self._use())

    def _tells(self, level: str) -> bool:
        return self._work[level] >= TELLING * self._full_run

    def _rate(self, level: str) -> float | None:
        """Seconds per work of a level."""
        work, spent_s = self._measured.get(level, (0.0, 0.0))
        if work > 0.0 and spent_s > 0.0:
            return spent_s / work
        if self._known.get(level, 0.0) > 0.0:
            return self._known[level]
        telling = [its for name, its in self._measured.items() if self._tells(name)]
        work, spent_s = sum(work for work, _ in telling), sum(spent for _, spent in telling)
        return spent_s / work if work > 0.0 and spent_s > 0.0 else None

    def _use(self) -> float:
        """Share of the workers' time that runs take, since the first that tells."""
        passed_s = 0.0 if self._began is None else self._clock() - self._began
        if passed_s <= 0.0 or self._busy_s <= 0.0:
            return 1.0
        return min(1.0, max(LEAST_USE, self._busy_s / (passed_s * self._workers)))


def time_to_go(seconds: float | None) -> str:
    """A forecast in words; empty where nothing is known."""
    if seconds is None or not math.isfinite(seconds):
        return ""
    minutes = seconds / 60.0
    if minutes < 1.0:
        return "under 1 min to go"
    if minutes < 90.0:
        return f"about {minutes:.0f} min to go"
    return f"about {minutes / 60.0:.3g} h to go"
