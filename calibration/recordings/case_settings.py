"""The case file (TOML), checked once: keys, types and limits, before any recording is read."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, ConfigDict, Field, field_validator, model_validator

from calibration.recordings.case import Parameter
from calibration.recordings.header import Layout
from mfopt.errors import ConfigError
from mfopt.files.toml_text import toml_tables, toml_text
from mfopt.limits import Bound, FileName, Name, Seed, Word
from mfopt.records.effect import Effect, EffectParameter
from mfopt.records.problem import LARGEST_BOUND
from mfopt.settings import Settings, checked

MOST_RECORDINGS = 1000
MOST_REPEATS = 1000
MOST_POSSIBLE = 20
MOST_EFFECTS = 30
NARROWEST_RANGE = 1e-9  # of the larger bound: below, numbers round to the bounds
NARROWEST_PRIOR, WIDEST_PRIOR = 1e-6, 1e6  # [of the range] 1 sd

Error = Field(default=0.0, ge=0.0)


def _flat(given: Any) -> Any:
    """Conditions in which `cup = { volume_ml = 900 }` is called `cup.volume_ml`."""
    if not isinstance(given, Mapping):
        return given
    flat: dict[str, Any] = {}
    for name, value in given.items():
        within = isinstance(value, Mapping)
        flat |= {f"{name}.{key}": its for key, its in value.items()} if within else {name: value}
    return flat


ConditionValues = Annotated[dict[Name, float | Name], BeforeValidator(_flat)]


class CaseHead(Settings):
    """What the case is called and which seed all its random draws follow from."""

    name: FileName
    seed: Seed = 1


class PriorSettings(Settings):
    """What is known of a parameter before the recordings, beside the range."""

    normal: tuple[float, float] = Field(strict=False)  # mean and standard deviation


class ParameterSettings(Settings):
    """A parameter that the recordings are to determine."""

    range: tuple[Bound, Bound] = Field(strict=False)
    prior: PriorSettings | None = None
    unit: Name = "-"  # of a parameter of the user's own program; a scene brings its units

    @model_validator(mode="after")
    def _ordered(self) -> "ParameterSettings":
        low, high = self.range
        if low >= high:
            raise ValueError(
                f"range = [{low:g}, {high:g}] must go from a smaller to a larger value; swap or "
                "widen it"
            )
        least = max(NARROWEST_RANGE * max(abs(low), abs(high)), 1.0 / LARGEST_BOUND)
        if high - low < least:
            raise ValueError(
                f"range = [{low!r}, {high!r}] must be at least {least:g} wide; widen it, or leave "
                "the parameter out and fix the value in the simulation"
            )
        if self.prior is not None:
            mean, sd = self.prior.normal
            if sd <= 0.0:
                raise ValueError(f"prior.normal: sd = {sd:g} must be above 0; raise it")
            if sd < NARROWEST_PRIOR * (high - low):
                raise ValueError(
                    f"prior.normal: sd = {sd:g} must be at least {NARROWEST_PRIOR:g} of the range, "
                    f"{NARROWEST_PRIOR * (high - low):g}; narrow the range around the mean"
                )
            if sd > WIDEST_PRIOR * (high - low):
                raise ValueError(
                    f"prior.normal: sd = {sd:g} must be at most {WIDEST_PRIOR:g} times the range, "
                    f"{WIDEST_PRIOR * (high - low):g}; leave the prior out: without it all of the "
                    "range is equally likely"
                )
            if not low <= mean <= high:
                raise ValueError(
                    f"prior.normal: mean = {mean:g} must lie in the range {low:g} to {high:g}; "
                    "widen the range"
                )
        return self

    def named(self, name: str) -> Parameter:
        """The record."""
        mean, sd = self.prior.normal if self.prior else (None, None)
        return Parameter(name, *self.range, mean, sd, unit=self.unit)


class EffectSettings(Settings):
    """A parameter of the user's program that switches on what may be missing."""

    range: tuple[Bound, Bound] = Field(strict=False)
    null: float = 0.0  # where the effect is absent
    unit: Name = "-"
    meaning: str = ""

    @model_validator(mode="after")
    def _around_null(self) -> "EffectSettings":
        low, high = self.range
        if not low <= self.null <= high or low >= high:
            raise ValueError(
                f"range = [{low:g}, {high:g}] must go from a smaller to a larger value and hold "
                f"null = {self.null:g}, at which the effect is absent; widen it, or give null"
            )
        return self

    def named(self, name: str) -> Effect:
        """The record."""
        its = EffectParameter(self.null, *self.range, self.unit, self.meaning or name)
        return Effect(name, {name: its}, "apparatus", "", "the case file")


class KnownSettings(Settings):
    """What is known of how one channel is measured; 1 sd each."""

    unit: str | None = None  # of offset, noise and limits; None: the SI unit of the channel
    offset: float = Error
    scale: float = Field(default=0.0, ge=0.0, le=10.0)
    noise: float | None = Field(default=None, gt=0.0)
    limits: tuple[float, float] | None = Field(default=None, strict=False)

    @model_validator(mode="after")
    def _ordered(self) -> "KnownSettings":
        if self.limits is not None and self.limits[0] >= self.limits[1]:
            raise ValueError(
                f"limits = [{self.limits[0]:g}, {self.limits[1]:g}] must go from a smaller to a "
                "larger value; swap them"
            )
        return self


