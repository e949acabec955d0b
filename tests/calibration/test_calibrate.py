"""A calibration as a whole, on a simulator with a closed form."""

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np
import pytest
from toy_rig import SCATTER, TIMES, Tank, level_of

from calibration import campaign as whole
from calibration.campaign import Campaign, calibrate, runs_of_each
from calibration.left_out import fits_without
from calibration.likelihood import likelihood, with_scores
from calibration.missed import missed
from calibration.offsets import offsets
from calibration.parts import EVERY_PART, Parts
from calibration.posterior import to_unit
from calibration.recordings.case import Case, Known, Measurement, Parameter
from calibration.recordings.noise import measurement_noise
from calibration.recordings.records import Noise, Recording, Repeat, Series
from calibration.runs import Evaluate
from calibration.summary import cut_short, summary
from mfopt.arrays import Array, frozen
from mfopt.errors import ConfigError, SimulationError
from mfopt.records.evaluation import Candidate, Evaluation
from mfopt.records.outcome import Outcome
from mfopt.records.problem import Problem, Variable
from mfopt.records.rig import TIME

PARAMETERS = (Parameter("rate", 0.1, 0.6), Parameter("sag", 0.0, 0.1))
NOISE = 0.004  # [m]
PROBLEM = Problem(tuple(Variable(p.name, p.low, p.high) for p in PARAMETERS), frozen([0.3, 0.05]))


def recording(
    name: str, start: float, truth: Array, rng: np.random.Generator, repeats: int = 3,
    *, held_out: bool = False, clock: float = 1.0,
) -> Recording:  # fmt: skip
    made = []
    times = np.linspace(0.0, 1.9, 150)
    for number in range(repeats):
        slow = SCATTER * rng.normal() * np.sin(np.pi * times / TIMES[-1])
        values = level_of(truth, start, clock * times) + slow + NOISE * rng.normal(size=len(times))
        series = Series("level", frozen(times), frozen(values), 0.0, np.zeros(len(times), bool))
        made.append(Repeat(f"{name}-{number}.csv", {"level": series}))
    return Recording(name, {"start": start}, tuple(made), held_out)


def case_of(
    truth: Array, seed: int, measurement: Measurement | None = None, clock: float = 1.0
) -> Case:
    rng = np.random.default_rng(seed)
    return Case(
        "tank", seed, {}, PARAMETERS, measurement or Measurement(),
        (recording("full", 0.5, truth, rng, clock=clock),
         recording("half", 0.2, truth, rng, clock=clock),
         recording("other", 0.35, truth, rng, held_out=True, clock=clock)),
    )  # fmt: skip


def evaluate(candidates: Sequence[Candidate], case: Case) -> list[Evaluation]:
    starts = {r.name: r.conditions for r in case.recordings}
    made = []
    for c in candidates:
        level = Tank().level(c.level, starts[c.level], ("rate", "sag"))
        made.append(Evaluation(c, level.evaluate(c.x, seed=c.seed), 0.0))
    return made


def noises_of(case: Case) -> dict[str, Noise]:
    known = case.measurement.of("level")
    return {"level": measurement_noise(case.recordings, "level", known)}


def campaign_of(case: Case, runs: int = 100) -> Campaign:
    return calibrate(case, noises_of(case), lambda c: evaluate(c, case), runs)


