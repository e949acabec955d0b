"""Recordings with one flaw each, and what must happen: read with a note, or refused with a line."""

import gzip
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from calibration.recordings.case import Case
from calibration.recordings.case_file import complete_case
from calibration.recordings.case_settings import read_case_settings
from mfopt.arrays import Array
from mfopt.records.rig import Channel

CHANNELS = {
    c.name: c
    for c in (
        Channel("time", "s", 2.0),
        Channel("level", "m", 0.1),
        Channel("level_left", "m", 0.1),
        Channel("discharged_fraction", "-", 1.0),
        Channel("mass", "kg", 0.2),
        Channel("angle_of_repose", "rad", 0.5),
    )
}

Files = Mapping[str, str | bytes]


def read_case(path: Path, channels: Mapping[str, Channel]) -> Case:
    """A case file and the recordings that it names."""
    return complete_case(read_case_settings(path)[0], path, channels)


@dataclass(frozen=True)
class Flaw:
    """A folder of recordings, and what reading it must say."""

    name: str
    files: Files
    says: tuple[str, ...]  # parts of the notes of all repeats, or of the error
    refused: bool
    case: str | None = None  # the case file; None: all files are repeats of one recording
    extra: str = ""  # tables of the case file


def level(n: int = 60, *, seed: int = 0, noise: float = 0.2) -> tuple[Array, Array]:
    """Times [s] and levels [mm] of a hopper that runs empty, with measurement noise."""
    t = np.arange(n) / 40.0
    rng = np.random.default_rng(seed)
    return t, 10.0 + 90.0 * np.exp(-((t / 0.8) ** 1.5)) + noise * rng.standard_normal(n)


def lines(
    rows: list[tuple[str, ...]], header: str = "time [s],level [mm]", sep: str = ","
) -> list[str]:
    """The lines of a file."""
    return [header.replace(",", sep), *(sep.join(row) for row in rows)]


def rows(seed: int = 0, n: int = 60) -> list[tuple[str, ...]]:
    """Clean rows of time and level."""
    return [(f"{t:.3f}", f"{v:.3f}") for t, v in zip(*level(n, seed=seed), strict=True)]


def clean(seed: int = 0) -> str:
    """A file without a flaw."""
    return "\n".join(lines(rows(seed))) + "\n"


def changed(change: Callable[[list[str]], None], text: str | None = None) -> str:
    """A clean file after `change` of the list of its lines; index i is line i + 1."""
    made = (text or clean()).splitlines()
    change(made)
    return "\n".join(made) + "\n"


def replaced(line: int, text: str) -> str:
    """A clean file with another text in a line, counted from 1."""
    return changed(lambda made: made.__setitem__(line - 1, text))


def series(t: Array, v: Array, header: str = "time [s],level [mm]", digits: int = 3) -> str:
    """A file of these values."""
    return "\n".join(lines([(f"{a:.4f}", f"{b:.{digits}f}") for a, b in zip(t, v, strict=True)],
                           header)) + "\n"  # fmt: skip


def read_with(name: str, text: str | bytes, *says: str, extra: str = "") -> Flaw:
    """One file that must be read, with these words in the notes."""
    return Flaw(name, {"a.csv": text}, says, refused=False, extra=extra)


def refused(name: str, text: str | bytes, *says: str, extra: str = "") -> Flaw:
    """One file that must be refused, with these words in the error."""
    return Flaw(name, {"a.csv": text}, says, refused=True, extra=extra)


def case_text(files: Files, extra: str = "") -> str:
    """A case file with all files as repeats of one recording."""
    names = ", ".join(f'"{name}"' for name in files)
    return f"""[case]
name = "c"
[rig]
[parameters.friction]
range = [0.1, 0.8]
{extra}
[[recording]]
name = "run"
files = [{names}]
"""


