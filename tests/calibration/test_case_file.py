"""Case files: the example is read, wrong keys are named, numbers reach the records."""

import math
from pathlib import Path

import pytest
from recordings_corpus import CHANNELS, clean, read_case

from calibration.recordings.case_settings import read_case_settings
from calibration.recordings.notes import notes_by_files
from mfopt.errors import ConfigError
from mfopt.records.rig import Channel

ROOT = Path(__file__).parents[2]
HEAD = '[case]\nname = "c"\n[rig]\nscene = "s"\n'
PARAMETER = "[parameters.friction]\nrange = [0.1, 0.8]\n"
RECORDING = '[[recording]]\nname = "run"\nfiles = ["a.csv"]\n'


def written(folder: Path, text: str, **files: str) -> Path:
    for name, content in {"a": clean(), "b": clean(1), **files}.items():
        (folder / f"{name}.csv").write_text(content)
    (folder / "case.toml").write_text(text)
    return folder / "case.toml"


def test_the_example_is_read() -> None:
    case = read_case(ROOT / "examples" / "calibration" / "beads" / "case.toml", CHANNELS)
    assert [len(its.repeats) for its in case.recordings] == [3, 2, 2]
    assert [its.name for its in case.held_out] == ["slot 40 mm"]
    assert case.fitted[0].conditions == {"opening_mm": 30.0}
    assert case.measurement.of("level").offset == pytest.approx(5e-4)
    assert case.measurement.of("mass").offset == 0.0
    assert case.rig["scene"] == "discharge"
    level = case.fitted[0].repeats[0].series["level"]
    assert level.values[0] == pytest.approx(0.0575, abs=1e-3)
    assert not level.values.flags.writeable


def test_numbers_and_files_of_a_repeat_belong_together(tmp_path: Path) -> None:
    text = HEAD + PARAMETER + (
        '[[recording]]\nname = "run"\nfiles = ["a.csv", "b.csv"]\n'
        'scalars = { mass = { values = [150.0, 151.0], unit = "g" } }\n'
    )  # fmt: skip
    a, b = read_case(written(tmp_path, text), CHANNELS).recordings[0].repeats
    assert (a.file, a.scalars["mass"]) == ("a.csv", pytest.approx(0.150))
    assert (b.file, b.scalars["mass"]) == ("b.csv", pytest.approx(0.151))


@pytest.mark.parametrize("conditions", ["cup.volume_ml = 900", "cup = { volume_ml = 900 }"])
def test_a_condition_in_a_table_is_named_with_the_table(tmp_path: Path, conditions: str) -> None:
    text = HEAD + PARAMETER + RECORDING + f"conditions = {{ cycle_ms = 700, {conditions} }}\n"
    text += f'[[possible]]\nname = "p"\nconditions = {{ {conditions} }}\n'
    settings, _ = read_case_settings(written(tmp_path, text))
    assert settings.recording[0].conditions == {"cycle_ms": 700.0, "cup.volume_ml": 900.0}
    assert settings.possible[0].conditions == {"cup.volume_ml": 900.0}


def test_only_a_number_that_can_vanish_may_be_far_below_the_usual_size(tmp_path: Path) -> None:
    left = '[[recording]]\nname = "r"\nscalars = { left = { values = [VALUE], unit = "%" } }\n'
    text = HEAD + PARAMETER + left

    def read(value: float, *, can_vanish: bool) -> float:
        path = written(tmp_path, text.replace("VALUE", str(value)))
        channels = {"left": Channel("left", "-", 1.0, can_vanish)}
        return read_case(path, channels).recordings[0].repeats[0].scalars["left"]

    assert read(0.3, can_vanish=True) == pytest.approx(0.003)
    with pytest.raises(ConfigError, match=r"left = 0\.3 % is 0\.003 times the usual 1"):
        read(0.3, can_vanish=False)
    with pytest.raises(ConfigError, match="outside the limits"):
        read(3000.0, can_vanish=True)


