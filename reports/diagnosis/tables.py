"""The tables of a diagnosis' report, as text ready to be set."""

from mfopt.records.calibration import chance
from mfopt.records.diagnosis import Diagnosis, Suspected
from reports.calibration.units import brief, with_unit, words

MOST_PLACES = 8
MOST_NEXT = 6
USES = {True: "camera or sensor", False: "grains or machine"}


def suspects(its: Diagnosis) -> list[list[str]]:
    """Effect, kind, probability, size, interval, evidence, what it is hardly told from."""
    return [
        [
            words(s.name), s.meaning, USES[s.measuring], f"{s.probability:.2f}", _size(s, s.size),
            f"{brief(s.interval[0])} to {_size(s, s.interval[1])}", f"{s.gain:.1f}",
            "too weak to be seen" if s.faint else ", ".join(map(words, s.like)) or "-",
        ]
        for s in its.suspects
    ]  # fmt: skip


def _size(its: Suspected, value: float) -> str:
    return with_unit(brief(value), its.unit)


def parameters(its: Diagnosis) -> list[list[str]]:
    """Parameter, value without the effect, value with it."""
    return [
        [p.name, *(with_unit(brief(value, 3), p.unit) for value in (p.before, p.after))]
        for p in its.parameters
    ]


def places(its: Diagnosis) -> list[list[str]]:
    """The clearest places: recording, channel, time, values, excess, difference, chance."""
    clear = sorted((p for p in its.places if p.stands_out), key=lambda p: -p.difference)
    lines = []
    for p in clear[:MOST_PLACES]:
        low, high, more = map(brief, (p.low, p.high, p.excess))
        lines.append(
            [
                p.recording, words(p.channel),
                with_unit(f"{brief(p.start)} to {brief(p.end)}", "s"),
                with_unit(f"{low} to {high}", p.unit), with_unit(more, p.unit),
                f"{p.difference:.1f}", chance(p.probability),
            ]
        )  # fmt: skip
    return lines


def votes(its: Diagnosis) -> list[list[str]]:
    """Effect, recording, log density gained, what the recording says."""
    return [
        [
            words(v.effect), v.recording, f"{v.gain:.1f}",
            "against" if v.against else "for" if v.gain > 0.0 else "undecided",
        ]
        for v in its.votes
    ]  # fmt: skip


def held_out(its: Diagnosis) -> list[list[str]]:
    """Recording, and errors before, after, with another effect, with a nameless discrepancy."""
    return [
        [
            h.recording, f"{h.before:.2f}",
            f"{h.after:.2f} ({h.after_range[0]:.2f} to {h.after_range[1]:.2f})",
            f"{h.decoy:.2f} ({words(h.decoy_name)})", f"{h.discrepancy:.2f}",
        ]
        for h in its.held_out
    ]  # fmt: skip


def next_recordings(its: Diagnosis) -> list[list[str]]:
    """Experiment, channels, expected log evidence, what it tells apart."""
    return [
        [n.experiment, ", ".join(map(words, n.channels)), f"{n.gain:.1f}",
         f"{words(n.apart[0])} from {words(n.apart[1])}"]
        for n in its.next[:MOST_NEXT]
    ]  # fmt: skip
