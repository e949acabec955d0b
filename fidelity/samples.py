"""Quantities over time, reduced during a run: what has passed a plane, and fill levels.

An engine looks at its grains about every millisecond and hands their places to `look`. The time at
which a grain passes a plane is interpolated between two looks. A sample is taken at the first look
at or after its time, so sampling changes no step of the run. Positions are not kept.

This file needs only numpy: YADE runs it in a Python of its own.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from fidelity.sound import require_numbers
from mfopt.arrays import Array, BoolArray, frozen
from mfopt.errors import ConfigError


@dataclass(frozen=True, slots=True)
class Plane:
    """A horizontal plane. A grain passes when its mass centre first comes down through it.

    A grain that starts below the plane (below the opening, if there is one) has passed at time 0.
    """

    z: float  # [m]
    # x from, x to, y from, y to [m]: a passage outside does not count; None: all count
    opening: tuple[float, float, float, float] | None = None

    def __post_init__(self) -> None:
        require_numbers("height of a plane [m]", np.asarray(self.z), ())
        if self.opening is not None:
            sides = np.asarray(self.opening)
            require_numbers("opening in a plane [m]", sides, (4,))
            require_numbers("sides of an opening [m]", sides[1::2] - sides[::2], (2,), above=0.0)


@dataclass(frozen=True, slots=True, eq=False)
class Columns:
    """Columns side by side along x, through the whole depth along y.

    The level of a column is the highest top of the spheres whose centres are in the column, or the
    floor where that is higher or no sphere is there.
    """

    edges: Array  # (c + 1,) [m] along x, increasing
    floors: Array  # (c,) [m] height of the floor

    def __post_init__(self) -> None:
        c = len(self.floors)
        if c == 0:
            raise ConfigError("0 columns have no level; give at least 1")
        require_numbers("edges of columns [m]", self.edges, (c + 1,))
        require_numbers("widths of columns [m]", np.diff(self.edges), (c,), above=0.0)
        require_numbers("floors of columns [m]", self.floors, (c,))


@dataclass(frozen=True, slots=True, eq=False)
class Samples:
    """What to reduce during a run, and when."""

    times: Array  # (s,) [s], increasing, from 0
    planes: tuple[Plane, ...] = ()
    columns: Columns | None = None

    def __post_init__(self) -> None:
        s = len(self.times)
        require_numbers("sampling times [s]", self.times, (s,))
        require_numbers(
            "steps between sampling times [s]", np.diff(self.times), (max(0, s - 1),), above=0.0
        )
        if s and self.times[0] < 0.0:
            raise ConfigError(
                f"first sampling time = {self.times[0]:g} s must be at least 0; leave it out"
            )


def check_samples(samples: Samples, *, duration: float, exit_z: float) -> None:
    """Refuse samples that a run of `duration` [s] cannot give, where grains leave at `exit_z` [m].

    Raises:
        ConfigError: if a time is after the end, or a plane is below the exit.
    """
    if len(samples.times) and samples.times[-1] > duration:
        raise ConfigError(
            f"last sampling time = {samples.times[-1]:g} s must be at most the run's "
            f"{duration:g} s; sample earlier or run longer"
        )
    for plane in samples.planes:
        if plane.z < exit_z:
            raise ConfigError(
                f"plane at z = {plane.z:g} m must be at least at the exit, {exit_z:g} m, where "
                "grains are taken out; raise the plane or lower the exit"
            )


def even_columns(x_from: float, x_to: float, width: float, floor: float = 0.0) -> Columns:
    """Columns of equal width from `x_from` to `x_to`, as near to `width` as fits [m].

    Args:
        x_from, x_to: ends along x [m].
        width: of a column: that of a grain [m].
        floor: height of the floor [m].
    """
    c = max(1, round((x_to - x_from) / width))
    return Columns(frozen(np.linspace(x_from, x_to, c + 1)), frozen(np.full(c, floor)))


def column_levels(columns: Columns, spheres: Array) -> Array:
    """Level (c,) [m] of each column, see `Columns`.

    Args:
        columns: see there.
        spheres: (m, 4) centres and radii [m].
    """
    column = np.searchsorted(columns.edges, spheres[:, 0], side="right") - 1
    here = (column >= 0) & (column < len(columns.floors))
    levels = columns.floors.copy()
    np.maximum.at(levels, column[here], (spheres[:, 2] + spheres[:, 3])[here])
    return levels


def level_means(columns: Columns, levels: Array) -> tuple[Array, Array, Array]:
    """Mean level over all columns, over the left half and over the right half, each (s,) [m].

    Left is towards smaller x. Columns count by their width; one that the middle cuts counts in
    both halves, by what is on either side.

    Args:
        columns: see there.
        levels: (s, c) [m].
    """
    edges = columns.edges
    widths = np.diff(edges)
    left = np.clip((edges[0] + edges[-1]) / 2 - edges[:-1], 0.0, widths)
    whole, low, high = (levels @ (w / w.sum()) for w in (widths, left, widths - left))
    return whole, low, high


def passage_times(plane: Plane, start: float, before: Array, end: float, after: Array) -> Array:
    """When grains came down through a plane, on a straight way at steady speed (n,) [s].

    Args:
        plane: see there.
        start, end: when the grains were at both places [s].
        before, after: (n, 3) mass centres [m].

    Returns:
        nan for a grain that did not pass, or not through the opening.
    """
    times = np.full(len(before), np.nan)
    through = np.flatnonzero((before[:, 2] >= plane.z) & (after[:, 2] < plane.z))
    one, two = before[through], after[through]
    part = (one[:, 2] - plane.z) / (one[:, 2] - two[:, 2])
    counts = _in_opening(plane, one + part[:, None] * (two - one))
    times[through[counts]] = (start + part * (end - start))[counts]
    return times


def _in_opening(plane: Plane, places: Array) -> BoolArray:
    """Which of the places (n, 3) [m] are above, in or below the opening (n,)."""
    if plane.opening is None:
        return np.ones(len(places), dtype=np.bool_)
    x_from, x_to, y_from, y_to = plane.opening
    x, y = places[:, 0], places[:, 1]
    return np.asarray((x >= x_from) & (x <= x_to) & (y >= y_from) & (y <= y_to))


def passed_share(passages: Array, masses: Array, times: Array) -> Array:
    """Share (s, p) of the grains' mass that has passed each plane until each time [-].

    Args:
        passages: (p, n) [s], nan for a grain that did not pass.
        masses: (n,) of the grains [kg].
        times: (s,) [s].
    """
    passed = passages[None] <= times[:, None, None]  # (s, p, n)
    return np.asarray(passed @ (masses / masses.sum()))


@dataclass
class Sampling:
    """What the looks saw so far; grown look by look."""

    samples: Samples
    places: Array  # (n, 3) [m] mass centres at the last look; where it left, for one that left
    passages: Array  # (p, n) [s] when each grain passed each plane, nan before
    due: list[float]  # [s] samples to come
    time: float = 0.0  # [s] of the last look
    times: list[float] = field(default_factory=list)  # [s] samples taken
    levels: list[Array] = field(default_factory=list)  # (c,) [m] of each of them


def begin(samples: Samples, places: Array, spheres: Callable[[], Array]) -> Sampling:
    """Look at the start: a grain that is below a plane, or below its opening, passed at time 0.

    Args:
        samples: see there.
        places: (n, 3) mass centres [m].
        spheres: gives centres and radii (m, 4) [m].
    """
    passages = np.full((len(samples.planes), len(places)), np.nan)
    for times, plane in zip(passages, samples.planes, strict=True):
        times[(places[:, 2] < plane.z) & _in_opening(plane, places)] = 0.0
    sampling = Sampling(samples, np.array(places), passages, samples.times.tolist())
    _take_due(sampling, spheres)
    return sampling


def look(sampling: Sampling, now: float, places: Array, spheres: Callable[[], Array]) -> None:
    """Note which grains passed a plane since the last look, and take the samples that are due.

    Args:
        sampling: is grown.
        now: [s].
        places: (n, 3) mass centres [m]; of a grain that left, where it was last seen.
        spheres: gives centres and radii (m, 4) [m] of the grains still there; called if needed.
    """
    for times, plane in zip(sampling.passages, sampling.samples.planes, strict=True):
        new = passage_times(plane, sampling.time, sampling.places, now, places)
        first = np.isnan(times)
        times[first] = new[first]
    sampling.time, sampling.places = now, places
    _take_due(sampling, spheres)


def _take_due(sampling: Sampling, spheres: Callable[[], Array]) -> None:
    number = int(np.searchsorted(sampling.due, sampling.time, side="right"))
    if number:
        _keep(sampling, [sampling.time] * number, spheres)
        del sampling.due[:number]


def _keep(sampling: Sampling, times: list[float], spheres: Callable[[], Array]) -> None:
    sampling.times += times
    columns = sampling.samples.columns
    if columns is not None:
        sampling.levels += [column_levels(columns, spheres())] * len(times)


def series(
    sampling: Sampling, masses: Array, spheres: Callable[[], Array], *, finished: bool
) -> Mapping[str, Array]:
    """What was asked for, over time.

    A run that finished early changes no more: samples still due show its end, at the times asked
    for. Of a run that failed, the samples end with the run.

    Args:
        sampling: after the last look.
        masses: (n,) of the grains [kg].
        spheres: gives centres and radii (m, 4) [m] of the grains still there.
        finished: whether the run did not fail.

    Returns:
        "sample_times" (s,) [s]; with planes "passed" (s, p), the share of the mass that has passed
        each of them, and "passage_times" (p, n) [s], nan for a grain that has not; with columns
        "levels" (s, c) [m].
    """
    if finished and sampling.due:
        _keep(sampling, sampling.due, spheres)
        sampling.due = []
    times = np.array(sampling.times)
    kept = {"sample_times": times}
    if sampling.samples.planes:
        kept["passed"] = passed_share(sampling.passages, masses, times)
        kept["passage_times"] = sampling.passages
    columns = sampling.samples.columns
    if columns is not None:
        kept["levels"] = np.array(sampling.levels).reshape(-1, len(columns.floors))
    return kept