def test_rows_choose_the_runs_of_one_file(tmp_path: Path) -> None:
    runs = [series_rows(seed) for seed in (0, 1)]
    table = "ball,drop,time [s],level [mm]\n" + "".join(
        f"Golf ball,{k},{row}\n" for k, rows in enumerate(runs, start=1) for row in rows
    )
    text = HEAD + PARAMETER + RECORDING + (
        'rows = [{ ball = "Golf ball", drop = 1 }, { ball = "Golf ball", drop = 2 }]\n'
    )  # fmt: skip
    path = written(tmp_path, text, a=table)
    repeats = read_case(path, CHANNELS).recordings[0].repeats
    for its, rows in zip(repeats, runs, strict=True):
        level = its.series["level"]
        assert level.values == pytest.approx([1e-3 * float(row.split(",")[1]) for row in rows])
    for wrong, says in (("drop = 3", "no row has 3"), ('dorp = "1"', "did you mean 'drop'")):
        path.write_text(text.replace("drop = 2", wrong))
        with pytest.raises(ConfigError, match=says):
            read_case(path, CHANNELS)


def series_rows(seed: int) -> list[str]:
    """Rows of a clean file."""
    return clean(seed).splitlines()[1:]


def test_rename_makes_a_channel(tmp_path: Path) -> None:
    text = (
        HEAD + PARAMETER + '[csv]\nrename = { h_m = "level [m]", clock = "t [ms]" }\n' + RECORDING
    )
    table = "clock,h_m\n0,0.09\n100,0.08\n200,0.06\n"
    level = read_case(written(tmp_path, text, a=table), CHANNELS).recordings[0].repeats[0].series
    assert level["level"].times == pytest.approx([0.0, 0.1, 0.2])
    assert level["level"].values == pytest.approx([0.09, 0.08, 0.06])


@pytest.mark.parametrize("key", ['rename = { lvl = "level [mm]" }', 'ignore = ["lvl"]'])
def test_a_column_that_no_file_has_is_refused(tmp_path: Path, key: str) -> None:
    text = HEAD + PARAMETER + f"[csv]\n{key}\n" + RECORDING.replace('"a.csv"', '"a.csv", "b.csv"')
    path = written(tmp_path, text)
    with pytest.raises(ConfigError, match=r"no file has a column 'lvl'; there are 'time \[s\]'"):
        read_case(path, CHANNELS)


def test_a_column_that_one_file_has_may_be_renamed(tmp_path: Path) -> None:
    text = HEAD + PARAMETER + '[csv]\nrename = { lvl = "level [mm]" }\n'
    text += RECORDING.replace('"a.csv"', '"a.csv", "b.csv"')
    path = written(tmp_path, text, b=clean(1).replace("level [mm]", "lvl", 1))
    assert read_case(path, CHANNELS).recordings[0].channels == ("level",)


def test_a_note_is_said_once_with_the_files_that_it_holds_for(tmp_path: Path) -> None:
    text = HEAD + PARAMETER + RECORDING.replace('"a.csv"', '"a.csv", "b.csv"')
    a, b = (clean(seed).replace(",", ";") for seed in (0, 1))
    case = read_case(written(tmp_path, text, a=a, b=f"# a comment\n{b}"), CHANNELS)
    assert notes_by_files(case.recordings) == [
        "all 2 repeats: Columns are separated by semicolons.",
        "b.csv: 1 comment line left out.",
    ]


@pytest.mark.parametrize(
    ("stated", "begin", "sd"),
    [
        ("", 0.0, math.inf),
        ("clock_offset_s = 0.2", 12.3, 0.2),
        ('clock_offset_s = "unknown"', 0.0, math.inf),
    ],
)
def test_a_late_start_is_unknown_unless_stated(
    tmp_path: Path, stated: str, begin: float, sd: float
) -> None:
    table = "time [s],level [mm]\n12.3,90\n12.4,80\n12.5,70\n"
    text = HEAD + PARAMETER + f"[measurement]\n{stated}\n" + RECORDING
    (repeat,) = read_case(written(tmp_path, text, a=table), CHANNELS).recordings[0].repeats
    assert repeat.series["level"].times[0] == pytest.approx(begin)
    assert repeat.start_sd_s == sd


