"""`mfopt check` of a case: what was read is shown, and what is wrong is named."""

import threading
import time
from pathlib import Path

import pytest
from rich.console import ConsoleDimensions
from typer.testing import CliRunner, Result

from mfopt.commands.app import app
from mfopt.commands.shared import screen

WIDE = ConsoleDimensions(200, 50)  # no text is wrapped, whatever the environment says
BALLS = Path(__file__).resolve().parents[2] / "examples" / "calibration" / "balls"


def checked(folder: Path, old: str, new: str, *options: str) -> Result:
    """What is said of the balls with one text of their files replaced."""
    texts = {file.name: file.read_text() for file in BALLS.iterdir() if file.is_file()}
    assert any(old in text for text in texts.values())
    for name, text in texts.items():
        (folder / name).write_text(text.replace(old, new))
    return CliRunner().invoke(app, ["check", str(folder / "case.toml"), *options])


def test_a_case_is_shown_as_it_was_understood(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(screen, "size", WIDE)
    its = checked(tmp_path, ",height [cm]", ",HEIGHT / cm", "--dry-run").output
    assert "61 samples from 0 to 1.2 s" in its  # samples and times
    assert "4.361 to 10.02 m" in its  # given in cm
    assert "from 2 repeats" in its  # the noise
    assert "diameter = 0.067" in its
    assert "188 of each fitted recording to learn from, then 6 of each recording to check" in its
    assert "Every recording was simulated once" in its
    assert not (tmp_path / "runs").exists()


@pytest.mark.parametrize(
    ("old", "new", "options", "code", "said"),
    [
        ("[parameters.drag]", "[parameter.drag]", [], 2, "did you mean 'parameters'"),
        ("table-tennis-2.csv", "table-tennis-3.csv", [], 2, "table-tennis-3.csv does not exist"),
        ("balls.py:fall", "balls.py:fal", [], 2, "has no function 'fal'"),
        ('"height": done', '"hight": done', ["--dry-run"], 1, "none of the channels height"),
        ("np.linspace(0.0,", "np.linspace(0.3,", ["--dry-run"], 2, "simulate from time 0"),
        (
            "    area =",
            "    import os; os._exit(0)\n    area =",
            ["--dry-run"],
            1,
            "the worker process died",
        ),
        ('files = ["tennis-1.csv"]', 'files = ["tennis\\u0000.csv"]', [], 2, "zero byte"),
        ('"balls.py:fall"', '"balls\\u0000.py:fall"', [], 2, "zero byte"),
        (
            "import math",
            "import math; x = = 1",
            [],
            2,
            "cannot be loaded: SyntaxError: invalid syntax (balls.py, line 3)",
        ),
    ],
)  # fmt: skip)
def test_what_is_wrong_is_named_before_a_calibration(
    tmp_path: Path, old: str, new: str, options: list[str], code: int, said: str
) -> None:
    its = checked(tmp_path, old, new, *options)
    assert its.exit_code == code
    assert said in " ".join(its.output.split())


def test_a_thread_of_the_function_does_not_keep_the_check_from_ending(tmp_path: Path) -> None:
    text = (
        "    import threading, time\n"
        "    threading.Thread(target=time.sleep, args=(60.0,)).start()\n"
    )
    began = time.monotonic()
    assert checked(tmp_path, "    area =", f"{text}    area =", "--dry-run").exit_code == 0
    assert time.monotonic() - began < 30.0
    assert not [its for its in threading.enumerate() if "sleep" in its.name]  # none is left here


def test_runs_that_are_too_few_are_said(tmp_path: Path) -> None:
    more = "".join(f'[[recording]]\nname = "{k}"\nfiles = ["{k}.csv"]\n' for k in range(12))
    for k in range(12):
        text = (BALLS / "table-tennis-1.csv").read_text().replace("1002.0", f"10{k:02d}.5")
        (tmp_path / f"{k}.csv").write_text(text)
    its = checked(tmp_path, "# Two balls", f"{more}# Two balls")
    assert its.exit_code == 0, its.output
    assert "mfopt calibrate needs --runs: 200 runs are too few for 13" in its.output


@pytest.mark.parametrize(
    ("unit", "column", "shown"),
    [
        ("m/s", "cm/s", "4.361 to 10.02 m/s"),
        ("N", "kN", "4.361e+05 to 1.002e+06 N"),
        ("1/s", "Hz", "436.1 to 1002 Hz"),
        ("m²", "cm2", "0.04361 to 0.1002 m2"),
        ("Pa", "kPa", "4.361e+05 to 1.002e+06 Pa"),
    ],
)
def test_a_channel_may_have_any_si_unit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, unit: str, column: str, shown: str
) -> None:
    monkeypatch.setattr(screen, "size", WIDE)
    size = float(shown.split()[2])
    for file in BALLS.iterdir():
        if file.is_file():
            text = file.read_text().replace('unit = "m"\n', f'unit = "{unit}"\n')
            text = text.replace("size = 10.0", f"size = {size}").replace("[cm]", f"[{column}]")
            (tmp_path / file.name).write_text(text)
    its = CliRunner().invoke(app, ["check", str(tmp_path / "case.toml")])
    assert its.exit_code == 0, its.output
    assert shown in its.output


@pytest.mark.parametrize(
    ("unit", "said"),
    [
        ("cm", "'cm' must be the SI unit 'm'; let the simulator give the channel in m"),
        ("deg", "'deg' must be the SI unit 'rad'"),
        ("furlong", "'furlong' is no unit of a channel; give s, m, kg, -, rad"),
    ],
)
def test_a_channel_in_another_unit_is_told_the_si_unit(
    tmp_path: Path, unit: str, said: str
) -> None:
    its = checked(tmp_path, 'unit = "m"\n', f'unit = "{unit}"\n')
    assert its.exit_code == 2
    assert said in " ".join(its.output.split())


def test_an_interrupted_check_speaks_of_no_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("mfopt.commands.check.check_case", interrupted)
    its = checked(tmp_path, "", "")
    assert (its.exit_code, its.stderr) == (1, "error: interrupted\n")