@pytest.fixture(scope="module", autouse=True)
def fewer_rounds() -> Iterator[None]:
    """Each round samples twice, which takes seconds."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(whole, "ROUNDS", 2)
        yield


@pytest.fixture(scope="module")
def truths() -> list[Array]:
    return [frozen(x) for x in ([0.35, 0.03], [0.25, 0.07], [0.45, 0.02])]


@pytest.fixture(scope="module")
def campaigns(truths: list[Array]) -> list[Campaign]:
    return [campaign_of(case_of(x, seed)) for seed, x in enumerate(truths, start=1)]


def test_the_truth_lies_in_the_intervals_and_these_are_narrow(
    truths: list[Array], campaigns: list[Campaign]
) -> None:
    held = 0
    for truth, campaign in zip(truths, campaigns, strict=True):
        interval = campaign.fitted.posterior.interval()
        held += int(np.sum((interval[:, 0] <= truth) & (truth <= interval[:, 1])))
        assert np.all(np.diff(interval, axis=1)[:, 0] < [0.05, 0.06])
    assert held >= 4  # of 6, at 90 %


def test_a_fit_says_that_it_missed_better_parameters(
    truths: list[Array], campaigns: list[Campaign]
) -> None:
    case = case_of(truths[0], 1)
    assert missed(campaigns[0], case, PROBLEM) == []
    (line,) = missed(replace(campaigns[0], misfit=1e6), case, PROBLEM)
    found = re.search(r"near rate = (\S+), sag = (\S+) have", line)
    assert found is not None
    assert np.allclose([float(found[1]), float(found[2])], truths[0], atol=0.05)


def test_the_model_fits_and_predicts_what_was_held_out(campaigns: list[Campaign]) -> None:
    for campaign in campaigns:
        case = case_of(frozen([0.3, 0.05]), 1)
        its = summary(campaign, case, PROBLEM, noises_of(case), Tank.channels)
        assert its.probability > 0.01
        assert {c.recording for c in its.compared if c.held_out} == {"other"}
        assert max(c.error for c in its.compared) < 2.5
        assert its.runs == 18 + 2 * 41
        assert all("not determined" not in line for line in its.words)


def test_a_clock_that_is_wrong_by_more_than_stated_does_not_fit() -> None:
    # A slow clock alone looks like a larger rate; the two fills contradict each other in the end.
    truth = frozen([0.35, 0.03])
    stated = Measurement(clock_error=0.0)
    strict = campaign_of(case_of(truth, 1, stated, clock=1.25))
    right = campaign_of(case_of(truth, 1, stated))
    off = np.abs(strict.fitted.posterior.mean - truth)
    assert off[0] > 2.0 * np.abs(right.fitted.posterior.mean - truth)[0]


def test_a_stated_error_of_the_clock_widens_the_interval(
    truths: list[Array], campaigns: list[Campaign]
) -> None:
    unsure = campaign_of(case_of(truths[0], 1, Measurement(clock_error=0.1)))
    widths = [
        np.diff(its.fitted.posterior.interval(), axis=1)[0, 0] for its in (campaigns[0], unsure)
    ]
    assert widths[1] > 1.5 * widths[0]


def test_the_zero_and_the_clock_that_were_off_are_found() -> None:
    off, fast = 0.03, 0.04  # [m], relative
    truth = frozen([0.35, 0.03])
    stated = Measurement(channels={"level": Known(offset=0.02)}, clock_error=0.04)
    case = case_of(truth, 1, stated, clock=1.0 - fast)
    case = replace(case, recordings=tuple(_raised(r, off) for r in case.recordings))
    campaign = campaign_of(case)
    its = {(o.recording, o.error): o for o in offsets(campaign.fitted, case, Tank.channels)}
    assert len(its) == 4
    for recording in ("full", "half"):
        zero, clock = its[recording, "zero of level"], its[recording, "speed of the clock"]
        assert (zero.unit, zero.stated, clock.unit) == ("m", 0.02, "-")
        assert abs(zero.found - off) < 2.5 * zero.sd
        assert abs(clock.found - fast) < 2.5 * clock.sd
        assert zero.sd < 0.02
        assert clock.sd < 0.04
    right = case_of(truth, 1)
    assert offsets(campaign_of(right).fitted, right, Tank.channels) == ()


def _raised(its: Recording, by: float) -> Recording:
    repeats = []
    for repeat in its.repeats:
        level = repeat.series["level"]
        raised = replace(level, values=frozen(level.values + by))
        repeats.append(replace(repeat, series={"level": raised}))
    return replace(its, repeats=tuple(repeats))


def test_failed_runs_are_left_out(campaigns: list[Campaign]) -> None:
    failed = [e for c in campaigns for e in c.evaluations if not e.outcome.finished]
    assert failed


def test_a_simulator_that_mostly_fails_is_named() -> None:
    case = case_of(frozen([0.35, 0.03]), 1)

    def crashing(candidates: Sequence[Candidate]) -> list[Evaluation]:
        return [
            Evaluation(c, Outcome(c.x, c.level, c.seed, "crashed", "no tank"), np.inf)
            for c in candidates
        ]

    noises = {"level": measurement_noise(case.recordings, "level", case.measurement.of("level"))}
    with pytest.raises(SimulationError, match="no tank"):
        calibrate(case, noises, crashing, 100)


def test_too_few_runs_are_refused_with_the_least_number() -> None:
    case = case_of(frozen([0.35, 0.03]), 1)
    with pytest.raises(ConfigError, match="at least 41"):
        runs_of_each(case, 40)
    assert runs_of_each(case, 41) == 16


@pytest.mark.parametrize(("recordings", "runs"), [(1, 1), (7, 100), (40, 800)])
def test_the_least_number_that_is_named_is_enough(recordings: int, runs: int) -> None:
    one = case_of(frozen([0.35, 0.03]), 1).recordings[0]
    made = tuple(replace(one, name=f"{number}") for number in range(recordings))
    case = replace(case_of(frozen([0.35, 0.03]), 1), recordings=made)
    with pytest.raises(ConfigError, match="too few") as error:
        runs_of_each(case, runs)
    least = int(str(error.value).rpartition(" ")[2])
    assert runs_of_each(case, least) == 16
    with pytest.raises(ConfigError, match="too few"):
        runs_of_each(case, least - 1)


def test_too_many_runs_are_refused_with_the_largest_number() -> None:
    case = case_of(frozen([0.35, 0.03]), 1)
    with pytest.raises(ConfigError, match="at most 2018"):
        runs_of_each(case, 10_000)
    assert runs_of_each(case, 2018) == 1000


def test_a_calibration_repeats_bit_for_bit(campaigns: list[Campaign], truths: list[Array]) -> None:
    again = campaign_of(case_of(truths[0], 1))
    assert np.array_equal(again.fitted.posterior.draws, campaigns[0].fitted.posterior.draws)


def test_a_simulator_that_mostly_lacks_a_recorded_channel_is_named() -> None:
    case = case_of(frozen([0.35, 0.03]), 1)

    def silent(candidates: Sequence[Candidate]) -> list[Evaluation]:
        return [
            Evaluation(c, Outcome(c.x, c.level, c.seed, "finished", None, {}), 0.0)
            for c in candidates
        ]

    noises = {"level": measurement_noise(case.recordings, "level", case.measurement.of("level"))}
    with pytest.raises(SimulationError, match="it gives no level"):
        calibrate(case, noises, silent, 100)


def test_each_part_of_the_errors_lowers_the_certainty(
    truths: list[Array], campaigns: list[Campaign]
) -> None:
    fitted, z = campaigns[0].fitted, to_unit(PARAMETERS, truths[0])
    whole = likelihood(fitted.observations, fitted.emulators)
    assert whole.parts == EVERY_PART
    spread = np.linalg.slogdet(whole.residual(z)[1])[1]
    for part in ({"packing": False}, {"measurement": False}, {"emulator": False},
                 {"allowance": False}):  # fmt: skip
        less = likelihood(fitted.observations, fitted.emulators, Parts(**part))
        assert np.linalg.slogdet(less.residual(z)[1])[1] < spread, part
    # The emulator's own mean, taken as the recording, leaves no residual.
    mean = whole.scores - whole.residual(z)[0]
    assert np.abs(with_scores(whole, mean).residual(z)[0]).max() < 1e-12


def test_an_error_that_is_left_out_narrows_what_it_had_widened(truths: list[Array]) -> None:
    case = case_of(truths[0], 1, Measurement(clock_error=0.1))
    campaign = campaign_of(case)
    clock, packing = fits_without(campaign, ["clock", "packing", "clock"], case)
    low, high = campaign.fitted.posterior.interval()[0]
    assert (clock.error, packing.error) == ("clock", "packing")
    # The clock hides the rate; the scatter of this tank is small beside it.
    assert np.ptp(clock.intervals["rate"]) < 0.7 * (high - low)
    assert np.ptp(packing.intervals["rate"]) > 0.7 * (high - low)
    assert min(clock.misfit, packing.misfit) > 0.0


def _answering(case: Case, change: Callable[[Outcome], Outcome]) -> tuple[list[int], Evaluate]:
    """Runs that give something else, and how many were asked for at a time."""
    asked: list[int] = []

    def made(candidates: Sequence[Candidate]) -> list[Evaluation]:
        asked.append(len(candidates))
        found = evaluate(candidates, case)
        return [replace(e, outcome=change(e.outcome)) for e in found]

    return asked, made


@pytest.mark.parametrize(
    ("shift", "said"), [(-3.0, "the simulation ends at -1 s"), (0.1, "a run begins at 0.1 s")]
)
def test_runs_at_other_times_than_the_recordings_are_refused_after_one_of_each(
    shift: float, said: str
) -> None:
    case = case_of(frozen([0.35, 0.03]), 1)
    early = {TIME: TIMES + shift, "level": TIMES}
    asked, made = _answering(case, lambda its: replace(its, status="finished", why=None, raw=early))
    noises = {"level": measurement_noise(case.recordings, "level", case.measurement.of("level"))}
    with pytest.raises(ConfigError, match=said):
        calibrate(case, noises, made, 100)
    assert asked == [len(case.fitted)]


def test_parameters_that_change_nothing_are_named() -> None:
    case = case_of(frozen([0.35, 0.03]), 1)
    same = {TIME: TIMES, "level": 0.5 - 0.1 * TIMES}
    _, made = _answering(case, lambda its: replace(its, status="finished", why=None, raw=same))
    noises = {"level": measurement_noise(case.recordings, "level", case.measurement.of("level"))}
    with pytest.raises(SimulationError, match="same values, whatever rate and sag"):
        calibrate(case, noises, made, 100)


def test_one_run_that_ends_early_is_said_to_cut_the_comparison() -> None:
    case = case_of(frozen([0.35, 0.03]), 1)
    asked = [Candidate(i, frozen([0.3, 0.05]), "full", 2, 0, "design") for i in range(8)]

    def warned(end: float) -> list[str]:
        short, *others = evaluate(asked, case)
        raw = {name: values[end >= TIMES] for name, values in short.outcome.raw.items()}
        made = [replace(short, outcome=replace(short.outcome, raw=raw)), *others]
        return cut_short(case, made)

    assert warned(1.8) == []
    (line,) = warned(0.2)
    assert line.startswith("full is compared until 0.2 s only")
    assert "most runs last 1.9 s" in line


def test_a_run_that_gives_a_number_where_a_series_was_recorded_says_so() -> None:
    case = case_of(frozen([0.35, 0.03]), 1)
    number = {"level": np.array(0.3)}
    _, made = _answering(case, lambda its: replace(its, status="finished", why=None, raw=number))
    noises = {"level": measurement_noise(case.recordings, "level", case.measurement.of("level"))}
    with pytest.raises(SimulationError, match=r"gives level as a number, .* has a series"):
        calibrate(case, noises, made, 100)
