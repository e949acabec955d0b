"""What an experiment gave, as calibration keeps it: SI units, read-only arrays."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from mfopt.arrays import Array, BoolArray, frozen
from mfopt.errors import ConfigError


@dataclass(frozen=True, slots=True, eq=False)
class Series:
    """One channel over time."""

    channel: str
    times: Array  # (n,) [s], increasing
    values: Array  # (n,) in the channel's unit
    quantum: float  # step between neighbouring values that the file can show; 0: none found
    clipped: BoolArray  # (n,) True where the sensor was at its limit: the true value lies beyond

    def __post_init__(self) -> None:
        clipped = np.array(self.clipped, dtype=np.bool_)
        clipped.flags.writeable = False
        object.__setattr__(self, "times", frozen(self.times))
        object.__setattr__(self, "values", frozen(self.values))
        object.__setattr__(self, "clipped", clipped)
        if not self.times.shape == self.values.shape == clipped.shape or self.times.ndim != 1:
            raise ConfigError(
                f"series {self.channel!r}: {self.times.size} times, {self.values.size} values and "
                f"{clipped.size} marks of clipping must be equal in number; give one of each"
            )
        if not (np.all(np.diff(self.times) > 0.0) and np.all(np.isfinite(self.values))):
            raise ConfigError(
                f"series {self.channel!r}: times must increase and values must be finite; "
                "read the file with read_recordings, which mends or refuses it"
            )


@dataclass(frozen=True, slots=True, eq=False)
class Repeat:
    """One run of the experiment."""

    file: str  # as the case file names it; "" for numbers that the case file holds
    series: Mapping[str, Series]  # by channel
    scalars: Mapping[str, float] = field(default_factory=dict)  # by channel, in the channel's unit
    notes: tuple[str, ...] = ()  # what was mended on reading, one sentence each
    start_sd_s: float = 0.0  # [s] 1 sd of where time 0 of the experiment lies; inf: unknown
    header: tuple[str, ...] = ()  # of the columns of the file, as written


@dataclass(frozen=True, slots=True, eq=False)
class Recording:
    """An experiment under fixed conditions, run once or several times."""

    name: str
    conditions: Mapping[str, float | str]  # as the case file gives them; the rig knows their names
    repeats: tuple[Repeat, ...]  # at least one
    held_out: bool = False  # True: only predicted, never fitted

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the series of the repeats, sorted."""
        return tuple(sorted({name for repeat in self.repeats for name in repeat.series}))

    @property
    def scalars(self) -> tuple[str, ...]:
        """Names of the numbers of the repeats, sorted."""
        return tuple(sorted({name for repeat in self.repeats for name in repeat.scalars}))


@dataclass(frozen=True, slots=True)
class Noise:
    """Measurement noise of a channel: stationary, with autocovariance sigma^2 exp(-|dt| / time)."""

    channel: str
    sigma: float  # 1 sd, in the channel's unit
    autocorrelation_time: float  # [s]; 0: independent from sample to sample
    sigma_range: tuple[float, float]  # 90 % interval, or bounds if found from one recording
    found: str  # "from 3 repeats", also "... more than the 0.1 stated"; "bounded ..."; "stated"
