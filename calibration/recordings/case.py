"""What a case file says: parameters to find, what is known of the measuring, recordings."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from calibration.recordings.records import Recording


@dataclass(frozen=True, slots=True)
class Parameter:
    """A number of the simulation that the recordings are to determine.

    The prior is uniform over the range, or a normal distribution cut off at the ends of the range.
    If `log`, both are of the logarithm: the mean is then the median, `sd` over it a relative one.
    """

    name: str
    low: float
    high: float
    mean: float | None = None  # of the normal prior; None: uniform
    sd: float | None = None
    log: bool = False
    unit: str = "-"  # of the values above
    asked: bool = True  # False: left free because nobody knows it exactly


@dataclass(frozen=True, slots=True)
class Known:
    """What is known of how a channel is measured, 1 sd each; errors are constant in a recording."""

    offset: float = 0.0  # error of the zero, in the channel's unit
    scale: float = 0.0  # relative error of the scale
    noise: float | None = None  # measurement noise, in the channel's unit; None: found from data


@dataclass(frozen=True, slots=True, eq=False)
class Measurement:
    """What is known of clock and channels."""

    clock_error: float = 0.0  # relative error of the time scale, 1 sd
    channels: Mapping[str, Known] = field(default_factory=dict)

    def of(self, channel: str) -> Known:
        """What is known of a channel; nothing is said of one that the case file leaves out."""
        return self.channels.get(channel, Known())


@dataclass(frozen=True, slots=True, eq=False)
class Case:
    """A whole case: the rig, the parameters, the recordings and how they were measured."""

    name: str
    seed: int
    rig: Mapping[str, Any]  # a scene with settings, or the user's simulator; not checked here
    parameters: tuple[Parameter, ...]
    measurement: Measurement
    recordings: tuple[Recording, ...]

    @property
    def fitted(self) -> tuple[Recording, ...]:
        """The recordings that are fitted."""
        return tuple(recording for recording in self.recordings if not recording.held_out)

    @property
    def held_out(self) -> tuple[Recording, ...]:
        """The recordings that are only predicted."""
        return tuple(recording for recording in self.recordings if recording.held_out)