class MeasurementSettings(Settings):
    """What is known of the clock; a table for each channel stands beside."""

    model_config = ConfigDict(extra="allow")

    clock_error: float = Field(default=0.0, ge=0.0, le=0.5)
    clock_offset_s: float | Literal["unknown"] | None = None  # None: judged from each file
    repeat_tolerance: float = Field(default=0.1, gt=0.0, le=10.0)

    @field_validator("clock_offset_s")
    @classmethod
    def _not_negative(cls, offset: float | str | None) -> float | str | None:
        if isinstance(offset, float) and offset < 0.0:
            raise ValueError(f"{offset:g} s must be at least 0; it is a standard deviation")
        return offset

    def known(self, where: str) -> dict[str, KnownSettings]:
        """What is known of channels, by name.

        Raises:
            ConfigError: if a table has a wrong key.
        """
        found = {}
        for name, table in (self.model_extra or {}).items():
            if not isinstance(table, dict):
                raise ConfigError(
                    f"{where}: unknown key 'measurement.{name}'; known are clock_error, "
                    "clock_offset_s, repeat_tolerance, and tables named after channels"
                )
            found[name] = checked(KnownSettings, table, where=f"{where}: measurement.{name}")
        return found


class CsvSettings(Settings):
    """How the CSV files are laid out, where their headers do not say it."""

    rename: dict[str, str] = Field(default_factory=dict)
    ignore: list[str] = Field(default_factory=list)
    frames_per_s: float | None = Field(default=None, gt=0.0, le=1e7)

    @property
    def layout(self) -> Layout:
        """The record."""
        return Layout(self.rename, tuple(self.ignore), self.frames_per_s)


class ScalarSettings(Settings):
    """A number of an experiment, once for each repeat."""

    values: list[float] = Field(min_length=1, max_length=MOST_REPEATS)
    unit: str


class RecordingSettings(Settings):
    """One experiment: its conditions, and files or numbers of each repeat."""

    name: Name
    conditions: ConditionValues = Field(default_factory=dict)
    files: list[Word] = Field(default_factory=list, max_length=MOST_REPEATS)
    rows: list[dict[str, float | str]] | None = None
    scalars: dict[str, ScalarSettings] = Field(default_factory=dict)
    held_out: bool = False

    @model_validator(mode="after")
    def _whole(self) -> "RecordingSettings":
        if not self.files and not self.scalars:
            raise ValueError(f"{self.name!r} has neither files nor scalars; give one of them")
        if self.rows is not None and len(self.files) not in (1, len(self.rows)):
            raise ValueError(
                f"{self.name!r} has {len(self.rows)} rows and {len(self.files)} files; give one "
                "file for all, or one for each"
            )
        counts = {len(scalar.values) for scalar in self.scalars.values()}
        if self.files:
            counts.add(len(self.sources))
        if len(counts) > 1:
            raise ValueError(
                f"{self.name!r} has {' and '.join(map(str, sorted(counts)))} repeats by files and "
                "scalars; give as many of each, or make two recordings"
            )
        sources = [(file, tuple(sorted(rows.items()))) for file, rows in self.sources]
        if len(set(sources)) < len(sources):
            raise ValueError(f"{self.name!r} names a file twice; each repeat is a run of its own")
        return self

    @property
    def sources(self) -> list[tuple[str, Mapping[str, float | str]]]:
        """File and choice of rows of each repeat."""
        rows = self.rows or [{} for _ in self.files]
        files = self.files * len(rows) if len(self.files) == 1 else self.files
        return list(zip(files, rows, strict=True))


class PossibleSettings(Settings):
    """An experiment that could be recorded next."""

    name: Name
    conditions: ConditionValues = Field(min_length=1)


class CaseSettings(Settings):
    """A whole case file. The table `rig` is checked by whoever makes the simulator."""

    case: CaseHead
    rig: dict[str, Any]
    parameters: dict[str, ParameterSettings] = Field(min_length=1, max_length=100)
    measurement: MeasurementSettings = MeasurementSettings()
    csv: CsvSettings = CsvSettings()
    recording: list[RecordingSettings] = Field(min_length=1, max_length=MOST_RECORDINGS)
    possible: list[PossibleSettings] = Field(default_factory=list, max_length=MOST_POSSIBLE)
    effects: dict[Name, EffectSettings] = Field(default_factory=dict, max_length=MOST_EFFECTS)

    @model_validator(mode="after")
    def _no_parameters(self) -> "CaseSettings":
        both = sorted({*self.effects} & {*self.parameters})
        if both:
            raise ValueError(
                f"effects: {', '.join(both)} is among the parameters too; what is always there is "
                "a parameter, what may be missing is an effect"
            )
        return self

    @model_validator(mode="after")
    def _named_apart(self) -> "CaseSettings":
        names = [p.name for p in self.possible]
        for name in names:
            if name in {r.name for r in self.recording} or names.count(name) > 1:
                raise ValueError(
                    f"possible: {name!r} is the name of another experiment too; rename one"
                )
        return self


def read_case_settings(path: Path) -> tuple[CaseSettings, str]:
    """Read a case file, without the recordings; return it with its text as given.

    Raises:
        ConfigError: if it cannot be read, is not TOML, or has a wrong, unknown or missing key.
    """
    text = toml_text(path, "case file", "give a TOML file")
    data = toml_tables(text, str(path))
    if "study" in data and "case" not in data:
        raise ConfigError(f"{path} is a study, not a case of a calibration; give it to mfopt run")
    return checked(CaseSettings, data, where=str(path)), text