def test_a_start_at_0_is_known_within_a_sample(tmp_path: Path) -> None:
    (repeat,) = (
        read_case(written(tmp_path, HEAD + PARAMETER + RECORDING), CHANNELS).recordings[0].repeats
    )
    assert repeat.start_sd_s == pytest.approx(0.025 / math.sqrt(12.0))


WRONG = [
    (HEAD + RECORDING, "key 'parameters' is missing"),
    (HEAD + PARAMETER, "key 'recording' is missing"),
    (HEAD + PARAMETER.replace("range", "rang") + RECORDING, "'parameters.friction.rang'; did you"),
    (HEAD + PARAMETER.replace("0.1, 0.8", "0.8, 0.1") + RECORDING, r"range = \[0.8, 0.1\]"),
    (HEAD + PARAMETER + "prior = { normal = [0.9, 0.1] }\n" + RECORDING, "mean = 0.9 must lie"),
    (HEAD + PARAMETER + "prior = { normal = [0.4, 0.0] }\n" + RECORDING, "sd = 0 must be above"),
    (HEAD + PARAMETER + RECORDING + "heldout = true\n", "did you mean 'held_out'"),
    (HEAD + PARAMETER + RECORDING + "held_out = true\n", "all 1 recordings are held out"),
    (HEAD + PARAMETER + RECORDING + RECORDING.replace("a.csv", "b.csv"), "called 'run'"),
    (HEAD + PARAMETER + RECORDING + RECORDING.replace("run", "two"), "a run counts once"),
    (HEAD + PARAMETER + '[[recording]]\nname = "r"\n', "neither files nor scalars"),
    (HEAD + PARAMETER + '[[recording]]\nname = "r"\nfiles = ["a.csv", "a.csv"]\n', "twice"),
    (HEAD + PARAMETER + RECORDING.replace('"a.csv"', '"a.csv", "b.csv"') + "rows = [{ a = 1 }]\n",
     "1 rows and 2 files"),
    (HEAD + PARAMETER + RECORDING + 'scalars = { mass = { values = [1.0, 1.0], unit = "kg" } }\n',
     "1 and 2 repeats"),
    (HEAD + PARAMETER + RECORDING + 'scalars = { mas = { values = [1.0], unit = "kg" } }\n',
     "did you mean 'mass'"),
    (HEAD + PARAMETER + RECORDING + 'scalars = { mass = { values = [1.0], unit = "mm" } }\n',
     "'mm' does not measure mass"),
    (HEAD + PARAMETER + "[measurement.levle]\noffset = 1.0\n" + RECORDING, "did you mean 'level'"),
    (HEAD + PARAMETER + "[measurement.level]\nofset = 1.0\n" + RECORDING, "did you mean 'offset'"),
    (HEAD + PARAMETER + "[measurement.level]\noffset = -1.0\n" + RECORDING, "at least 0"),
    (HEAD + PARAMETER + '[measurement.level]\nunit = "kg"\n' + RECORDING, "does not measure level"),
    (HEAD + PARAMETER + "[measurement.level]\nlimits = [2.0, 1.0]\n" + RECORDING, "swap"),
    (HEAD + PARAMETER + "[measurement]\nclock = 0.1\n" + RECORDING, "'measurement.clock'; known"),
    (HEAD + PARAMETER + '[measurement]\nclock_offset_s = "wide"\n' + RECORDING, "clock_offset_s"),
    (HEAD + PARAMETER + "[measurement]\nclock_offset_s = -0.1\n" + RECORDING, "at least 0"),
    ("[case\n", "not valid TOML"),
    (HEAD + PARAMETER + "[measurement.level]\noffset = 1e300\n" + RECORDING,
     r"level.offset = 1e\+300 must be at most 100 times"),
    (HEAD + PARAMETER + "[measurement.level]\nnoise = 1e300\n" + RECORDING,
     r"level.noise = 1e\+300 must be at most 100 times"),
    (HEAD + PARAMETER + "[measurement.level]\nscale = 11.0\n" + RECORDING, "at most 10"),
    (HEAD + PARAMETER.replace("0.1, 0.8", "1.0, 1.0000000000000002") + RECORDING, "1e-09 wide"),
    (HEAD + PARAMETER.replace("0.1, 0.8", "0.0, 1e-320") + RECORDING, "1e-100 wide"),
    (HEAD + PARAMETER + "prior = { normal = [0.4, 1e-20] }\n" + RECORDING, "1e-06 of the range"),
    (HEAD + PARAMETER + "prior = { normal = [0.4, 1e20] }\n" + RECORDING, r"at most 1e\+06 tim"),
    (HEAD + PARAMETER + RECORDING + RECORDING.replace("run", "two").replace("a.csv", "./a.csv"),
     "a run counts once"),
    (HEAD + PARAMETER + RECORDING + 'conditions = { "a\\nb" = 1.0 }\n', "control character"),
    (HEAD + PARAMETER + RECORDING + f'conditions = {{ {"x" * 200} = 1.0 }}\n', "limit of 100"),
    (HEAD + PARAMETER + RECORDING + '[[possible]]\nname = "run"\nconditions = { a = 1.0 }\n',
     "'run' is the name of another experiment"),
    (HEAD + PARAMETER + RECORDING + 2 * '[[possible]]\nname = "p"\nconditions = { a = 1.0 }\n',
     "'p' is the name of another experiment"),
]  # fmt: skip


