"""`mfopt calibrate` on coarse beads: it ends with a result, goes on where it stopped, refuses."""

import json
import shutil
from pathlib import Path

import pytest
from typer.testing import CliRunner

from fidelity.engines.yade.engine import YadeEngine
from fidelity.rig import RigLevel
from mfopt.commands.app import app
from mfopt.errors import ConfigError
from mfopt.study.case import assemble_case
from mfopt.study.material_file import read_material
from mfopt.study.stored import open_stored

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "calibration" / "beads"
COARSE = ("--runs", "50", "--workers", "1")


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("beads")
    for file in EXAMPLE.iterdir():
        text = file.read_text()
        if file.name == "case.toml":
            coarse = "coarse = 3\nlevel = { young_modulus_pa = 2e5 }\n"
            text = text.replace('scene = "discharge"\n', f'scene = "discharge"\n{coarse}', 1)
        (folder / file.name).write_text(text)
    return folder / "case.toml"


@pytest.fixture(scope="module")
def done(case: Path) -> Path:
    path = case.parent / "run"
    result = CliRunner().invoke(app, ["calibrate", str(case), "-d", str(path), *COARSE])
    assert result.exit_code == 0, result.output
    assert "Columns are separated by semicolons" in result.output
    assert "slot 40 mm, level (held out): error" in result.output
    assert "emulator" in result.output
    return path


def test_it_tells_parameters_directions_and_comparisons(done: Path) -> None:
    told = json.loads((done / "calibration.json").read_text())
    friction, restitution, stiffness = told["parameters"]
    assert friction["low"] <= friction["interval"][0] < friction["interval"][1] <= friction["high"]
    assert restitution["determined"] is (restitution["share"] < 0.5)
    assert stiffness["name"] == "young_modulus"
    assert not stiffness["asked"]
    assert told["runs"] == 50
    assert {c["held_out"] for c in told["compared"]} == {True, False}
    checked = [(c["recording"], c["fresh"]) for c in told["emulators"]]
    assert checked == [(r, f) for r in ("slot 30 mm", "partial fill") for f in (False, True)]


def test_it_writes_a_material(done: Path) -> None:
    its = read_material(done / "material.toml")
    told = json.loads((done / "calibration.json").read_text())
    for parameter in told["parameters"][:2]:
        value = its.values[parameter["name"]]
        assert value.value == pytest.approx(parameter["mean"], rel=1e-5)
        assert value.determined is parameter["determined"]
    assert list(its.values) == ["friction", "restitution"]
    assert its.holds_for.coarse == 3.0


def test_a_run_that_is_whole_is_not_made_again(case: Path, done: Path) -> None:
    before = (done / "journal.jsonl").read_bytes()
    told = (done / "calibration.json").read_bytes()
    given = ["calibrate", str(case), "-d", str(done), *COARSE, "--resume"]
    assert CliRunner().invoke(app, given).exit_code == 0
    assert (done / "journal.jsonl").read_bytes() == before
    assert (done / "calibration.json").read_bytes() == told


def test_an_error_is_left_out_of_runs_that_are_there(
    case: Path, done: Path, tmp_path: Path
) -> None:
    copied = tmp_path / "run"
    shutil.copytree(done, copied)
    given = ["calibrate", str(case), "-d", str(copied), *COARSE, "--resume", "--leave-out", "clock"]
    result = CliRunner().invoke(app, given)
    assert result.exit_code == 0, result.output
    assert (copied / "journal.jsonl").read_bytes() == (done / "journal.jsonl").read_bytes()
    (fit,) = json.loads((copied / "calibration.json").read_text())["without"]
    assert fit["error"] == "clock"
    assert "Without the error clock: friction" in result.output
    assert "What each error does" in (copied / "report.html").read_text()


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (["--leave-out", "clok"], "packing, measurement, emulator"),
        (["--leave-out", "clock", "--method", "lbfgsb"], "--leave-out needs the method posterior"),
    ],
)
def test_an_error_that_cannot_be_left_out_is_named(
    tmp_path: Path, given: list[str], said: str
) -> None:
    called = ["calibrate", str(EXAMPLE / "case.toml"), "-d", str(tmp_path / "run"), *given]
    result = CliRunner().invoke(app, called)
    assert result.exit_code == 2
    assert said in " ".join(result.output.split())


