"""A few hundred of the random study files; `fuzz_studies.py` tries thousands."""

from fuzz_studies import fuzz


def test_random_studies_are_taken_or_refused_in_one_line() -> None:
    found = fuzz(count=200, seed=20)
    assert found.tracebacks == []
    assert found.sound
    assert min(found.count["accepted"], found.count["refused"]) > 10
