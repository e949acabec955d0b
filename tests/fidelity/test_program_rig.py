"""The user's own simulator as a rig: a function and a command give the same; flaws are told."""

import signal
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from fidelity.programs.rig import ProgramRig
from mfopt.errors import ConfigError
from mfopt.records.rig import Channel

CHANNELS = {"height": Channel("height", "m", 10.0), "time_to_fall": Channel("time_to_fall", "s", 1)}
FUNCTION = """
import numpy as np
def fall(parameters, conditions, seed):
    t = np.linspace(0.0, 1.0, 11)
    if 0.0 <= parameters["g"] < 1.0:
        raise RuntimeError("no gravity")
    if parameters["g"] > 20.0:
        return {"time": t[::-1], "height": t}
    if parameters["g"] > 15.0:
        return {"time": t, "height": t[:5]}
    if parameters["g"] > 12.0:
        return {"speed": t}
    h = conditions["start"] - 0.5 * parameters["g"] * t**2
    end = (2 * conditions["start"] / abs(parameters["g"]))**0.5
    return {"time": t, "height": h, "time_to_fall": end}
"""
PROGRAM = """
import json, sys
asked = json.load(sys.stdin)
g, start = asked["x"]["g"], asked["conditions"]["start"]
t = [0.1 * i for i in range(11)]
print(json.dumps({"time": t, "height": [start - 0.5 * g * s**2 for s in t],
                  "time_to_fall": (2 * start / g) ** 0.5}))
"""


@pytest.fixture
def function(tmp_path: Path) -> ProgramRig:
    (tmp_path / "fall.py").write_text(FUNCTION)
    return ProgramRig(CHANNELS, function=(str(tmp_path / "fall.py"), "fall"))


def test_a_function_may_import_a_file_beside_it(tmp_path: Path) -> None:
    (tmp_path / "neighbour_of_the_case.py").write_text("HEIGHT = 3.0\n")
    (tmp_path / "with_neighbour.py").write_text(
        "from neighbour_of_the_case import HEIGHT\n"
        "def f(parameters, conditions, seed):\n"
        "    return {'time': [0.0, 1.0], 'height': [HEIGHT, 0.0]}\n"
    )
    rig = ProgramRig(CHANNELS, function=(str(tmp_path / "with_neighbour.py"), "f"))
    outcome = rig.level("drop", {}, ()).evaluate(np.array([]), seed=1)
    assert outcome.finished, outcome.why
    assert outcome.raw["height"][0] == 3.0


def test_a_function_and_a_command_give_the_same(function: ProgramRig, tmp_path: Path) -> None:
    (tmp_path / "program.py").write_text(PROGRAM)
    command = ProgramRig(CHANNELS, command=(sys.executable, str(tmp_path / "program.py")))
    outcomes = [
        rig.level("drop", {"start": 5.0}, ("g",)).evaluate(np.array([9.81]), seed=1)
        for rig in (function, command)
    ]
    for outcome in outcomes:
        assert outcome.finished, outcome.why
        assert outcome.raw["height"][-1] == pytest.approx(5.0 - 9.81 / 2)
        assert float(outcome.raw["time_to_fall"]) == pytest.approx(1.0096, abs=1e-3)


@pytest.mark.parametrize(
    ("g", "said"),
    [
        (0.5, "no gravity"),
        (13.0, "none of the channels"),
        (16.0, "shape"),
        (25.0, "increas"),
        (-1e9, "5e+08 m is more than 1e+06 times the usual size 10"),
    ],
)
def test_a_flawed_run_is_a_crash_that_says_why(function: ProgramRig, g: float, said: str) -> None:
    level = function.level("drop", {"start": 5.0}, ("g",))
    outcome = level.evaluate(np.array([g]), seed=1)
    assert outcome.status == "crashed"
    assert outcome.why is not None
    assert said in outcome.why


@pytest.mark.parametrize(
    ("text", "name", "said"),
    [
        (None, "fall", "is no file"),
        ("x = 1", "fall", "no function"),
        ("1 / 0", "fall", "ZeroDiv"),
        ("raise SystemExit", "fall", "SystemExit"),
    ],
)
def test_a_function_that_is_missing_is_named(
    tmp_path: Path, text: str | None, name: str, said: str
) -> None:
    path = tmp_path / f"missing{name}.py"
    if text is not None:
        path.write_text(text)
    with pytest.raises(ConfigError, match=said):
        ProgramRig(CHANNELS, function=(str(path), name)).level("drop", {}, ("g",))


def test_a_function_that_hangs_ends_at_the_time_limit(tmp_path: Path) -> None:
    # It even catches every exception once.
    text = """
import time
def hang(parameters, conditions, seed):
    try:
        time.sleep(60.0)
    except BaseException:
        time.sleep(60.0)
"""
    (tmp_path / "hang.py").write_text(text)
    rig = ProgramRig(CHANNELS, function=(str(tmp_path / "hang.py"), "hang"), time_limit_s=0.1)
    began = time.monotonic()
    outcome = rig.level("drop", {}, ("g",)).evaluate(np.array([9.81]), seed=1)
    assert outcome.status == "timed_out"
    assert outcome.why == "not ready within the time limit of 0.1 s"
    assert time.monotonic() - began < 30.0
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)


