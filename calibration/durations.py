"""How long a recording lasts beside the simulation: a wrong unit of time is a factor of 1 000."""

from collections.abc import Iterator, Sequence

from calibration.recordings.records import Recording
from mfopt.errors import ConfigError
from mfopt.records.evaluation import Evaluation
from mfopt.records.rig import TIME

REFUSED = 100.0  # times as long: a wrong unit of time, or other conditions
NOTED = 10.0  # times as long: it may be meant, and little is compared
REMEDY = "the unit of the time column, or the conditions"


def check_durations(recording: Recording, made: Sequence[Evaluation]) -> None:
    """Refuse a recording that lasts far longer or far shorter than all runs of it.

    Raises:
        ConfigError: names both durations and what to correct.
    """
    for apart, said in _compared(recording, made):
        if apart >= REFUSED:
            raise ConfigError(
                f"recording {recording.name!r}: {said}: they are a factor of {apart:.4g} apart, "
                f"and {REFUSED:g} is the limit; correct {REMEDY}"
            )


def unlike_durations(recordings: Sequence[Recording], made: Sequence[Evaluation]) -> list[str]:
    """Recordings that are much shorter or longer than the simulation, one sentence a channel."""
    return [
        f"{recording.name}: {said}; only the time that both have is compared. If that is not "
        f"meant, check {REMEDY}"
        for recording in recordings
        for apart, said in _compared(recording, made)
        if apart > NOTED
    ]


def _compared(recording: Recording, made: Sequence[Evaluation]) -> Iterator[tuple[float, str]]:
    """For each channel the factor between its duration and those of the runs, and both in words."""
    ends = _ends(recording, made)
    for channel, recorded in _recorded(recording).items() if ends else ():
        if recorded <= 0.0:  # before the experiment: that they have no time in common is said
            continue
        apart = max(recorded / max(ends), min(ends) / recorded)
        yield (
            apart,
            (f"its {channel} lasts until {recorded:.4g} s, and the simulation until {_span(ends)}"),
        )


def _ends(recording: Recording, made: Sequence[Evaluation]) -> list[float]:
    """The ends of the runs of a recording that give series [s]."""
    runs = [e.outcome.raw for e in made if e.candidate.level == recording.name]
    return [float(raw[TIME][-1]) for raw in runs if TIME in raw and raw[TIME][-1] > 0.0]


def _recorded(recording: Recording) -> dict[str, float]:
    """The last time of each series [s], the shortest of the repeats."""
    return {
        channel: min(
            float(repeat.series[channel].times[-1])
            for repeat in recording.repeats
            if channel in repeat.series
        )
        for channel in recording.channels
    }


def _span(ends: Sequence[float]) -> str:
    first, last = f"{min(ends):.4g}", f"{max(ends):.4g}"
    return f"{last} s" if first == last else f"{first} to {last} s"
