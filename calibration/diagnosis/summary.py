"""What a diagnosis found, as numbers for reports and JSON."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from calibration.diagnosis.diagnose import Diagnosis, Examined
from calibration.diagnosis.joint import NOTHING
from calibration.diagnosis.library import Library
from calibration.diagnosis.words import in_words
from calibration.posterior import from_unit
from calibration.recordings.case import Case
from calibration.words import DETERMINED
from mfopt.arrays import Array
from mfopt.records import diagnosis as records
from mfopt.records.evaluation import Evaluation
from mfopt.records.rig import Channel

TAIL = 0.05  # of a 90 % interval
AT_END = 0.99  # strength from which an effect is at the end of its range


def summary(
    its: Diagnosis,
    case: Case,
    library: Library,
    channels: Mapping[str, Channel],
    learned: Sequence[Evaluation],
    confirming: Sequence[Evaluation],
) -> records.Diagnosis:
    """Sum up a diagnosis and the runs behind it."""
    found = its.examined
    verdict, compared = found.verdict, found.compared
    made = records.Diagnosis(
        name=case.name,
        kind=verdict.kind,
        effects=verdict.effects,
        probability=verdict.probability,
        why=verdict.why,
        likeliest=compared.likeliest.which.name,
        explained=verdict.explained,
        mismatch=found.test.probability,
        gain=found.test.gain,
        gain_at_5=found.test.gain_at_5,
        unexplained=verdict.unexplained,
        rest=found.rest,
        nothing=compared.probability(lambda which: which == NOTHING),
        other=compared.probability(lambda which: which.other),
        suspects=_suspects(found, library),
        parameters=_parameters(found, case),
        model=_model(found, case, library),
        places=tuple(
            records.Place(
                c.recording, c.channel, channels[c.channel].unit, c.start, c.end, c.low, c.high,
                c.difference, c.excess, c.probability, c.stands_out,
            )
            for c in found.cells
        ),
        votes=tuple(
            records.Vote(v.effect, v.recording, v.gain, v.against) for v in verdict.votes
        ),
        beside=_beside(its, channels),
        held_out=tuple(
            records.HeldOut(
                h.recording, h.before, h.before_range, h.after, h.after_range, h.decoy,
                h.decoy_name, h.discrepancy,
            )
            for h in found.held_out
        ),
        next=tuple(records.Next(s.experiment, s.channels, s.gain, s.apart) for s in its.next),
        consequence=None,
        library_runs=len(learned),
        runs=len(confirming),
        failed=sum(not e.outcome.finished for e in (*learned, *confirming)),
        cpu_s=sum(e.outcome.cpu_s for e in (*learned, *confirming)),
        words=[],
    )  # fmt: skip
    return replace(made, words=in_words(made))


def _suspects(its: Examined, library: Library) -> tuple[records.Suspected, ...]:
    nothing, likeliest = its.compared.nothing.log_evidence, its.compared.likeliest
    found = []
    single = [w for w in its.compared.weighed if len(w.which.suspects) == 1 and not w.which.other]
    for weighed in single:
        (suspect,) = weighed.which.suspects
        fit = likeliest if suspect in likeliest.which.suspects else weighed
        place = fit.which.suspects.index(suspect)
        strengths = [fit.strength(place, tail) for tail in (0.5, TAIL, 1.0 - TAIL)]
        if suspect.measuring:
            measuring = its.measuring[suspect.number]
            sizes, unit, meaning = (
                [measuring.size(s) for s in strengths], measuring.unit, measuring.meaning,
            )  # fmt: skip
        else:
            effect = library.effects[suspect.number]
            sizes, unit, meaning = (
                [effect.value(s) for s in strengths], effect.unit, effect.meaning,
            )  # fmt: skip
        like = {n for c in its.classes if suspect.name in c for n in c} - {suspect.name}
        found.append(
            records.Suspected(
                suspect.name, suspect.measuring, meaning, unit,
                its.compared.of(suspect.name), sizes[0], (min(sizes[1:]), max(sizes[1:])),
                weighed.log_evidence - nothing, tuple(sorted(like)), suspect.name in its.faint,
                abs(strengths[0]) >= AT_END,
            )
        )  # fmt: skip
    return tuple(sorted(found, key=lambda s: -s.probability))


def _parameters(its: Examined, case: Case) -> tuple[records.BaseParameter, ...]:
    d = len(case.parameters)
    before, after = (
        from_unit(case.parameters, its.joint.transform(np.median(w.draws[:, :d], axis=0)))
        for w in (its.compared.nothing, its.compared.likeliest)
    )
    return tuple(
        records.BaseParameter(p.name, p.unit, float(b), float(a))
        for p, b, a in zip(case.parameters, before, after, strict=True)
    )


def _model(its: Examined, case: Case, library: Library) -> tuple[records.Value, ...]:
    """The corrected simulation: medians and 90 % intervals of what is fitted."""
    best = its.compared.likeliest
    d = len(case.parameters)
    base = from_unit(case.parameters, its.joint.transform(best.draws[:, :d].T).T)
    found = [
        _value(p.name, p.unit, base[:, i], p.high - p.low) for i, p in enumerate(case.parameters)
    ]
    strengths = best.which.strengths(best.draws[:, d:])
    for suspect, column in zip(best.which.suspects, strengths.T, strict=False):
        if suspect.measuring:
            continue
        effect = library.effects[suspect.number]
        values = np.array([effect.value(float(s)) for s in column])
        found.append(_value(effect.varies, effect.unit, values, effect.high - effect.low))
        found += [
            records.Value(name, "-", value, (value, value), False)
            for name, value in effect.beside.items()
        ]
    return tuple(found)


def _value(name: str, unit: str, draws: Array, width: float) -> records.Value:
    low, middle, high = (float(v) for v in np.quantile(draws, (TAIL, 0.5, 1.0 - TAIL)))
    known = high - low < DETERMINED * (1.0 - 2.0 * TAIL) * width
    return records.Value(name, unit, middle, (low, high), known)


def _beside(its: Diagnosis, channels: Mapping[str, Channel]) -> tuple[records.Beside, ...]:
    seen, found = {s.name: s for s in its.examined.observations}, []
    for confirmed in its.confirmed:
        observed = seen[confirmed.recording]
        parts = [
            observed.split(row)
            for row in (observed.values, confirmed.before, confirmed.after, confirmed.sd)
        ]
        for block in observed.blocks:
            name = block.channel
            found.append(
                records.Beside(
                    observed.name, confirmed.held_out, name, channels[name].unit,
                    None if block.times is None else block.times.tolist(),
                    *(part[name].tolist() for part in parts),
                )
            )  # fmt: skip
    return tuple(found)
