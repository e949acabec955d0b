"""Cases of a pendulum that swings out: segments 0 to 3 are fitted, 4 and 5 are held out.

The encoder gives angle and rate at the first sample of a segment, which are conditions, and
the time is counted from there.
"""

import csv
import gzip
import math
from collections.abc import Mapping
from pathlib import Path

from benchmarks.calibration.real.text import CaseText, function_rig, head

FOLDER, FILE = "pendulum_multiarm", "single_pendulum.csv.gz"
SIMULATOR = Path(__file__).parents[3] / "examples" / "calibration" / "pendulum" / "pendulum.py"
Ranges = Mapping[str, tuple[float, float]]

# [rad/s] from the time of 5 small swings, [1/s], [rad/s2]
RANGES = {"frequency": (7.7, 8.3), "viscous": (0.0, 0.3), "dry": (0.0, 0.6)}
# Around the parameters that the wide fit with both kinds of friction says it missed.
NARROWED = {"frequency": (7.9, 8.1), "viscous": (0.0, 0.12), "dry": (0.0, 0.15)}
FIXED = {"viscous": 0.0, "dry": 0.0}
MODELS = {
    "viscous": {k: RANGES[k] for k in ("frequency", "viscous")},
    "dry": {k: RANGES[k] for k in ("frequency", "dry")},
    "both": RANGES,
    "both-narrowed": NARROWED,
}
FITTED = 4
RUNS = 240
MEASUREMENT = """clock_offset_s = 0.0       # a segment begins where its conditions hold

[measurement.angle]
offset = 0.01              # of the zero
noise = 0.02               # the encoder has less: what the equation of motion may lack
"""
THINNED = 10  # of 1 000 samples a second, that many are one


def cases(data: Path) -> list[CaseText]:
    """The cases, one for each friction, and one with narrower ranges."""
    made = []
    for model, ranges in MODELS.items():
        fixed = {k: v for k, v in FIXED.items() if k not in ranges}
        text, files = case(data, f"pendulum-{model}", ranges, fixed)
        made.append(CaseText(f"pendulum-{model}", text, RUNS, files))
    return made


def case(
    data: Path, name: str, ranges: Ranges, fixed: Mapping[str, float], more: str = ""
) -> tuple[str, dict[str, str]]:
    """A case file and its recordings.

    Args:
        data: folder of recordings.
        name: of the case.
        ranges: of its parameters.
        fixed: values of the others.
        more: tables.
    """
    segments: dict[int, list[tuple[float, float, float]]] = {}
    with gzip.open(data / FOLDER / FILE, "rt") as lines:
        for row in csv.DictReader(lines):
            its = (float(row["t_s"]), float(row["theta"]) - math.pi, float(row["omega"]))
            segments.setdefault(int(row["seg"]), []).append(its)
    rig = function_rig(SIMULATOR, "swing", "angle", "rad", 3.0)
    tables = (f"[parameters.{k}]\nrange = {list(ends)}\n" for k, ends in ranges.items())
    known = "".join(f", {k} = {v}" for k, v in fixed.items())
    text = head(name, rig, tables, MEASUREMENT) + more
    text += "".join(segment(n, rows[0], known) for n, rows in segments.items())
    return text, {f"segment-{n}.csv": series(rows) for n, rows in segments.items()}


def series(rows: list[tuple[float, float, float]]) -> str:
    """A recording file of time and angle, with the time from the first sample."""
    lines = [f"{t - rows[0][0]:.4f},{angle:.6f}\n" for t, angle, _ in rows[::THINNED]]
    return "time [s],angle [rad]\n" + "".join(lines)


def segment(number: int, first: tuple[float, float, float], fixed: str) -> str:
    """One recording."""
    return f"""
[[recording]]
name = "segment {number}"
conditions = {{ angle = {first[1]:.6f}, rate = {first[2]:.6f}, duration = 9.2{fixed} }}
files = ["segment-{number}.csv"]
held_out = {str(number >= FITTED).lower()}
"""