@pytest.mark.parametrize(("text", "says"), WRONG)
def test_a_wrong_case_file_is_refused(tmp_path: Path, text: str, says: str) -> None:
    with pytest.raises(ConfigError, match=says) as error:
        read_case(written(tmp_path, text), CHANNELS)
    assert "case.toml" in str(error.value)


def test_a_copy_in_another_recording_is_refused(tmp_path: Path) -> None:
    two = RECORDING + RECORDING.replace("run", "two").replace("a.csv", "b.csv")
    falling = "time [s],level [mm]\n" + "".join(f"{0.1 * i:g},{100 - 5 * i}\n" for i in range(12))
    path = written(tmp_path, HEAD + PARAMETER + two, a=falling, b=falling.replace(",", ";"))
    with pytest.raises(ConfigError, match=r"b\.csv of 'two' holds the same 12 .* a\.csv of 'run'"):
        read_case(path, CHANNELS)
    few = "time [s],level [mm]\n0,100\n1,50\n2,0\n"  # this may well happen twice
    assert read_case(written(tmp_path, HEAD + PARAMETER + two, a=few, b=few), CHANNELS)


def test_a_missing_case_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="does not exist"):
        read_case_settings(tmp_path / "case.toml")


def test_two_channels_of_one_file_have_times_of_their_own(tmp_path: Path) -> None:
    table = "t [s],level [mm],mass [g]\n0,90,\n0.1,,20\n0.2,80,\n0.3,,40\n0.4,70,60\n"
    path = written(tmp_path, HEAD + PARAMETER + RECORDING, a=table)
    made = read_case(path, CHANNELS).recordings[0].repeats[0].series
    assert made["level"].times == pytest.approx([0.0, 0.2, 0.4])
    assert made["mass"].times == pytest.approx([0.1, 0.3, 0.4])


def test_equal_times_are_averaged(tmp_path: Path) -> None:
    table = "t [s],level [mm]\n0,90\n0.1,80\n0.1,82\n0.2,\n0.2,75\n0.3,70\n"
    path = written(tmp_path, HEAD + PARAMETER + RECORDING, a=table)
    level = read_case(path, CHANNELS).recordings[0].repeats[0].series["level"]
    assert level.times == pytest.approx([0.0, 0.1, 0.2, 0.3])
    assert level.values == pytest.approx([0.09, 0.081, 0.075, 0.07])