def write(flaw: Flaw, folder: Path) -> Path:
    """Write the folder; return the path of the case file."""
    for name, content in flaw.files.items():
        data = content if isinstance(content, bytes) else content.encode()
        (folder / name).write_bytes(data)
    path = folder / "case.toml"
    path.write_text(flaw.case or case_text(flaw.files, flaw.extra), encoding="utf-8")
    return path


T, V = level()
COARSE = np.round(V / 5.0) * 5.0
COMMA = "\n".join(lines([(a.replace(".", ","), b.replace(".", ",")) for a, b in rows()], sep=";"))
SHIFTED = series(T + 0.3, V)

READ = [
    read_with("semicolons", clean().replace(",", ";"), "separated by semicolons"),
    read_with("tabs", clean().replace(",", "\t"), "separated by tabs"),
    read_with("decimal comma", COMMA, "decimal comma", "semicolons"),
    read_with("quoted decimal comma", "\n".join(
        lines([tuple(f'"{c.replace(".", ",")}"' for c in row) for row in rows()])
    ), "decimal comma"),
    read_with("byte-order mark", b"\xef\xbb\xbf" + clean().encode(), "byte-order mark"),
    read_with("UTF-16 of a spreadsheet", "\ufeff".encode("utf-16-le")
              + clean().replace(",", "\t").encode("utf-16-le"), "byte-order mark", "tabs"),
    read_with("line ends of Windows", clean().replace("\n", "\r\n")),
    read_with("blank lines", changed(lambda m: (m.insert(0, ""), m.insert(9, ""))[0]),
              "2 blank lines"),
    read_with("comments", changed(lambda m: (m.insert(0, "# camera 2"), m.insert(30, "# x"))[0]),
              "2 comment lines"),
    read_with("first line of a spreadsheet", "sep=;\n" + clean().replace(",", ";"), "semicolons"),
    read_with("trailing separators", "\n".join(f"{m},," for m in clean().splitlines()),
              "2 columns without a header left out"),
    read_with("trailing remark", replaced(7, rows()[5][0] + "," + rows()[5][1] + ",bubble"),
              "1 column without a header left out, 1 of them with content"),
    read_with("index column", "\n".join(
        [",time [s],level [mm]", *(f"{i},{a},{b}" for i, (a, b) in enumerate(rows()))]
    ), "column without a header"),
    read_with("empty cells", changed(lambda m: m.__setitem__(slice(5, 8), [
        m[5].split(",")[0] + ",", m[6].split(",")[0] + ",nan", m[7].split(",")[0] + ",N/A"])),
              "3 of 60 values of level are missing", "1 gap in time of level"),
    read_with("dropped frames", changed(lambda m: m.__delitem__(slice(20, 25))),
              "1 gap in time of level; the longest lasts 0.15 s from 0.45 s"),
    read_with("short last row", changed(lambda m: m.append("1.5")), "shorter than the header"),
    read_with("row without a time", replaced(9, ",33.0"), "1 row without a time", "line 9"),
    read_with("uneven times", series(T + 0.015 * np.sin(40.0 * np.arange(60)) ** 2, V),
              "Time steps of level vary"),
    read_with("repeated time stamps", changed(lambda m: m.insert(10, m[9].split(",")[0] + ",80")),
              "1 time stamp repeated", "line 11", "averaged"),
    read_with("quantised", series(T, COARSE, digits=1), "in steps of 5 mm"),
    read_with("clipped above", series(T, np.minimum(V, 85.0)), "at 85 mm", "clipped"),
    read_with("clipped below", series(T, np.maximum(V, 40.0)), "at 40 mm", "clipped"),
    read_with("limits of the sensor", series(T, np.minimum(V, 85.0)), "the sensor's limits",
              extra='[measurement.level]\nunit = "mm"\nlimits = [0.0, 85.0]'),
    read_with("unknown start", series(T + 12.34, V), "Time begins at 12.34 s", "unknown"),
    read_with("start before the gate", series(T - 0.2, V), "0.2 s before 0"),
    read_with("time in frames", "\n".join(
        ["frame,level [mm]", *(f"{i},{b}" for i, (_, b) in enumerate(rows()))]
    ), extra="[csv]\nframes_per_s = 40"),
    read_with("units in the second line", "time,level\ns,mm\n"
              + "\n".join(",".join(r) for r in rows()), "Units are in the second line"),
    read_with("header as a comment", "# made by a script\n# " + clean(), "header is a comment",
              "1 comment line"),
    read_with("dead sensor", series(T, 0.0 * V + 55.0), "All values of level are 55 mm"),
    read_with("unit after a slash", clean().replace("level [mm]", "level / mm")),
    read_with("packed", gzip.compress(clean().encode())),  # named .gz below
    Flaw("unequal rates", {"a.csv": clean(), "b.csv": series(np.linspace(0, 1.47, 23),
         np.interp(np.linspace(0, 1.47, 23), T, V))}, (), refused=False),
    Flaw("repeat that starts later", {"a.csv": clean(), "b.csv": series(
         T, np.interp(T - 0.3, *level(seed=1)))}, ("starts 0.3", "later than in a.csv"),
         refused=False),
    read_with("column left out on request", "\n".join(
        ["time [s],level [mm],v_mps", *(f"{a},{b},1" for a, b in rows())]
    ), "left out as the case file asks: v_mps", extra='[csv]\nignore = ["v_mps"]'),
]  # fmt: skip
READ = [
    f if f.name != "packed" else Flaw(f.name, {"a.csv.gz": f.files["a.csv"]}, f.says, False)
    for f in READ
]

