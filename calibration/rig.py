"""What calibration asks of a simulator: parameters, conditions and seed in, named series out."""

from collections.abc import Mapping
from typing import Protocol

from mfopt.records.effect import Effect
from mfopt.records.level import Level
from mfopt.records.rig import Channel, RigParameter

Conditions = Mapping[str, float | str]


class Rig(Protocol):
    """A simulator of the experiment: a scene of mfopt or the user's own program."""

    @property
    def channels(self) -> Mapping[str, Channel]:
        """Series over time and numbers that a run gives, by name."""

    @property
    def unsure(self) -> Mapping[str, tuple[float, float]]:
        """Ranges of parameters that are stated but not known exactly, by name.

        They are fitted too, so that an error in them does not end up in the others.
        """

    @property
    def possible(self) -> Mapping[str, Conditions]:
        """Conditions of further experiments that could be recorded, by what they are called."""

    @property
    def effects(self) -> Mapping[str, Effect]:
        """What may be missing: effects that a run can switch on, by name.

        Their parameters are parameters of the rig: `EFFECT`, or `EFFECT.PARAMETER` if there are
        several.
        """

    def parameter(self, name: str) -> RigParameter | None:
        """Range and unit of a parameter; None if the rig cannot know them.

        Raises:
            ConfigError: if the rig has no such parameter.
        """

    def doubts(self, conditions: Conditions) -> tuple[str, ...]:
        """Why a simulation under these conditions may be wrong, in words."""

    def level(self, name: str, conditions: Conditions, parameters: tuple[str, ...]) -> Level:
        """The simulator under these conditions.

        The design of the level is the value of each parameter, in that order. The raw results of a
        run hold `time` (s,) [s], each series (s,) and each number (0-d) by channel, SI units.

        Raises:
            ConfigError: if a condition is wrong.
        """
