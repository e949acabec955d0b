"""One series written in every dialect reads identically."""

import itertools
from pathlib import Path

import numpy as np
import pytest
from recordings_corpus import CHANNELS, read_case

from calibration.recordings.records import Series

CASE = """[case]
name = "c"
[rig]
[parameters.friction]
range = [0.1, 0.8]
[[recording]]
name = "run"
files = ["a.csv"]
"""
HEADERS = (
    ("time [s]", "level [mm]", "discharged_fraction [%]"),
    ("Time (s)", "Level (mm)", "Discharged Fraction (percent)"),
    ("t_s", "level_mm", "discharged_fraction_pct"),
    ("time / s", "level in mm", "discharged-fraction [%]"),
)
DIALECTS = [
    (separator, decimal, encoding, end)
    for separator, decimal, encoding, end in itertools.product(
        (",", ";", "\t"), (".", ","), ("utf-8", "utf-8-sig", "utf-16"), ("\n", "\r\n", "\r")
    )
    if not separator == decimal == ","
]


def numbers(seed: int) -> list[tuple[float, float, float]]:
    """Random times [s], levels [mm] and shares [%], as a file may hold them."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 80))
    t = np.round(np.cumsum(rng.uniform(0.001, 0.2, n)) - rng.uniform(0.0, 0.1), 4)
    level = np.round(rng.uniform(20.0, 120.0, n), int(rng.integers(0, 5)))
    share = np.round(rng.uniform(20.0, 100.0, n), int(rng.integers(0, 5)))
    return list(zip(t.tolist(), level.tolist(), share.tolist(), strict=True))


def read(folder: Path, content: bytes) -> dict[str, Series]:
    folder.mkdir(exist_ok=True)
    (folder / "a.csv").write_bytes(content)
    (folder / "case.toml").write_text(CASE)
    return dict(read_case(folder / "case.toml", CHANNELS).recordings[0].repeats[0].series)


def written(
    rows: list[tuple[float, float, float]],
    header: tuple[str, ...],
    dialect: tuple[str, str, str, str],
    rng: np.random.Generator,
) -> bytes:
    """The rows in a dialect, with blank lines, comments, spaces and trailing separators."""
    separator, decimal, encoding, end = dialect
    trailing = separator * int(rng.integers(0, 3))
    made = ["# camera 2", separator.join(header) + trailing]
    for row in rows:
        cells = [repr(value).replace(".", decimal) for value in row]
        space = " " * int(rng.integers(0, 2)) if separator != "\t" else ""
        made.append(f"{separator}{space}".join(cells) + trailing)
        if rng.uniform() < 0.1:
            made.append(str(rng.choice(["", "  ", "# note; 3,5", "% note", separator])))
    return (end.join(made) + end).encode(encoding)


@pytest.mark.parametrize("seed", range(6))
def test_every_dialect_reads_identically(seed: int, tmp_path: Path) -> None:
    rows, rng = numbers(seed), np.random.default_rng(seed)
    plain = read(tmp_path / "plain", written(rows, HEADERS[0], (",", ".", "utf-8", "\n"), rng))
    for k, dialect in enumerate(DIALECTS):
        header = HEADERS[k % len(HEADERS)]
        made = read(tmp_path / "other", written(rows, header, dialect, rng))
        assert made.keys() == plain.keys()
        for name, series in made.items():
            assert np.array_equal(series.times, plain[name].times), (dialect, header)
            assert np.array_equal(series.values, plain[name].values), (dialect, header)
            assert np.array_equal(series.clipped, plain[name].clipped)
            assert series.quantum == plain[name].quantum


@pytest.mark.parametrize("seed", range(6))
def test_values_are_those_written_in_si_units(seed: int, tmp_path: Path) -> None:
    rows = numbers(seed)
    content = written(rows, HEADERS[0], (";", ",", "utf-8", "\n"), np.random.default_rng(0))
    series = read(tmp_path / "a", content)
    assert series["level"].values == pytest.approx([1e-3 * row[1] for row in rows], rel=1e-14)
    assert series["discharged_fraction"].values == pytest.approx(
        [1e-2 * row[2] for row in rows], rel=1e-14
    )


@pytest.mark.parametrize("seed", range(6))
def test_order_of_columns_does_not_matter(seed: int, tmp_path: Path) -> None:
    rows, rng = numbers(seed), np.random.default_rng(seed)
    dialect = (";", ".", "utf-8", "\n")
    plain = read(tmp_path / "a", written(rows, HEADERS[0], dialect, rng))
    turned = [(c, a, b) for a, b, c in rows]
    header = (HEADERS[0][2], HEADERS[0][0], HEADERS[0][1])
    other = read(tmp_path / "b", written(turned, header, dialect, rng))
    for name, series in plain.items():
        assert np.array_equal(series.times, other[name].times)
        assert np.array_equal(series.values, other[name].values)