def test_a_calibration_is_not_taken_for_a_study(done: Path) -> None:
    with pytest.raises(ConfigError, match="holds a calibration"):
        open_stored(done)


@pytest.mark.parametrize(
    ("command", "file", "said"),
    [
        ("run", "calibration/balls/case.toml",
         "is a case of a calibration, not a study; give it to mfopt calibrate"),
        ("evaluate", "calibration/balls/case.toml",
         "is a case of a calibration, not a study; give it to mfopt calibrate"),
        ("calibrate", "hopper.toml",
         "is a study, not a case of a calibration; give it to mfopt run"),
    ],
)  # fmt: skip
def test_a_file_for_another_command_is_told_by_its_kind(command: str, file: str, said: str) -> None:
    given = Path(__file__).resolve().parents[2] / "examples" / file
    result = CliRunner().invoke(app, [command, str(given)])
    assert result.exit_code == 2
    assert result.output == f"error: {given} {said}\n"


def test_status_prints_the_result(done: Path) -> None:
    result = CliRunner().invoke(app, ["status", str(done)])
    assert result.exit_code == 0
    assert (
        result.output.splitlines() == json.loads((done / "calibration.json").read_text())["words"]
    )


def test_the_report_is_there_with_pictures_and_can_be_written_again(done: Path) -> None:
    first = (done / "report.html").read_text()
    assert "The best fit at work" in first
    (done / "report.html").unlink()
    (done / "report.pdf").unlink()
    assert CliRunner().invoke(app, ["report", str(done)]).exit_code == 0
    assert (done / "report.html").read_text() == first
    assert (done / "report.pdf").read_bytes().startswith(b"%PDF")


def test_a_calibration_that_has_not_ended_has_a_status_and_no_report(done: Path) -> None:
    kept = (done / "calibration.json").read_bytes()
    (done / "calibration.json").unlink()
    told, refused, counted = (
        CliRunner().invoke(app, words)
        for words in (["status", str(done)], ["report", str(done)], ["status", str(done), "--json"])
    )
    (done / "calibration.json").write_bytes(kept)
    assert told.exit_code == 0
    assert "50 of 50 simulations are made, 0 failed" in " ".join(told.output.split())
    assert json.loads(counted.output) == {"runs": 50, "planned": 50, "failed": 0}
    assert refused.exit_code == 2
    assert "has not ended" in refused.output


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('scene = "discharge"', 'scene = "dicharge"', "discharge"),
        ("[parameters.friction]", "[parameters.fricton]", "friction"),
        ("opening_mm = 40", "openning_mm = 40", "opening_mm"),
        ("opening_mm = 40", "opening_mm = 400", "narrow the outlet"),
        ("floor_mm = 4", "flor_mm = 4", "floor_mm"),
        ("portion_kg = 0.12", "portion_kg = 0.001", "portion_kg"),
        ("[parameters.restitution]", "[parameters.vibration]", "vibration.amplitude"),
        ("[parameters.friction]", '[parameters.friction]\nunit = "deg"', "must be '-'"),
    ],
)
def test_wrong_words_are_named(tmp_path: Path, old: str, new: str, said: str) -> None:
    for file in EXAMPLE.iterdir():
        text = file.read_text()
        if file.name == "case.toml":
            assert old in text
            text = text.replace(old, new)
        (tmp_path / file.name).write_text(text)
    given = ["calibrate", str(tmp_path / "case.toml"), "-d", str(tmp_path / "run")]
    result = CliRunner().invoke(app, given)
    assert result.exit_code == 2, result.output
    assert said in result.output
    assert not (tmp_path / "run" / "run.json").exists()


