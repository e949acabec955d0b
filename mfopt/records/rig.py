"""What a simulator of an experiment gives, and which of its numbers can be fitted."""

from dataclasses import dataclass

import numpy as np

from mfopt.errors import ConfigError

TIME = "time"  # name of the times (s,) [s] of all series in the raw results of a run


@dataclass(frozen=True, slots=True)
class Channel:
    """A quantity that a rig can give, as a series over time or as a number."""

    name: str
    unit: str  # SI; "-" for a pure number
    size: float  # typical largest value [unit]; recorded values far off it are refused
    can_vanish: bool = False  # True: values far below it are usual, and not refused

    def __post_init__(self) -> None:
        if not 0.0 < self.size < np.inf:
            raise ConfigError(
                f"channel {self.name!r}: size = {self.size:g} must be a finite number above 0; "
                "give the largest value that is usual"
            )


@dataclass(frozen=True, slots=True)
class RigParameter:
    """A number of the simulation that can be fitted."""

    low: float  # plausible range
    high: float
    unit: str  # SI; "-" for a pure number
    meaning: str
    log: bool = False  # its logarithm is what is spread evenly