# More than 1 MB, of which only the end is kept.
TALK = """
import os, subprocess, sys, time
print("loaded")
def talk(parameters, conditions, seed):
    for step in range(12_000):
        print(100 * "-", step)
    sys.stdout.buffer.write(b"bytes\\n")
    sys.stdout.flush()
    os.write(2, b"from compiled code\\n")
    subprocess.run(["echo", "from a child"], stdout=sys.stderr, check=True)
    print("warned", file=sys.stderr)
    if parameters["g"] > 10.0:
        raise RuntimeError("too heavy")
    if parameters["g"] < 5.0:
        time.sleep(60.0)
    return {"time_to_fall": 1.0}
"""


def test_what_a_function_prints_is_only_in_the_reason_of_a_failed_run(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "talk.py").write_text(TALK)
    rig = ProgramRig(CHANNELS, function=(str(tmp_path / "talk.py"), "talk"), time_limit_s=6.0)
    fine, failed, late = (
        rig.level("drop", {}, ("g",)).evaluate(np.array([g]), seed=1) for g in (9.8, 11.0, 4.0)
    )
    print("mfopt goes on", flush=True)
    said = capfd.readouterr()
    assert said.out == "mfopt goes on\n"
    assert said.err == ""
    assert fine.finished
    assert fine.why is None
    for outcome, first in ((failed, "RuntimeError: too heavy (line"), (late, "not ready within")):
        assert outcome.why is not None
        reason, *printed = outcome.why.splitlines()
        assert reason.startswith(first)
        assert reason.endswith("; the last lines that it printed:")
        assert printed[-5:] == [
            f"{100 * '-'} 11999",
            "bytes",
            "from compiled code",
            "from a child",
            "warned",
        ]
        assert len(printed) == 20


def test_what_a_command_writes_to_its_errors_is_in_the_reason_of_a_failed_run(
    tmp_path: Path,
) -> None:
    (tmp_path / "talk.sh").write_text("echo no licence >&2; echo done; sleep $1")
    for seconds, limit_s, reason in (("0", 20.0, "does not end with a JSON"), ("60", 0.5, "limit")):
        command = ("sh", str(tmp_path / "talk.sh"), seconds)
        rig = ProgramRig(CHANNELS, command=command, time_limit_s=limit_s)
        outcome = rig.level("drop", {}, ("g",)).evaluate(np.array([9.81]), seed=1)
        assert outcome.why is not None
        assert reason in outcome.why
        assert outcome.why.endswith("no licence")


@pytest.mark.parametrize(
    ("answer", "said"),
    [
        ("None", "the function returns nothing; return a dictionary"),
        ("[1.0, 2.0]", "the function returns [1.0, 2.0]; return a dictionary"),
        ('{"time": t, "height": t / (t - 0.5)}',
         "height = inf at index 5, time 0.5 s, is no finite number; 1 of 11 values are not"),
        ('{"height": float("nan")}', "height = nan is no finite number"),
        ('{"time": t, "height": [None] * 11}', "height = [None, None"),
        ('{"height": [[1.0], 2.0]}', "height is no array of numbers"),
        ('{"time": t, "height": np.ma.masked_less(t, 0.5)}', "height has masked values"),
    ],
)  # fmt: skip
def test_an_answer_that_cannot_be_used_says_why_and_names_no_line_of_mfopt(
    tmp_path: Path, answer: str, said: str
) -> None:
    (tmp_path / "odd.py").write_text(
        "import numpy as np\n"
        "def f(parameters, conditions, seed):\n"
        "    t = np.linspace(0.0, 1.0, 11)\n"
        "    with np.errstate(all='ignore'):\n"
        f"        return {answer}\n"
    )
    rig = ProgramRig(CHANNELS, function=(str(tmp_path / "odd.py"), "f"))
    outcome = rig.level("drop", {}, ()).evaluate(np.array([]), seed=1)
    assert outcome.status == "crashed"
    assert outcome.why is not None
    assert said in outcome.why
    assert "rig.py" not in outcome.why


def test_a_command_names_the_first_value_that_is_no_number(tmp_path: Path) -> None:
    text = """print('{"height": [1.0, NaN, NaN], "time": [0.0, 0.1, 0.2]}')"""
    (tmp_path / "odd.py").write_text(text)
    rig = ProgramRig(CHANNELS, command=(sys.executable, str(tmp_path / "odd.py")))
    outcome = rig.level("drop", {}, ()).evaluate(np.array([]), seed=1)
    assert outcome.why is not None
    assert "height = nan at index 1, time 0.1 s, is no finite number; 2 of 3 values" in outcome.why