@pytest.mark.parametrize("table", ["", "[rig.heap]\nportion_kg = 0.2\n\n"])
def test_a_recording_may_name_another_scene_and_brings_its_channels(
    tmp_path: Path, table: str
) -> None:
    for file in EXAMPLE.iterdir():
        (tmp_path / file.name).write_text(file.read_text())
    path = tmp_path / "case.toml"
    text = path.read_text().replace("[rig.discharge]", f"{table}[rig.discharge]")
    text += (
        '\n[[recording]]\nname = "heap"\nconditions = { scene = "heap" }\n'
        'scalars = { angle_of_repose = { values = [21.0, 22.0], unit = "deg" } }\n'
    )
    path.write_text(text)
    parts = assemble_case(path)
    assert parts.ladder.names[-1] == "heap"
    assert parts.case.recordings[-1].scalars == ("angle_of_repose",)
    assert "angle_of_repose" in parts.rig.channels


@pytest.mark.parametrize(
    ("name", "runs", "truth"),
    [
        ("balls", 40, {"drag": (0.45, 0.05)}),
        ("pendulum", 150,
         {"frequency": (4.5, 0.02), "viscous": (0.08, 0.02), "dry": (0.15, 0.03)}),
    ],
)  # fmt: skip
def test_a_function_of_the_user_is_calibrated(
    tmp_path: Path, name: str, runs: int, truth: dict[str, tuple[float, float]]
) -> None:
    path = EXAMPLE.parent / name / "case.toml"
    given = ["calibrate", str(path), "-d", str(tmp_path / "run"), "--runs", str(runs), "--json"]
    result = CliRunner().invoke(app, [*given, "--workers", "1"])
    assert result.exit_code == 0, result.output
    told = json.loads(result.output)
    assert not (tmp_path / "run" / "material.toml").exists()
    for parameter in told["parameters"]:
        (low, high), (true, most) = parameter["interval"], truth[parameter["name"]]
        assert low < high < low + 2.0 * most
        width = high - low
        assert low - width / 2.0 < true < high + width / 2.0
    assert told["fits"]
    assert all(c["error"] < 2.0 for c in told["compared"])
    assert told["failed"] == 0


def test_units_of_the_users_parameters_are_shown_with_them() -> None:
    parts = assemble_case(EXAMPLE.parent / "pendulum" / "case.toml")
    units = {v.name: v.unit for v in parts.problem.variables}
    assert units == {"frequency": "rad/s", "viscous": "1/s", "dry": "rad/s2"}


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('function = "balls.py:fall"', 'function = "ball.py:fall"', "is no file"),
        ('function = "balls.py:fall"', 'command = ["no-such-program"]', "no-such-program"),
        ('function = "balls.py:fall"', 'function = "balls.py:fall"\ncommand = ["a"]', "either"),
        ('unit = "m"\nsize', 'unit = "km"\nsize', "unit"),
        ("[rig.channels.height]", "[rig.channels.heigth]", "heigth"),
        ("[parameters.drag]", '[parameters.drag]\nunit = "a\\nb"', "control character"),
    ],
)
def test_wrong_words_of_a_program_are_named(tmp_path: Path, old: str, new: str, said: str) -> None:
    for file in (EXAMPLE.parent / "balls").iterdir():
        if file.is_file():
            text = file.read_text()
            (tmp_path / file.name).write_text(text.replace(old, new))
    given = ["calibrate", str(tmp_path / "case.toml"), "-d", str(tmp_path / "run")]
    result = CliRunner().invoke(app, given)
    assert result.exit_code == 2, result.output
    assert said in result.output


def with_precision(folder: Path, engine: str) -> Path:
    """The example on an engine, with an option that only YADE has."""
    for file in EXAMPLE.iterdir():
        (folder / file.name).write_text(file.read_text())
    path = folder / "case.toml"
    given = f'engine = "{engine}"\nlevel = {{ precision = "longdouble" }}\n'
    path.write_text(path.read_text().replace("[rig]", f"[rig]\n{given}", 1))
    return path


def test_an_option_of_an_engine_reaches_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(YadeEngine, "version", lambda self: "2023.02a")
    level = assemble_case(with_precision(tmp_path, "yade")).ladder.top
    assert isinstance(level, RigLevel)
    assert level.rig.engine.name == "yade-longdouble"


def test_an_option_of_another_engine_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"case\.toml: rig: precision = 'longdouble' is an opt"):
        assemble_case(with_precision(tmp_path, "numba"))