REFUSED = [
    refused("time goes back", changed(lambda m: m.insert(20, m.pop(10))), "a.csv, line 21",
            "time = 0.225 s goes back from 0.475 s"),
    refused("two runs in one file", clean() + "\n".join(clean().splitlines()[1:]),
            "a.csv, line 62", "goes back", "rows"),
    refused("unknown unit", clean().replace("[mm]", "[furlong]"), "a.csv, line 1",
            "unknown unit 'furlong'", "mm"),
    refused("unknown unit without brackets", clean().replace("level [mm]", "level_inch"),
            "a.csv, line 1", "'inch' is no known unit"),
    refused("unit of another quantity", clean().replace("[mm]", "[kg]"), "a.csv, line 1",
            "'kg' does not measure level"),
    refused("no unit", clean().replace(" [mm]", ""), "a.csv, line 1", "'level' has no unit",
            "level [m]"),
    refused("metres for millimetres", clean().replace("[mm]", "[m]"), "a.csv, line 2",
            "is the unit mm?", "limit of 30"),
    refused("millimetres for metres", series(T, V / 1000.0, digits=6), "a.csv, line 2",
            "is the unit m?", "limit of 1/30"),
    refused("grams for kilograms", series(T, 2.0 * V, "time [s],mass [kg]"), "is the unit g?"),
    refused("percent for a share", series(T, 100.0 - V, "time [s],discharged_fraction [-]"),
            "limit of 10", "is the unit %?"),
    refused("one value 1 000 times too large", replaced(22, "0.500,62000"), "a.csv, line 22",
            "level = 62000 mm", "limit of 30"),
    refused("one value 1 000 times too small", replaced(22, "0.500,0.0645"), "a.csv, line 22",
            "about 1 000 times", "decimal sign"),
    refused("milliseconds for seconds", series(1e3 * T, V), "a.csv, line 61", "time = 1475 s",
            "is the unit ms?"),
    refused("empty", "", "a.csv is empty"),
    refused("blank and comments alone", "\n# nothing\n\n", "a.csv is empty"),
    refused("header alone", "time [s],level [mm]\n", "line 1", "no samples"),
    refused("one row", "time [s],level [mm]\n0,80\n", "1 time", "line 2", "at least 2"),
    refused("one time", "time [s],level [mm]\n0,80\n0,81\n", "1 time", "at least 2"),
    refused("column of gaps", "time [s],level [mm],mass [g]\n0,80,\n0.1,78,\n", "'mass [g]'",
            "0 values", "ignore"),
    refused("text in numbers", replaced(13, "0.275,about 80"), "a.csv, line 13",
            "level = 'about 80' is no number"),
    refused("unit in a cell", replaced(13, "0.275,80 mm"), "a.csv, line 13", "no number"),
    refused("time of day", replaced(2, "12:00:01,99"), "a.csv, line 2", "time = '12:00:01'"),
    refused("both decimal signs", changed(lambda m: m.__setitem__(15, '0.35,"78,5"')),
            "a.csv, line 16", "different decimal signs"),
    refused("sign for thousands", replaced(13, '0.275,"1,080.5"'), "a.csv, line 13", "no number"),
    refused("decimal comma between commas", "\n".join(
        ["time [s],level [mm]", *(f"{a},{b}".replace(".", ",") for a, b in rows())]
    ), "a.csv, line 2", "4 cells", "semicolons"),
    refused("infinite", replaced(13, "0.275,inf"), "a.csv, line 13", "finite"),
    refused("overflow", replaced(13, "0.275,1e999"), "a.csv, line 13", "finite"),
    refused("no time", clean().replace("time [s]", "level_left [mm]"), "a.csv, line 1",
            "no column holds the time"),
    refused("time alone", "time [s],\n0,\n1,\n", "a.csv, line 1", "no column beside the time"),
    refused("column twice", "time [s],level [mm],level [cm]\n0,80,8\n1,70,7\n", "a.csv, line 1",
            "columns 2 and 3 both hold 'level'"),
    refused("unknown channel", clean().replace("level", "levle"), "a.csv, line 1",
            "no channel 'levle'", "did you mean 'level'"),
    refused("no header", "\n".join(",".join(r) for r in rows()), "a.csv, line 1", "header"),
    refused("one column", "time [s]\n0\n1\n", "a.csv, line 1", "one column"),
    refused("encoding", clean().replace("level", "höhe").encode("latin-1"), "a.csv, line 1",
            "byte 0xf6", "UTF-8"),
    refused("a spreadsheet itself", b"PK\x03\x04\x00\x00" + bytes(range(128)) * 3, "a.csv, line 1",
            "save it as CSV"),
    refused("frames without a rate", clean().replace("time [s]", "frame"), "frames_per_s"),
    refused("separator of the header differs", clean().replace(",", ";", 1),
            "a.csv, line 2", "no number"),
    Flaw("missing file", {"a.csv": clean()}, ("b.csv does not exist", "folder"), True,
         case=case_text({"b.csv": ""})),
    Flaw("repeat of another experiment", {"a.csv": clean(), "b.csv": clean(1), "c.csv": series(
         T, 95.0 - 40.0 * np.tanh(T))}, ("level of c.csv differs", "limit of 10%", "leave one"),
         True),
    Flaw("repeat that jams", {"a.csv": clean(), "b.csv": series(T, np.maximum(level(seed=1)[1],
         70.0 + 0.1 * np.sin(99 * T)))}, ("differs from", "repeat_tolerance"), True),
    Flaw("repeat ten times too large", {"a.csv": clean(), "b.csv": clean(1).replace(
         "[mm]", "[cm]")}, ("level of", "differs"), True),
    Flaw("copy of a repeat", {"a.csv": clean(), "b.csv": clean()}, ("copy is no repeat",), True),
    Flaw("numbers that contradict", {}, ("angle_of_repose", "differs", "limit of 30%"), True,
         case=case_text({}).replace("files = []", 'scalars = { angle_of_repose = { values = '
                                    '[30.0, 31.0, 52.0], unit = "deg" } }')),
    Flaw("number in another unit", {}, ("angle_of_repose = 30 rad", "is the unit deg?"), True,
         case=case_text({}).replace("files = []", 'scalars = { angle_of_repose = { values = '
                                    '[30.0], unit = "rad" } }')),
]  # fmt: skip
