"""A command as a level: what it is told, what its answer becomes, and how it fails."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from fidelity.programs.command import CommandLevel, answer_object, numbers
from fidelity.programs.process import OUTPUT_LIMIT
from mfopt.errors import ConfigError
from mfopt.records.outcome import Outcome

X = np.array([0.25, -3.0])


def level(*command: str, time_limit_s: float = 60.0) -> CommandLevel:
    return CommandLevel(
        name="own",
        command=command,
        variables=("width", "angle"),
        work_per_run=7.0,
        time_limit_s=time_limit_s,
    )


def run(script: str, *, time_limit_s: float = 60.0) -> Outcome:
    """Evaluate with `script` run by the shell."""
    return level("sh", "-c", script, time_limit_s=time_limit_s).evaluate(X, seed=5)


def test_the_command_is_told_design_seed_and_level_and_its_number_comes_back() -> None:
    script = (
        "import json, sys; q = json.load(sys.stdin); "
        "assert q['level'] == 'own' and list(q['x']) == ['width', 'angle'], q; "
        "print(json.dumps({'f': q['x']['width'] * q['x']['angle'] + q['seed'], 'work': 3}))"
    )
    outcome = level(sys.executable, "-S", "-c", script).evaluate(X, seed=5)
    assert outcome.finished, outcome.why
    assert outcome.raw["f"] == 0.25 * -3.0 + 5
    assert outcome.work == 3.0
    assert outcome.seed == 5
    assert set(outcome.raw) == {"f"}
    np.testing.assert_array_equal(outcome.x, X)


def test_without_an_own_figure_the_work_is_the_predicted_one() -> None:
    outcome = run("""echo '{"f": 1}'""")
    assert outcome.work == level("sh").work(X) == 7.0


def test_the_last_line_is_the_answer_and_arrays_are_kept() -> None:
    outcome = run("""echo 'starting {'; echo '{"times": [0.1, 0.2], "left": 3}'; echo""")
    assert outcome.finished, outcome.why
    np.testing.assert_array_equal(outcome.raw["times"], [0.1, 0.2])
    assert outcome.raw["left"] == 3
    assert not outcome.raw["times"].flags.writeable


def test_an_answer_may_span_lines() -> None:
    assert answer_object(json.dumps({"f": 1.5}, indent=2)) == {"f": 1.5}


@pytest.mark.parametrize(
    ("script", "words"),
    [
        ("echo broken pipe cutter >&2; exit 3", ["3", "broken pipe cutter"]),
        ("true", ["empty"]),
        ("echo nonsense", ["JSON object", "nonsense"]),
        ("echo 4.5", ["JSON object"]),
        ("""echo '{"f": NaN}'""", ["f", "finite"]),
        ("""echo '{"f": [1, 2]}'""", ["f", "one number"]),
        ("""echo '{"f": "low"}'""", ["f", "neither a number"]),
        ("""echo '{"f": null}'""", ["f", "neither a number"]),
        ("""echo '{"f": "0.5"}'""", ["f", "neither a number"]),
        ("""echo '{"f": "1e-3_0"}'""", ["f", "neither a number"]),
        ("""echo '{"f": true}'""", ["f", "neither a number"]),
        ("""echo '{"f": 1, "t": [[1, false], [2, 3]]}'""", ["t", "neither a number"]),
        ("""echo '{"f": 1, "t": [[1], [2, 3]]}'""", ["t", "neither a number"]),
        (f"""echo '{{"f": 1{"0" * 400}}}'""", ["f", "neither a number"]),
        (f"""echo '{{"f": 1, "t": {"[" * 500}1{"]" * 500}}}'""", ["t", "neither a number"]),
        (f"""echo '{{"f": {"[" * 9000}1{"]" * 9000}}}'""", ["JSON object"]),
        ("""echo '{"f": 1, "work": 1e300}'""", ["work", "1e+18"]),
        ("""echo '{"f": 1, "work": "3"}'""", ["work", "neither a number"]),
        ("""echo '{"f": 1, "": 2}'""", ["name ''", "letters"]),
        ("""echo '{"f": 1, ".": 2}'""", ["name '.'", "letters"]),
        ("""echo '{"a": 1, "a/b": 2}'""", ["name 'a/b'", "no slash"]),
        (r"""printf '{"f": 1, "\\ud800": 2}'""", ["name", "ud800", "letters"]),
        (r"""printf '{"f": 1, "a\\u0000": 2}'""", ["name", "x00", "letters"]),
        (f"""echo '{{"f": 1, "{"n" * 101}": 2}}'""", ["name", "nnn", "1 to 100"]),
        ("""echo '{"work": 3}'""", ["no result"]),
        ("""echo '{"f": 1, "work": 0}'""", ["work", "positive"]),
    ],
)
def test_a_bad_answer_is_a_crashed_outcome_that_says_why(script: str, words: list[str]) -> None:
    outcome = run(script)
    assert outcome.status == "crashed"
    assert outcome.why is not None
    assert all(word in outcome.why for word in words), outcome.why
    assert outcome.raw == {}


def test_a_hanging_command_is_timed_out() -> None:
    outcome = run("sleep 1000", time_limit_s=0.2)
    assert outcome.status == "timed_out"
    assert outcome.why is not None
    assert "0.2 s" in outcome.why


def test_a_missing_program_is_named_before_anything_runs() -> None:
    with pytest.raises(ConfigError, match="no-such-simulator"):
        level("no-such-simulator").check()
    level("sh").check()


def test_a_program_that_vanished_is_a_crashed_outcome() -> None:
    outcome = level("no-such-simulator").evaluate(X, seed=1)
    assert outcome.status == "crashed"
    assert "no-such-simulator" in str(outcome.why)


def test_relative_paths_are_those_of_the_caller(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "own.sh").write_text("""echo '{"f": 2}'\n""", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    outcome = level("sh", "own.sh").evaluate(X, seed=1)
    assert outcome.finished, outcome.why
    assert outcome.raw["f"] == 2


def test_bad_settings_are_refused_by_name() -> None:
    with pytest.raises(ConfigError, match="command is empty"):
        level()
    with pytest.raises(ConfigError, match="time_limit_s"):
        level("sh", time_limit_s=0.0)


def test_nested_lists_become_arrays() -> None:
    raw = numbers({"whole": 3, "table": [[1, 2], [3, 4.5]], "none": []})
    assert raw["whole"] == 3.0
    assert raw["table"].shape == (2, 2)
    assert raw["none"].shape == (0,)


def test_the_answer_after_a_long_log_is_read() -> None:
    outcome = run(f"""head -c {2 * OUTPUT_LIMIT} /dev/zero; echo; echo '{{"f": 2}}'""")
    assert outcome.finished, outcome.why
    assert outcome.raw["f"] == 2


def test_an_answer_longer_than_what_is_kept_is_crashed_and_the_limit_said() -> None:
    outcome = run(f"""printf '{{"f": 2, "t": 1'; head -c {2 * OUTPUT_LIMIT} /dev/zero; echo '}}'""")
    assert outcome.status == "crashed"
    assert "64 MB" in str(outcome.why)
