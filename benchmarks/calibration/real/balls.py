"""Cases of balls that were dropped from a bridge: the files of each, from a folder of recordings.

All balls start at 47 m in the simulation. The camera's scale and zero, and the moment of release,
are known within the errors that the case states: the same ball is at 45.6 m and 49.5 m in the
first picture of its two drops.
"""

import csv
import math
from collections.abc import Mapping
from pathlib import Path

from benchmarks.calibration.real.text import CaseText, function_rig, head

FOLDER, FILE = "ball_drops", "ball_drops.csv"
OUNCE = 0.0283495  # [kg]
SIMULATOR = Path(__file__).with_name("fall.py")
SIZES = {  # weight [oz] and circumference [cm], as in balls.txt; the volleyball was not weighed
    "Baseball": (5.0, 22.25), "Blue Basketball": (18.0, 75.0), "Green Basketball": (16.0, 73.25),
    "Bowling Ball": (81.0, 67.0), "Golf Ball": (1.62, 13.8), "Tennis Ball": (2.0, 20.75),
    "Whiffle Ball 1": (1.0, 22.8), "Whiffle Ball 2": (1.0, 22.8),
    "Yellow Whiffle Ball": (1.5, 29.0), "Orange Whiffle Ball": (1.5, 29.0),
}  # fmt: skip
PARAMETERS = {
    "linear": "[parameters.linear]        # [1/s]\nrange = [0.0, 0.6]\n",
    "quadratic": "[parameters.quadratic]     # [1/m]\nrange = [0.0, 0.06]\n",
    "drag": "[parameters.drag]          # coefficient of all balls\nrange = [0.0, 1.5]\n",
    "g": "[parameters.g]             # [m/s2]\nrange = [9.0, 11.0]\n",
    "speed": "[parameters.speed]         # [m/s] downwards at the release\nrange = [-0.5, 0.5]\n",
}
MODELS: Mapping[str, tuple[str, ...]] = {
    "linear": ("linear",), "quadratic": ("quadratic",), "both": ("linear", "quadratic"),
    "g": ("g",), "g-exact-scale": ("g",),
}  # fmt: skip
SCALE = 0.03  # 1 sd, relative, of the camera
RUNS = 60  # of a case of one ball


def before(name: str, parameters: tuple[str, ...], scale: float = SCALE) -> str:
    """The case file without recordings."""
    rig = function_rig(SIMULATOR, "fall", "height", "m", 47.0)
    measurement = f"""clock_offset_s = 0.1       # the release is not seen to a picture or two

[measurement.height]
offset = 1.5               # [m] zero, and height of the hand
scale = {scale}               # of the camera

[csv]
rename = {{ h_m = "height [m]" }}
ignore = ["v_mps"]
"""
    return head(name, rig, (PARAMETERS[p] for p in parameters), measurement)


def drop(ball: str, number: int, file: Path, conditions: str, *, held_out: bool) -> str:
    """One recording."""
    return f"""
[[recording]]
name = "{ball} {number}"
conditions = {{ height = 47.0, duration = 4.0{conditions} }}
files = ["{file}"]
rows = [{{ ball = "{ball}", drop = {number} }}]
held_out = {str(held_out).lower()}
"""


def cases(data: Path) -> list[CaseText]:
    """The cases of single balls, and of all together.

    One ball: fitted to its first drop, the second is held out. Pooled: one coefficient for all
    balls that were weighed, fitted to the first drops.
    """
    file = data / FOLDER / FILE
    with file.open() as lines:
        balls = list(dict.fromkeys(row["ball"] for row in csv.DictReader(lines)))
    made = [CaseText("pooled", pooled(file), 20 * 10 + 3 * 20)]
    for ball in balls:
        for model, parameters in MODELS.items():
            name = f"{ball.lower().replace(' ', '-')}-{model}"
            drops = (drop(ball, n, file, "", held_out=n == 2) for n in (1, 2))
            scale = 0.0 if "exact" in model else SCALE
            made.append(CaseText(name, before(name, parameters, scale) + "".join(drops), RUNS))
    return made


def pooled(file: Path) -> str:
    """The case file of all balls that were weighed, with one drag coefficient."""
    text = before("pooled", ("drag",))
    for ball in SIZES:
        text += "".join(drop(ball, n, file, measures(ball), held_out=n == 2) for n in (1, 2))
    return text


def measures(ball: str) -> str:
    """Mass [kg] and diameter [m] of a ball, as conditions."""
    weight, round_cm = SIZES[ball]
    return f", mass = {weight * OUNCE:.5f}, diameter = {round_cm / 100.0 / math.pi:.5f}"
