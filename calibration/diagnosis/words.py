"""What a diagnosis found, in words: the answer first, one sentence or two a line."""

from calibration.words import MISFIT
from mfopt.names import listed, with_unit
from mfopt.records.calibration import chance
from mfopt.records.diagnosis import Diagnosis, Place, Suspected

POSSIBLE = 0.05  # probability of an effect that is worth a sentence
PLACES = 3  # that are named


def in_words(its: Diagnosis) -> list[str]:
    """What an engineer wants to know; `its` has all other words."""
    return [
        *answer(its),
        *where(its),
        *votes(its),
        *held_out(its),
        *what_next(its),
        *so_what(its),
        f"{its.library_runs} simulations of the library, {its.runs} to confirm, {its.failed} "
        f"failed, {its.cpu_s:.0f} s of CPU",
    ]


def answer(its: Diagnosis) -> list[str]:
    """Whether something is missing, and what."""
    p = chance(its.mismatch)
    if its.kind == "nothing":
        lines = [
            "Nothing is missing that these recordings could show: recordings without any mismatch "
            f"look as bad with the probability {p}"
        ]
        if faint := [s.name for s in its.suspects if s.faint]:
            lines.append(f"These recordings cannot show at any plausible size: {listed(faint)}")
        return lines
    lines = list[str]()
    suspects = {s.name: s for s in its.suspects}
    if its.kind == "named":
        lines += [f"What is missing: {_suspect(suspects[name])}" for name in its.effects]
    elif its.kind == "set":
        lines.append(
            f"What is missing is {listed(its.effects, 'or')} ({100 * its.probability:.0f} % "
            f"together): {its.why}"
        )
        lines += [f"If it is {_suspect(suspects[name])}" for name in its.effects]
    elif its.kind == "partly" and its.explained is not None:
        share = "over 99" if its.explained > 0.99 else f"{100 * its.explained:.0f}"
        lines.append(
            f"What is missing is mainly {listed(its.effects, 'or')}, which explains {share} % of "
            f"the mismatch. Something more is missing: {its.why}"
        )
        lines += [f"If it is {_suspect(suspects[name])}" for name in its.effects]
    else:
        lines.append(f"What is missing is not known: {its.why}")
        if near := [s.name for s in its.suspects if s.probability > POSSIBLE]:
            lines.append(
                f"The nearest known effects are {listed(near)}; as long as what is missing is not "
                "known, their sizes mean nothing"
            )
    return [
        *lines,
        "Simulation and recordings differ: without a mismatch they would look as bad with the "
        f"probability {p}",
    ]


def _suspect(its: Suspected) -> str:
    size = with_unit(f"{its.size:.3g}", its.unit)
    low, high = (f"{v:.3g}" for v in its.interval)
    said = (
        f"{its.name} = {size} (90 % {low} to {high}): {its.meaning}; probability "
        f"{its.probability:.2f}"
    )
    if its.at_end:
        said += "; this is the end of its range: widen that, or the effect is not the right one"
    return f"{said}; these recordings hardly tell it from {listed(its.like)}" if its.like else said


def where(its: Diagnosis) -> list[str]:
    """The places that stand out, the clearest first."""
    if its.kind == "nothing":
        return []
    clear = sorted((p for p in its.places if p.stands_out), key=lambda p: -p.difference)
    if not clear:
        return ["No single place stands out: the mismatch shows in all recordings together"]
    lines = [f"Where: {'; '.join(map(place_in_words, clear[:PLACES]))}"]
    if its.rest is not None:
        these = "this place" if len(clear) == 1 else f"these {len(clear)} places"
        fits = "fits" if its.rest >= MISFIT else "does not fit either"
        lines.append(
            f"All that lies outside of {these}, fitted alone, {fits} "
            f"(probability of a larger misfit {chance(its.rest)})"
        )
    return lines


def place_in_words(its: Place) -> str:
    """A place, and by how much recordings and simulation differ there."""
    more = "higher" if its.excess > 0.0 else "lower"
    size = with_unit(f"{abs(its.excess):.2g}", its.unit)
    at = f" from {its.start:.3g} to {its.end:.3g} s" if its.end > its.start else ""
    return (
        f"{its.recording}, {its.channel}{at}, recorded {size} {more} than simulated "
        f"({its.difference:.1f} standard deviations)"
    )


def votes(its: Diagnosis) -> list[str]:
    """Recordings that speak against what is likely."""
    return [
        f"{v.recording} speaks against {v.effect}: from the other recordings it is predicted "
        f"worse with it (log density {v.gain:.1f})"
        for v in its.votes
        if v.against
    ]


def held_out(its: Diagnosis) -> list[str]:
    """Errors on recordings that took no part."""
    if its.kind == "nothing":
        return [
            f"{h.recording} (held out): predicted with an error of {h.before:.2f} standard "
            "deviations of its repeats"
            for h in its.held_out
        ]
    return [
        f"{h.recording} (held out): error {h.before:.2f} before, {h.after:.2f} with "
        f"{its.likeliest} (90 % {h.after_range[0]:.2f} to {h.after_range[1]:.2f}), in standard "
        f"deviations of its repeats; with {h.decoy_name} instead {h.decoy:.2f}, with a discrepancy "
        f"that has no name {h.discrepancy:.2f}"
        for h in its.held_out
    ]


def what_next(its: Diagnosis) -> list[str]:
    """What to record next, if hypotheses are left."""
    if its.kind in ("nothing", "named") or not its.next:
        return []
    best = its.next[0]
    return [
        f"To tell {best.apart[0]} from {best.apart[1]}, record next: {best.experiment}, "
        f"{listed(best.channels)} (expected log evidence {best.gain:.1f})"
    ]


def so_what(its: Diagnosis) -> list[str]:
    """What it changes for a machine."""
    found = its.consequence
    if found is None:
        return []
    lines = [
        f"Of {len(found.designs)} designs of the study {found.study} the order with the corrected "
        f"simulation has a rank correlation of {found.order:.2f} with that of before"
    ]
    if found.best_after == found.best_before:
        return [*lines, f"Design {found.best_before} remains the best of them"]
    lost = "" if found.lost is None else f", by {with_unit(f'{found.lost:.3g}', found.unit)}"
    return [*lines, f"Design {found.best_after} is better than {found.best_before} now{lost}"]
